"""The reproduction: the verdict's rule, no printed number missing, every verdict recomputed, the pages and the command."""

from __future__ import annotations

import json
import re
import shutil
import subprocess
import sys
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from hydra.core.global_hydra import GlobalHydra
from PIL import Image

from pipeline.common.errors import ConfigError
from pipeline.config import documents
from pipeline.config.documents import half_width
from pipeline.config.found import Summary
from pipeline.reproduce import __main__ as reproduce
from pipeline.reproduce import drawings as document_figures
from pipeline.reproduce import pages as reproduction_pages
from pipeline.reproduce import tables as reproduction_tables
from pipeline.reproduce.recompute import recompute
from pipeline.reproduce.results import ResultError, Results
from pipeline.reproduce.table import COLUMNS, command, compare, counts, judge
from pipeline.reproduce.verdict import verdict
from pipeline.run import session
from tests.reports import leave_out_pictures
from tests.tasks import HUNG

CHROMIUM = next(filter(None, map(shutil.which, ("chromium", "chromium-browser", "google-chrome"))), None)
WORDS = {"b": "better", "m": "misprint", "d": "differs"}
# Every result that the documents print, in their order, as read from them, and the verdict on it: b better,
# m misprint, d differs, else reproduced. A number that the text repeats from a table stands once.
PRINTED = {
    ("pmke", "Table 3"): "0.615 | 0.615 m | 0.307 m",
    ("pmke", "Section 3.1"): "0.468 | 0",
    ("pmke", "Table 5"): """
        5.98e-3 m | 8.81e-3 m | +47.4   | 5.97e-3 m | -0.13   | 0.915 b |
        4.08e-3 b | 5.37e-3   | +31.7 b | 3.87e-3   | -5.03 b | 0.934 b |
        7.57e-3 b | 2.17e-2 d | +187 d  | 6.09e-3   | -19.5 b | 0.961 b |
        3.97e-2   | 5.17e-2   | +30.1   | 3.03e-2   | -23.6   | 0.914 b""",
    ("pmke", "Section 3.2"): "187.36 d | 0.0011 d | 0.0010 d | 0.0021 d",
    ("pmke", "Figure 4"): "0.063 | 0.017 | 0.197 | 0.203 | around three times | more than 10 times",
    ("pmke", "Figure 5"): "0.196 m | 0.095 | 0.529 | 0.613",
    ("pmke", "Figure 6"): "6.5 | 0.250 | 0.186 | 0.261 | 0.023",
    ("pmke", "Figure 7"): "0.780 d | 0.512",
    ("pmke", "Figure 8"): "0.0556 d | 6.33 d | 0.0998 | 5.71 | always lower d",
    ("global", "Figure 1"): "-4.0733 b | -0.2030 b",
    ("global", "Section 3.2"): "0.4678 | 0.0000 m | 0.0983 | 0.1526",
    ("global", "Table 4"): """
        3 b | 0.0532 d | 0.0528 | 8.5e-3 b | 0.0567 d | 0.0563 | 2.2e-2 b | 0.0673 d | 0.0671 | 3.8e-3 b""",
    ("global", "Table 5"): """
        0.0528 | 0.1827 | 290 b | 0.0528 | 0.1820 | 218 b |
        0.0795 b | 0.0912 b | 276 b | 0.0808 b | 0.0916 b | 160 b""",
    ("global", "Table 6"): "0.0554 | 1.898 | 282 b",
    ("global", "Figure 4"): "4.042 | 3.053 | 1.553 d | 0.7068",
    ("global", "Figure 6"): "0.29 | 0.38",
    ("global", "Figure 10"): "0.42 | around 1 % | around 1 %",
    ("global", "Figure 12"): "4.144 | 5.814 | one order of magnitude higher | only one",
    ("pontryagin", "Figure 3"): "0.0026",
    ("pontryagin", "Figure 4"): "larger than in the previous case",
    ("pontryagin", "Figure 5"): "one order bigger than before | joint variables do not exceed their limits",
    ("pontryagin", "Figure 6"): "0.06",
    ("pontryagin", "Figure 7"): "decreases of one order of magnitude",
}
FIGURES = {"pmke": range(2, 13), "global": range(1, 15), "pontryagin": range(3, 8)}
TABLES = {"pmke": range(2, 6), "global": range(1, 7), "pontryagin": range(0)}


