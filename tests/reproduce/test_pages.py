"""Tables, pages and figures of a finished reproduction, and the command that makes them."""

from __future__ import annotations

import json
import re
import shutil
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from hydra.core.global_hydra import GlobalHydra
from PIL import Image

from pipeline.reproduce import __main__ as reproduce
from pipeline.reproduce import drawings as document_figures
from pipeline.reproduce import pages as reproduction_pages
from pipeline.reproduce import tables as reproduction_tables
from pipeline.reproduce.table import compare, counts
from pipeline.run import session
from tests.reports import leave_out_pictures
from tests.reproduce.printed import asked, runs_in
from tests.tasks import HUNG

CHROMIUM = next(filter(None, map(shutil.which, ("chromium", "chromium-browser", "google-chrome"))), None)


# --- tables and pages -------------------------------------------------------------------------------------------------


@pytest.fixture(scope="module")
def pages(reproduced: Path) -> list[Path]:
    chosen = [d for d in asked() if d.name == "pontryagin"]
    runs = runs_in(reproduced)
    table = compare(chosen, runs)
    reproduction_tables.write(reproduced, chosen, table)
    return reproduction_pages.write(reproduced, chosen, table, runs)


@pytest.mark.slow
def test_tables(pages: list[Path]) -> None:
    table = pd.read_csv(pages[0].with_name("reproduction.csv"))
    assert sum(counts(table).values()) == len(table) == 6
    text = pages[0].with_name("reproduction.md").read_text(encoding="utf-8")
    assert "6 printed numbers: 6 reproduced, 0 better, 0 misprints, 0 differ" in text
    assert "| Figure 3 | case 1, final position error (about) | 0.0026 m | 0.002553 | -1.81 % | reproduced |" in text


@pytest.mark.slow
def test_pages_are_self_contained(pages: list[Path]) -> None:
    index, page = (file.read_text(encoding="utf-8") for file in pages)
    assert page.count('<img alt="Figure') == page.count('src="data:image/png;base64,') == 5
    assert not re.search(r'(?:src|href)="(?!data:|[\w.]+\.html")', page + index)
    places = re.findall(r"<h2>(\w+ \d)", page)
    assert places == ["Section 8", "Figure 3", "Figure 4", "Figure 5", "Figure 6", "Figure 7"]
    assert page.count('class="verdict reproduced"') == 6
    assert 'href="pontryagin.html"' in index


@pytest.mark.slow
@pytest.mark.skipif(CHROMIUM is None, reason="needs chromium to open the pages")
def test_pages_open_in_a_browser(pages: list[Path], tmp_path: Path) -> None:
    options = (
        "headless",
        "no-sandbox",
        "disable-gpu",
        "no-first-run",
        "disable-background-networking",
        "hide-scrollbars",
    )
    quiet = ("disable-component-update", "disable-sync", "disable-quic", f"user-data-dir={tmp_path / 'profile'}")
    picture = tmp_path / "page.png"
    words = [*options, *quiet, "window-size=1250,3300", f"screenshot={picture}"]
    subprocess.run(
        [str(CHROMIUM), *(f"--{word}" for word in words), pages[1].as_uri()],
        check=True,
        timeout=HUNG,
        capture_output=True,
    )
    shown = np.asarray(Image.open(picture).convert("RGB")).astype(int)
    ink = (shown.min(axis=2) < 128).any(axis=1)  # rows of the picture with something dark
    assert ink[:1500].mean() > 0.3
    colourful = (np.ptp(shown, axis=2) > 100).sum()  # joint lines: pictures are really there
    assert colourful > 5000


@pytest.mark.slow
def test_figures_of_every_kind(reproduced: Path) -> None:
    """Each drawn once, of the runs that the documents name first for it; the front has a test of its own."""
    runs, seen = runs_in(reproduced), {"front"}
    for document in asked():
        for place in document.places:
            for drawing in place.figures:
                if drawing.draw in seen:
                    continue
                seen.add(drawing.draw)
                own = [runs[name] for name in drawing.experiments]
                figure = document_figures.DRAW[drawing.draw](own, drawing.methods, place.place)
                assert figure.axes, drawing.draw
                assert any(axes.lines or axes.collections for axes in figure.axes), drawing.draw
    assert seen == set(document_figures.DRAW)


# --- the command ------------------------------------------------------------------------------------------------------


@pytest.fixture
def reproduce_here(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capfd: pytest.CaptureFixture[str]
) -> Callable[..., tuple[int, str, str]]:
    """`python -m pipeline.reproduce --folder here ...` within this process."""
    monkeypatch.setenv("HYDRA_FULL_ERROR", "0")
    monkeypatch.chdir(tmp_path)
    leave_out_pictures(monkeypatch)

    def run(*words: str) -> tuple[int, str, str]:
        monkeypatch.setattr(session, "exit_code", 0)
        monkeypatch.setattr(sys, "argv", ["reproduce"])
        GlobalHydra.instance().clear()
        capfd.readouterr()
        code = reproduce.main(["--folder", "here", *words])
        GlobalHydra.instance().clear()
        return code, *capfd.readouterr()

    return run


@pytest.mark.slow
def test_a_line_per_experiment_and_nothing_twice(
    reproduce_here: Callable[..., tuple[int, str, str]], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(reproduction_pages, "_figure", lambda *_: "")  # drawn by the tests above
    words = ("pontryagin", "methods=[pontryagin_as_printed]", "timing.steps=50")
    code, out, error = reproduce_here(*words)
    assert (code, error) == (0, "")
    cases = ("case1", "case2", "case3", "case4a", "case4b")
    said = [line for line in out.splitlines() if line.startswith("[")]
    assert [re.sub(r"\d+ s$", "s", line) for line in said] == [
        f"[ {i + 1}/5] {c}: confirmed, s" for i, c in enumerate(cases)
    ]
    records = [(tmp_path / "here" / "runs" / case / "run.json").read_bytes() for case in cases]
    (tmp_path / "here" / "reproduction.csv").unlink()
    code, out, _ = reproduce_here(*words)
    assert code == 0
    assert out.count("finished before") == 5
    assert [(tmp_path / "here" / "runs" / case / "run.json").read_bytes() for case in cases] == records
    assert len(pd.read_csv(tmp_path / "here" / "reproduction.csv")) == 6
    assert json.loads(records[0])["config"]["name"] == "case1"


def test_help(reproduce_here: Callable[..., tuple[int, str, str]], tmp_path: Path) -> None:
    code, out, error = reproduce_here("--help")
    assert (code, error) == (0, "")
    assert "python -m pipeline.reproduce [pmke] [global] [pontryagin]" in out
    assert not (tmp_path / "here").exists()


@pytest.mark.parametrize(
    ("words", "message"),
    [
        (("pmk",), "error: pmk: no such document; allowed: pmke, global, pontryagin"),
        (("--folder",), "error: --folder: needs a folder"),
        (("pontryagin", "seeed=1"), "seeed: unknown key; did you mean seed?"),
    ],
)
def test_bad_words_are_one_line(
    words: tuple[str, ...], message: str, reproduce_here: Callable[..., tuple[int, str, str]], tmp_path: Path
) -> None:
    code, _, error = reproduce_here(*words)
    assert code == 2
    assert message in error
    assert error.count("\n") == 1
    assert not (tmp_path / "here" / "reproduction.csv").exists()
