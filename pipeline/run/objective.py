"""The number of a finished run that a sweeper optimises (`sweep.objective`)."""

from __future__ import annotations

import json
import math
from collections.abc import Sequence
from pathlib import Path

import pandas as pd


def numbers(folder: Path, measures: Sequence[str], directions: Sequence[str]) -> list[float]:
    """Of the motion that the run in `folder` chose, read where everybody reads them: summary.csv.

    A run without such a motion is worse than any other: infinite, by what the sweeper does with each (`maximize`).
    """
    wanted = [*directions, *["minimize"] * (len(measures) - len(directions))]
    worst = [-math.inf if direction == "maximize" else math.inf for direction in wanted]
    try:
        chosen = json.loads((folder / "run.json").read_text(encoding="utf-8"))["chosen"]
        table = pd.read_csv(folder / "summary.csv")
    except (OSError, ValueError, KeyError):
        return worst[: len(measures)]
    if chosen is None:
        return worst[: len(measures)]
    row = table[(table["method"] == chosen["method"]) & (table["optimum"] == chosen["optimum"])].iloc[0]
    return [_number(row, name, bad) for name, bad in zip(measures, worst, strict=False)]


def _number(row: pd.Series, name: str, worst: float) -> float:
    """One column, or the largest of those of all joints."""
    columns = [column for column in row.index if column == name or column.rpartition("_")[0] == name]
    value = float(row[columns].astype(float).max()) if columns else math.nan
    return value if math.isfinite(value) else worst
