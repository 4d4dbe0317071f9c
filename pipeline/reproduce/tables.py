"""The tables of the reproduction: reproduction.csv for programs, reproduction.md for people."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import pandas as pd

from pipeline.common.files import write_beside
from pipeline.common.markdown import markdown_table
from pipeline.config.documents import Document
from pipeline.reproduce.table import counts
from pipeline.reproduce.verdict import DIFFERS, MISPRINT, TIMING

TIMES = "Computing times, those of the document from its own machine"
HEAD = ("place", "quantity", "printed", "recomputed", "difference", "verdict", "with printed masses", "note")
SEVERAL = {MISPRINT: "misprints", DIFFERS: "differ"}


def write(folder: Path, documents: Sequence[Document], table: pd.DataFrame) -> None:
    """reproduction.csv and reproduction.md in `folder`."""
    write_beside(folder / "reproduction.csv", lambda file: table.to_csv(file, index=False))
    text = markdown(documents, table)
    write_beside(folder / "reproduction.md", lambda file: file.write_text(text, encoding="utf-8"))


def markdown(documents: Sequence[Document], table: pd.DataFrame) -> str:
    """A table per document, with the count of verdicts above it, and one of its computing times."""
    lines = ["# Printed and recomputed", "", sentence(table) + ".", ""]
    for document in documents:
        own = table[table["document"] == document.name]
        lines += [f"## {document.title}", "", f"{document.source}. {sentence(own)}.", ""]
        for title, part in (("", own[own["verdict"] != TIMING]), (TIMES, own[own["verdict"] == TIMING])):
            if len(part):
                rows = [list(HEAD), *(cells(row) for row in part.to_dict("records"))]
                lines += [*([f"### {title}", ""] if title else []), *markdown_table(rows), ""]
    return "\n".join(lines)


def sentence(table: pd.DataFrame) -> str:
    """How many of each verdict, in words, and how many ratios of these numbers and computing times stand beside."""
    judged, ratios, timings = counts(table), counts(table, derived=True), int((table["verdict"] == TIMING).sum())
    said = f"{sum(judged.values())} printed numbers: {_listed(judged)}"
    if any(ratios.values()):
        said += f"; {sum(ratios.values())} ratios of them, not counted again: {_listed(ratios)}"
    return said + f"; {timings} computing times, which are not judged" * (timings > 0)


def _listed(judged: Mapping[str, int]) -> str:
    return ", ".join(f"{count} {name if count == 1 else SEVERAL.get(name, name)}" for name, count in judged.items())


def cells(row: dict[Any, Any]) -> list[str]:
    """One row as text, in the order of HEAD."""
    unit = "" if row["unit"] in ("", "1") else f" {row['unit']}"
    difference = row["relative_difference"]
    return [
        str(row["place"]),
        str(row["quantity"]),
        f"{row['printed']}{unit}",
        _number(row["recomputed"]),
        "" if pd.isna(difference) else f"{100 * difference:+.3g} %",
        str(row["verdict"]),
        _number(row["with_printed_masses"]),
        str(row["note"]),
    ]


def _number(value: float) -> str:
    return "" if pd.isna(value) else f"{value:.4g}"
