"""The table of a suite: suite.csv with all columns, suite.md for people."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import pandas as pd

from pipeline.common.files import write_beside
from pipeline.common.markdown import markdown_table

SHOWN = {
    "problem": "problem",
    "robot": "robot",
    "r": "r",
    "status": "status",
    "pieces": "pieces",
    "energy": "energy [J s]",
    "velocity_norm": "velocity norm [rad²/s]",
    "joint_path": "joint path [rad]",
    "clearance_m": "clearance [mm]",
    "path_error_m": "path error [mm]",
    "certified_gap": "certified to",
    "processor_s": "processor time [s]",
}
SCALES = {"clearance_m": 1e3, "path_error_m": 1e3}


def save(folder: Path, rows: Sequence[Mapping[str, Any]]) -> None:
    """Both files into `folder`."""
    table = pd.DataFrame(rows)
    folder.mkdir(parents=True, exist_ok=True)
    write_beside(folder / "suite.csv", lambda file: table.to_csv(file, index=False))
    text = "\n".join(lines(rows)) + "\n"
    write_beside(folder / "suite.md", lambda file: file.write_text(text, encoding="utf-8"))


def lines(rows: Sequence[Mapping[str, Any]]) -> list[str]:
    """The lines of Markdown."""
    body = [[_cell(key, row.get(key, float("nan"))) for key in SHOWN] for row in rows]
    return markdown_table([list(SHOWN.values()), *body])


def _cell(key: str, value: Any) -> str:
    if isinstance(value, str | int):
        return str(value)
    if value != value or value == float("inf"):
        return ""
    return f"{100 * value:.2g} %" if key == "certified_gap" else f"{SCALES.get(key, 1.0) * value:.4g}"
