"""What stands on the terminal, on a narrow one too."""

from __future__ import annotations

import io

import pytest
from rich.console import Console as RichConsole

from pipeline.run.console import Console
from tests.reports import three_motions


@pytest.mark.parametrize("width", [60, 80, 140])
def test_the_verdict_comes_first_and_the_table_fits(width: int) -> None:
    console, said = Console(), io.StringIO()
    console.console = RichConsole(file=said, width=width, highlight=False)
    console.report(three_motions())
    text = said.getvalue()
    assert text.startswith("Best found: global 1: ")
    head = next(line for line in text.splitlines() if line.startswith("motion"))
    assert "energy [J s]" in head  # a unit is no markup
    assert ("torque² [N² m² s]" in head) == (width == 140)
    assert "…" not in text
    assert max(map(len, text.split("lsv: met one")[0].splitlines())) <= width
    assert "global: confirmed by IPOPT: well" in text


def test_a_plain_log_has_a_line_per_phase(capsys: pytest.CaptureFixture[str]) -> None:
    console = Console()
    with console.progress("mine") as (progress, phase):
        phase("drawing starts")
        for done in range(1, 9):
            progress(done, 8, 0.5)
    console.phase("mine", "evaluating")
    starts = [f"mine: {done}/8 starts, best 0.5" for done in (2, 4, 6, 8)]
    assert capsys.readouterr().out.splitlines() == ["mine: drawing starts", *starts, "mine: evaluating"]


def test_a_bar_says_its_phase() -> None:
    console, said = Console(), io.StringIO()
    console.console = RichConsole(file=said, width=100, force_terminal=True)
    with console.progress("mine") as (progress, phase):
        phase("drawing starts")
        progress(1, 8, 0.5)
    assert "drawing starts, best 0.5" in said.getvalue()
