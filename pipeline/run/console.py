"""What a run says on the terminal: progress while it works, then the result, and at the end where it lies."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from functools import partial
from pathlib import Path

from rich.console import Console as RichConsole
from rich.markup import escape
from rich.progress import BarColumn, MofNCompleteColumn, TextColumn, TimeElapsedColumn
from rich.progress import Progress as Bar
from rich.table import Table

from pipeline.artifacts.report import Report
from pipeline.artifacts.table import rows
from pipeline.artifacts.verdict import verdict
from pipeline.problem.solution import Progress

Phase = Callable[[str], None]
WORDS = ("motion", "status", "closest limit")
WRAPPED = ("status",)
SPARE = ("time [s]", "torque² [N² m² s]", "path error [m]", "closest limit")  # what a narrow console leaves out first
LINE_EVERY = 0.25  # of the work, where there is no terminal to draw a bar on


class Console:
    def __init__(self) -> None:
        self.console = RichConsole(highlight=False)

    @contextmanager
    def progress(self, name: str) -> Iterator[tuple[Progress, Phase]]:
        """A bar with the phase and the best cost so far; without a terminal, a line per phase and now and then."""
        if not self.console.is_terminal:
            yield self._lines(name), partial(self.phase, name)
            return
        columns = (
            TextColumn(name),
            BarColumn(),
            MofNCompleteColumn(),
            TextColumn("{task.description}"),
            TimeElapsedColumn(),
        )
        with Bar(*columns, console=self.console, transient=True) as bar:
            task, now = bar.add_task("", total=None), ""

            def show(done: int, total: int, best: float) -> None:
                bar.update(task, completed=done, total=total, description=f"{now}, best {best:.5g}")

            def begin(words: str) -> None:
                nonlocal now
                now = words
                bar.update(task, description=words)

            yield show, begin

    def phase(self, name: str, words: str) -> None:
        """What begins now: said where nobody sees a bar."""
        if not self.console.is_terminal:
            print(f"{name}: {words}", flush=True)

    def _lines(self, name: str) -> Progress:
        said = 0.0

        def show(done: int, total: int, best: float) -> None:
            nonlocal said
            if done / total >= said + LINE_EVERY or done == total:
                said = done / total
                print(f"{name}: {done}/{total} starts, best {best:.5g}", flush=True)

        return show

    def report(self, report: Report) -> None:
        """The verdict, the motions beside each other, what there is to say of each, and what the studies say."""
        self.console.print(verdict(report), markup=False, style="bold")
        self.console.print()
        compared = _fitting(rows(report), self.console.width)
        table = Table(box=None, header_style="bold", pad_edge=False)
        for title in compared[0]:
            table.add_column(escape(title), no_wrap=title not in WRAPPED, justify="left" if title in WORDS else "right")
        for row in compared:
            table.add_row(*map(escape, row.values()))
        self.console.print(table)
        self.console.print()
        for e in report.motions.evaluations:
            for said in (e.message, e.solution.evidence if e.solution.optimum == 1 else ""):
                if said:
                    self.console.print(f"{e.method}: {said}", soft_wrap=True, markup=False)
        for line in (line for result in report.results for line in result.said()):
            self.console.print(line, soft_wrap=True, markup=False)

    def where(self, folder: Path) -> None:
        """Where it all lies."""
        self.console.print(f"results in {folder}", soft_wrap=True)


def _fitting(table: Sequence[Mapping[str, str]], width: int) -> list[dict[str, str]]:
    """The rows without those columns for which the console is too narrow; summary.md has them all."""
    kept = list(table[0])
    for spare in (*SPARE, *kept):
        if _wide(table, kept) <= width:
            break
        if spare in kept[2:]:
            kept.remove(spare)
    return [{title: row[title] for title in kept} for row in table]


def _wide(table: Sequence[Mapping[str, str]], kept: Sequence[str]) -> int:
    """How many characters the columns take side by side."""
    longest = 0
    for title in kept:
        cells = [title, *(row[title] for row in table)]
        words = [word for cell in cells for word in (cell.split(", ") if title in WRAPPED else [cell])]
        longest += max(map(len, words)) + 2
    return longest - 2
