"""What a run says on the terminal: progress while it works, then the result, and at the end where it lies."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from pathlib import Path

import pandas as pd
from rich.console import Console as RichConsole
from rich.markup import escape
from rich.progress import BarColumn, MofNCompleteColumn, TextColumn, TimeElapsedColumn
from rich.progress import Progress as Bar
from rich.table import Table

from pipeline.problem.solution import Progress
from pipeline.studies.study import Result

LINE_EVERY = 0.25  # of the work, where there is no terminal to draw a bar on


class Console:
    def __init__(self) -> None:
        self.console = RichConsole(highlight=False)

    @contextmanager
    def progress(self, name: str) -> Iterator[Progress]:
        """A bar with the best cost so far; without a terminal, a plain line now and then."""
        if not self.console.is_terminal:
            yield self._lines(name)
            return
        columns = (
            TextColumn(name),
            BarColumn(),
            MofNCompleteColumn(),
            TextColumn("{task.description}"),
            TimeElapsedColumn(),
        )
        with Bar(*columns, console=self.console, transient=True) as bar:
            task = bar.add_task("", total=None)

            def show(done: int, total: int, best: float) -> None:
                bar.update(task, completed=done, total=total, description=f"best {best:.5g}")

            yield show

    def _lines(self, name: str) -> Progress:
        said = 0.0

        def show(done: int, total: int, best: float) -> None:
            nonlocal said
            if done / total >= said + LINE_EVERY or done == total:
                said = done / total
                print(f"{name}: {done}/{total} starts, best {best:.5g}", flush=True)

        return show

    def report(self, summary: pd.DataFrame, results: Iterable[Result]) -> None:
        """The table of the motions, what there is to say of each, and what the studies say."""
        table = Table(box=None, header_style="bold")
        for title in (
            "method",
            "status",
            "energy [J s]",
            "torque² [N² m² s]",
            "error [m]",
            "time [s]",
        ):
            table.add_column(escape(title), no_wrap=True, justify="left" if title in ("method", "status") else "right")
        for row in summary.to_dict("records"):
            label = row["method"] if row["optimum"] == 1 else f"{row['method']} {row['optimum']}"
            figures = [f"{row[key]:.5g}" for key in ("kinetic_energy_integral", "torque_integral")]
            table.add_row(
                label, row["status"], *figures, f"{row['max_tracking_error']:.1e}", f"{row['wall_time_s']:.2f}"
            )
        self.console.print(table)
        for row in summary.to_dict("records"):
            if row["message"]:
                self.console.print(f"{row['method']}: {row['message']}", soft_wrap=True)
            if row["evidence"] and row["optimum"] == 1:
                self.console.print(f"{row['method']}: {row['evidence']}", soft_wrap=True)
        for line in (line for result in results for line in result.said()):
            self.console.print(line, soft_wrap=True, markup=False)

    def where(self, folder: Path) -> None:
        """Where it all lies."""
        self.console.print(f"results in {folder}", soft_wrap=True)
