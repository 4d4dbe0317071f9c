"""Tables as Markdown."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
import pandas as pd


def markdown_table(rows: Sequence[Sequence[str]]) -> list[str]:
    """The lines of a table, its head first; the first column is set left, all others right."""
    head, *body = ["| " + " | ".join(cell.replace("|", "\\|") for cell in row) + " |" for row in rows]
    return [head, "|---|" + "---:|" * (len(rows[0]) - 1), *body]


def cells(table: pd.DataFrame) -> list[list[str]]:
    """The rows of a table as text, its column names first; what is not there, or not finite, is empty."""
    rows = [[column.replace("_", " ") for column in table.columns]]
    for record in table.to_numpy():
        rows.append([_cell(value) for value in record])
    return rows


def _cell(value: Any) -> str:
    if isinstance(value, bool):
        return "yes" if value else ""
    if isinstance(value, str):
        return value
    return "" if pd.isna(value) or np.isinf(value) else f"{value:.5g}"
