"""Runs that exist, beside each other."""

from __future__ import annotations

from pathlib import Path

import pandas as pd
import pytest

from pipeline.artifacts import summary
from pipeline.artifacts.page import page
from pipeline.compare.__main__ import main, names
from tests.reports import three_motions


@pytest.fixture(scope="module")
def runs(tmp_path_factory: pytest.TempPathFactory) -> list[Path]:
    """Two that are the same, and one that has left no page."""
    above: Path = tmp_path_factory.mktemp("runs")
    made = [above / "a" / "run", above / "b" / "run", above / "old"]
    for folder in made:
        folder.mkdir(parents=True)
        summary.write(three_motions(), folder)
    for folder in made[:2]:
        page.write(three_motions(), folder)
    return made


@pytest.mark.slow
def test_table_figure_and_page(runs: list[Path], tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    folder = tmp_path / "beside"
    assert main([*map(str, runs), "--folder", str(folder)]) == 0
    assert capsys.readouterr().out == f"comparison in {folder}\n"
    assert {file.name for file in folder.iterdir()} == {
        "comparison.csv",
        "comparison.md",
        "comparison.png",
        "report.html",
    }
    table = pd.read_csv(folder / "comparison.csv")
    assert list(table["run"]) == [name for name in ("a/run", "b/run", "old") for _ in range(3)]
    own = pd.read_csv(runs[0] / "summary.csv")
    assert list(table["torque_integral"]) == 3 * list(own["torque_integral"])
    assert [run["name"] for run in page.read(folder)] == ["a/run", "b/run"]
    assert "old has left no page." in (folder / "report.html").read_text(encoding="utf-8")
    assert (folder / "comparison.png").read_bytes().startswith(b"\x89PNG")


def test_names_are_as_short_as_they_tell_runs_apart() -> None:
    assert names([Path("/x/a/run"), Path("/x/b/other")]) == ["run", "other"]
    assert names([Path("/x/a/run"), Path("/x/b/run")]) == ["a/run", "b/run"]


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (["nowhere"], "nowhere: not the folder of a run"),
        (["--folder"], "--folder: needs a folder"),
        (["--folder", "x"], "no run is named"),
    ],
)
def test_bad_words_are_one_line(words: list[str], said: str, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(words) == 2
    error = capsys.readouterr().err
    assert error.startswith("error: ")
    assert said in error
    assert error.count("\n") == 1


def test_a_runs_own_page_is_not_written_over(runs: list[Path], capsys: pytest.CaptureFixture[str]) -> None:
    assert main([str(runs[0]), "--folder", str(runs[0])]) == 2
    assert "keeps its own report.html" in capsys.readouterr().err
    assert main([str(runs[0]), str(runs[0])]) == 2
    assert "named twice" in capsys.readouterr().err


def test_help(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["--help"]) == 0
    assert "python -m pipeline.compare RUN RUN" in capsys.readouterr().out
