"""Printed beside recomputed: one row per printed number, with its verdict and the command that gives it."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import pandas as pd

from pipeline.config.documents import Document, Row
from pipeline.reproduce.recompute import Runs, recompute
from pipeline.reproduce.results import NotRunError, ResultError
from pipeline.reproduce.verdict import NOT_RUN, TIMING, VERDICTS, verdict

RATIO = "a ratio of numbers that stand here too, not counted again"
COLUMNS = (
    "document",
    "place",
    "quantity",
    "printed",
    "unit",
    "recomputed",
    "relative_difference",
    "verdict",
    "derived",
    "with_printed_masses",
    "note",
    "command",
)


def judge(row: Row, value: float) -> str:
    """The verdict on one row whose recomputed value is known; a computing time gets none."""
    if row.found.timing and np.isfinite(value):
        return TIMING
    between = None if row.between is None else (row.between[0], row.between[1])
    return verdict(row.printed, value, reading=row.reading, between=between, better=row.better)


def command(row: Row) -> str:
    """The command line whose results hold the number."""
    names = row.found.experiments
    return f"python -m pipeline {'-m ' if len(names) > 1 else ''}+experiment={','.join(names)}"


def compare(documents: Sequence[Document], runs: Runs) -> pd.DataFrame:
    """All rows of the documents, in their order; a number that its run does not hold differs, with the reason."""
    masses = _with_printed_masses(runs)
    rows = []
    for document in documents:
        for place, row in document.rows:
            note = row.note
            try:
                value = recompute(row.found, runs)
                word = judge(row, value)
            except NotRunError as error:
                value, note, word = float("nan"), str(error), NOT_RUN
            except ResultError as error:
                value, note, word = float("nan"), str(error), judge(row, float("nan"))
            rows.append(
                {
                    "document": document.name,
                    "place": place.place,
                    "quantity": row.quantity,
                    "printed": row.printed,
                    "unit": row.unit,
                    "recomputed": value,
                    "relative_difference": _difference(row, value),
                    "verdict": word,
                    "derived": document.derived(row),
                    "with_printed_masses": masses.get((document.name, place.place, row.quantity), np.nan),
                    "note": "; ".join(filter(None, (_read_as(row), RATIO * document.derived(row), note))),
                    "command": command(row),
                }
            )
    return pd.DataFrame(rows, columns=list(COLUMNS))


def counts(table: pd.DataFrame, *, derived: bool = False) -> dict[str, int]:
    """How many rows have each verdict, and how many wait for their run, if any do; computing times have none.

    derived: of the ratios of numbers that have rows of their own, which are not counted with these.
    """
    counted = table["verdict"][table["derived"] == derived]
    found = {name: int((counted == name).sum()) for name in (*VERDICTS, NOT_RUN)}
    return {name: count for name, count in found.items() if count or name in VERDICTS}


def _read_as(row: Row) -> str:
    return f"read as {row.reading}" if row.reading else ""


def _difference(row: Row, value: float) -> float:
    """recomputed / printed - 1; none where words are printed, or zero."""
    if row.between is not None or float(row.printed) == 0:
        return float("nan")
    return value / float(row.printed) - 1


def _with_printed_masses(runs: Runs) -> dict[tuple[str, str, str], float]:
    """What the masses of the documents' tables give, from the run that identifies them."""
    if "identify_masses" not in runs:
        return {}
    try:
        found = runs["identify_masses"].table("identification")
    except ResultError:
        return {}
    keys = zip(found["document"], found["place"], found["quantity"], strict=True)
    return dict(zip(keys, found["with_printed_masses"], strict=True))
