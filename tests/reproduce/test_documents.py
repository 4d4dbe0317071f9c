"""What the documents print and the rule of the verdict: no number missing, none invented, bad data in one line."""

from __future__ import annotations

from pathlib import Path

import pytest

from pipeline.common.errors import ConfigError
from pipeline.config import documents
from pipeline.config.documents import half_width
from pipeline.reproduce import drawings as document_figures
from pipeline.reproduce.verdict import verdict
from tests.reproduce.printed import FIGURES, TABLES, asked, expected
from tests.support import ROOT

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
    notes = {(d.name, place.place, row.printed): row.note for d in asked() for place, row in d.rows}
    assert [row for row in doubtful if len(notes[row]) < 20] == []
    assert {figure.draw for d in asked() for place in d.places for figure in place.figures} == set(
        document_figures.DRAW
    )


def test_every_line_of_the_errata_names_its_command() -> None:
    """That every command is accepted: tests/test_readme.py; what a sample of them shows: test_reproduce.py."""
    text = (ROOT / "docs" / "errata.md").read_text(encoding="utf-8")
    lines = [line for line in text.splitlines() if line.startswith("| ") and "what shows it" not in line]
    assert len(lines) > 25
    assert [line for line in lines if "`python -m " not in line.split("|")[-2]] == []


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (("5.98e-3", "about 6"), "printed: 'about 6' is not a number; words need `between`"),
        (("note: ", "tolerance: "), "tolerance: unknown key"),
        (("kind: summary", "kind: sumary"), "allowed: summary, peak"),
        (("places:", "places: ]"), "expected"),
    ],
)
def test_bad_data_is_one_line(change: tuple[str, str], message: str, tmp_path: Path) -> None:
    good = (documents.FOLDER / "pmke.yaml").read_text(encoding="utf-8")
    assert change[0] in good
    (tmp_path / "pmke.yaml").write_text(good.replace(*change), encoding="utf-8")
    with pytest.raises(ConfigError) as raised:
        documents.read("pmke", tmp_path)
    assert message in str(raised.value)
    assert "\n" not in str(raised.value)
