"""The tables of a sweep: sweep.csv and sweep.md, one row per run and motion; a failed run is a row with its reason."""

from __future__ import annotations

import json
import traceback
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
from omegaconf import OmegaConf

from pipeline.common.files import write_beside
from pipeline.common.markdown import markdown_table

# Title in sweep.md, column of summary.csv, format, factor.
NUMBERS = (
    ("kinetic energy [J s]", "kinetic_energy_integral", "{:.4g}", 1),
    ("printed", "published_kinetic_energy_integral", "{:.4g}", 1),
    ("difference", "difference_kinetic_energy_integral", "{:+.2g} %", 100),
    ("torque integral [N² m² s]", "torque_integral", "{:.4g}", 1),
    ("tracking error [m]", "max_tracking_error", "{:.1e}", 1),
    ("wall time [s]", "wall_time_s", "{:.3g}", 1),
)


def write_failure(folder: Path, reason: str, status: str = "bad input") -> None:
    """A run of a sweep that came to nothing leaves its reason, so that the sweep's table has a row for it."""
    row = pd.DataFrame([{"method": "", "optimum": 0, "status": status, "message": reason}])
    write_beside(folder / "summary.csv", lambda file: row.to_csv(file, index=False))


def write_traceback(folder: Path, error: BaseException) -> None:
    """error.txt: where an error that nobody foresaw came from."""
    text = "".join(traceback.format_exception(error))
    write_beside(folder / "error.txt", lambda file: file.write_text(text, encoding="utf-8"))


def exit_code(folder: Path) -> int:
    """Of the run in `folder`, as it would have been on its own."""
    record = folder / "run.json"
    if record.is_file():
        return int(json.loads(record.read_text(encoding="utf-8"))["exit_code"])
    return 2 if "bad input" in _summary(folder)["status"].to_numpy() else 1


def write(folder: Path, runs: Sequence[Path] | None = None) -> None:
    """sweep.csv and sweep.md in `folder`, of `runs` (None: all below it that left a summary)."""
    if runs is None:
        runs = [file.parent for file in folder.glob("*/summary.csv")]
    if not runs:
        return
    runs = in_order(runs)
    save(folder, "sweep", f"Sweep {folder.name}", runs, [run.name for run in runs])
    print(f"sweep table in {folder / 'sweep.md'}")


def save(folder: Path, name: str, title: str, runs: Sequence[Path], names: Sequence[str]) -> None:
    """The table of `runs`, called `names`, as `name`.csv and `name`.md."""
    overrides = swept_by(runs)
    parts = []
    for run, called, own in zip(runs, names, overrides, strict=True):
        part = _summary(run)
        taken = set(part.columns)
        words = {key if key not in taken else f"override {key}": value for key, value in own.items()}
        parts.append(pd.concat([pd.DataFrame({"run": called, **words}, index=part.index), part], axis=1))
    table = pd.concat(parts, ignore_index=True)
    write_beside(folder / f"{name}.csv", lambda file: table.to_csv(file, index=False))
    swept = list(table.columns[1 : 1 + len(overrides[0])])
    notes = table["published_note"].dropna().unique().tolist() if "published_note" in table else []
    rows = [["run", *swept, "method", "status", *(title for title, *_ in NUMBERS), "message"]]
    rows += [_cells(row, swept) for row in table.to_dict("records")]
    text = "\n".join([f"# {title}", "", *markdown_table(rows), "", *(f"- {note}" for note in notes), ""])
    write_beside(folder / f"{name}.md", lambda file: file.write_text(text, encoding="utf-8"))


def in_order(runs: Sequence[Path]) -> list[Path]:
    """As they were run: 2 before 10."""
    return sorted(runs, key=lambda run: _natural(run.name))


def swept_by(runs: Sequence[Path]) -> list[dict[str, str]]:
    """What the command line said for each run that it did not say for all of them."""
    return _swept([_overrides(run) for run in runs])


def _cells(row: Mapping[Any, Any], swept: Sequence[str]) -> list[str]:
    label = row["method"] if row["optimum"] in (0, 1) else f"{row['method']} {row['optimum']}"
    numbers = [(factor * row.get(column, np.nan), form) for _, column, form, factor in NUMBERS]
    formatted = ["" if pd.isna(value) else form.format(value) for value, form in numbers]
    words = [row["run"], *(row[key] for key in swept), label, row["status"], *formatted, row["message"]]
    return ["" if pd.isna(word) else str(word) for word in words]


def _summary(folder: Path) -> pd.DataFrame:
    file = folder / "summary.csv"
    if not file.is_file():
        write_failure(folder, "ended without a result", "error")
    return pd.read_csv(file)


def _overrides(folder: Path) -> dict[str, str]:
    """What the command line said for this run: {key: value}."""
    file = folder / ".hydra" / "overrides.yaml"
    words = OmegaConf.to_container(OmegaConf.load(file)) if file.is_file() else []
    assert isinstance(words, list)
    return {key.lstrip("+~"): value for key, _, value in (str(word).partition("=") for word in words)}


def _swept(overrides: Sequence[Mapping[str, str]]) -> list[dict[str, str]]:
    """Only the keys that are not the same in all runs."""
    keys = dict.fromkeys(key for own in overrides for key in own)
    varied = [key for key in keys if len({own.get(key) for own in overrides}) > 1]
    return [{key: own.get(key, "") for key in varied} for own in overrides]


def _natural(name: str) -> tuple[int, str]:
    number, _, rest = name.partition("_")
    return (int(number) if number.isdigit() else -1), rest