def expected() -> list[tuple[str, str, str, str]]:
    """(document, place, printed, verdict) of every number."""
    rows = []
    for (document, place), cells in PRINTED.items():
        for cell in re.split(r"\s*\|\s*", cells.strip()):
            found = re.fullmatch(r"(.*?)(?: ([bmd]))?", cell)
            assert found is not None
            rows.append((document, place, found[1], WORDS.get(found[2], "reproduced")))
    return rows


def asked() -> list[documents.Document]:
    return [documents.read(name) for name in documents.DOCUMENTS]


# --- the rule ---------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("printed", "width"),
    [("8.81e-3", 5e-6), ("0.0528", 5e-5), ("+187", 0.5), ("-0.13", 5e-3), ("290", 0.5), ("6.5", 0.05)],
)
def test_half_a_unit_of_the_last_printed_digit(printed: str, width: float) -> None:
    assert half_width(printed) == pytest.approx(width, rel=1e-12)


@pytest.mark.parametrize("printed", ["", "about 3", "nan", "1e-3 m"])
def test_what_is_no_number_has_no_rounding(printed: str) -> None:
    with pytest.raises(ValueError, match="not a"):
        half_width(printed)


@pytest.mark.parametrize(
    ("printed", "value", "how", "word"),
    [
        ("0.0528", 0.05284, {}, "reproduced"),
        ("0.0528", 0.05285, {}, "reproduced"),  # on the edge
        ("0.0528", 0.05286, {}, "differs"),
        ("0.0528", 0.05286, {"tolerance": 1e-4}, "reproduced"),
        ("0.0528", 0.0520, {"better": "lower"}, "better"),
        ("0.0528", 0.0530, {"better": "lower"}, "differs"),
        ("3", 4.0, {"better": "higher"}, "better"),
        ("5.98e-3", 5.98e-4, {"reading": "5.98e-4"}, "misprint"),
        ("5.98e-3", 5.90e-4, {"reading": "5.98e-4"}, "differs"),
        ("5.98e-3", 5.90e-4, {"reading": "5.98e-4", "better": "lower"}, "better"),
        ("5.98e-3", 6.10e-4, {"reading": "5.98e-4", "better": "lower"}, "differs"),  # better than the misprint only
        ("one order", 8.0, {"between": (3.16, 31.6)}, "reproduced"),
        ("one order", 40.0, {"between": (3.16, 31.6)}, "differs"),
        ("0.0528", float("nan"), {"better": "lower"}, "differs"),
        ("0.0528", float("-inf"), {"better": "lower"}, "differs"),
    ],
)
def test_verdict(printed: str, value: float, how: dict[str, object], word: str) -> None:
    assert verdict(printed, value, **how) == word  # type: ignore[arg-type]


# --- the data ---------------------------------------------------------------------------------------------------------


def test_no_printed_number_is_missing_and_none_invented() -> None:
    rows = [(document.name, place.place, row.printed) for document in asked() for place, row in document.rows]
    assert rows == [row[:3] for row in expected()]


def test_every_table_and_figure_stands_in_the_order_of_the_original() -> None:
    for document in asked():
        drawn = [int(p.place.split()[1]) for p in document.places if p.place.startswith("Figure")]
        assert drawn == list(FIGURES[document.name])
        assert all(p.figures for p in document.places if p.place.startswith("Figure"))
        tables = [int(p.place.split()[1]) for p in document.places if p.place.startswith("Table")]
        assert tables == list(TABLES[document.name])


def test_what_differs_says_why_and_what_is_drawn_can_be_drawn() -> None:
    doubtful = [(d, p, printed) for d, p, printed, word in expected() if word in ("differs", "misprint")]
    notes = {(d.name, place.place, row.printed): row.note + row.why for d in asked() for place, row in d.rows}
    assert [row for row in doubtful if len(notes[row]) < 20] == []
    assert {figure.draw for d in asked() for place in d.places for figure in place.figures} == set(
        document_figures.DRAW
    )


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (("5.98e-3", "about 6"), "printed: 'about 6' is not a number; words need `between`"),
        (("why: ", "because: "), "because: unknown key"),
        (("kind: summary", "kind: sumary"), "allowed: summary, peak"),
        (("step 6 of the method leaves the interpolation open: 5.97e-4 (degree 3 and 4) to 5.99e-4 (degree 5)", ""), "needs its reason"),
        (("places:", "places: ]"), "expected"),
    ],
)  # fmt: skip
def test_bad_data_is_one_line(change: tuple[str, str], message: str, tmp_path: Path) -> None:
    good = (documents.FOLDER / "pmke.yaml").read_text(encoding="utf-8")
    assert change[0] in good
    (tmp_path / "pmke.yaml").write_text(good.replace(*change), encoding="utf-8")
    with pytest.raises(ConfigError) as raised:
        documents.read("pmke", tmp_path)
    assert message in str(raised.value)
    assert "\n" not in str(raised.value)


# --- the runs ---------------------------------------------------------------------------------------------------------


def runs_in(folder: Path) -> dict[str, Results]:
    return {file.parent.name: Results(file.parent) for file in (folder / "runs").glob("*/run.json")}


@pytest.mark.slow
def test_every_verdict_is_recomputed(reproduced: Path) -> None:
    """From runs made here, with fewer starts than `make reproduce` takes."""
    table = compare(asked(), runs_in(reproduced))
    assert list(table.columns) == list(COLUMNS)
    found = list(table[["document", "place", "printed", "verdict"]].itertuples(index=False, name=None))
    differing = [(one, other[3]) for one, other in zip(expected(), found, strict=True) if one != other]
    assert differing == []
    assert np.isfinite(table["recomputed"]).all()


@pytest.mark.slow
def test_the_printed_masses_give_no_printed_energy(reproduced: Path) -> None:
    table = compare(asked(), runs_in(reproduced))
    energies = table[
        table["with_printed_masses"].notna() & (table["unit"] == "J s") & (table["verdict"] == "reproduced")
    ]
    assert len(energies) >= 5
    share = energies["with_printed_masses"] / energies["printed"].astype(float)
    assert share.between(0.5, 0.8).all()


def test_a_finished_reproduction_says_what_its_runs_say() -> None:
    """Whatever lies in outputs/reproduction, if anything does."""
    file = reproduce.FOLDER / "reproduction.csv"
    if not file.is_file():
        pytest.skip("no outputs/reproduction: `make reproduce` makes it")
    table = pd.read_csv(file, dtype={"printed": str, "unit": str})
    again = compare([documents.read(name) for name in table["document"].unique()], runs_in(reproduce.FOLDER))
    assert list(table["verdict"]) == list(again["verdict"])
    np.testing.assert_allclose(table["recomputed"], again["recomputed"], rtol=1e-9)


@pytest.mark.slow
def test_a_number_that_no_run_holds_differs_and_says_so(reproduced: Path) -> None:
    (document,) = (d for d in asked() if d.name == "pontryagin")
    runs = runs_in(reproduced)
    del runs["case1"]
    table = compare([document], runs)
    lost = table[table["recomputed"].isna()]
    assert list(lost["place"]) == ["Figure 3", "Figure 4"]
    assert set(lost["verdict"]) == {"differs"}
    assert set(lost["note"]) == {"no run of experiment case1"}
    row = replace(document.rows[0][1], found=Summary("case4a", "pontryagin_as_printed", 7, "final_error"))
    with pytest.raises(ResultError, match="case4a: no pontryagin_as_printed 7"):
        recompute(row.found, runs)
    assert judge(row, 0.00261) == "reproduced"
    assert command(row) == "python -m pipeline +experiment=case4a"


@pytest.mark.slow
def test_a_motion_read_back_is_evaluated_to_the_same_numbers(reproduced: Path) -> None:
    run = runs_in(reproduced)["traj3"]
    for method in ("lsv", "pmke", "global"):
        e = run.evaluation(method)
        assert e.energy_integral[-1] == pytest.approx(run.cell(method, 1, "kinetic_energy_integral"), rel=1e-12)
    assert run.evaluation("lsv").solution.event_time == pytest.approx(6.48)


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
    assert "6 printed numbers: 6 reproduced, 0 better, 0 misprint, 0 differs" in text
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
    subprocess.run(
        [str(CHROMIUM), *(f"--{word}" for word in options + quiet), "--window-size=1250,3300", f"--screenshot={picture}", pages[1].as_uri()],
        check=True,
        timeout=HUNG,
        capture_output=True,
    )  # fmt: skip
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
    reproduce_here: Callable[..., tuple[int, str, str]], tmp_path: Path
) -> None:
    words = ("pontryagin", "methods=[pontryagin_as_printed]")
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
