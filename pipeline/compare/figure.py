"""The figure of a comparison: two integrals of every motion, as bars."""

from __future__ import annotations

from functools import partial
from pathlib import Path

import numpy as np
import pandas as pd

from pipeline.common.files import write_beside
from pipeline.problem.integrals import INTEGRALS
from pipeline.studies import style

DPI = 130


def draw(file: Path, table: Path) -> None:
    """The energies and squared torques in `table` (comparison.csv), motion by motion."""
    records = [row for row in pd.read_csv(table).to_dict("records") if row["optimum"] > 0]
    own = [row["method"] + (f" {row['optimum']}" if row["optimum"] > 1 else "") for row in records]
    whole = [row["status"] != "singular" for row in records]  # of others the integrals say nothing
    labels = [
        f"{row['run']}: {name}" + ("" if good else " (singular)")
        for row, name, good in zip(records, own, whole, strict=True)
    ]
    figure = style.sheet(10.0, 1.4 + 0.28 * len(records))
    places = np.arange(len(records))[::-1]
    for panel, name in enumerate(("kinetic_energy", "torque")):
        axes = figure.add_subplot(1, 2, panel + 1)
        values = [row[f"{name}_integral"] if good else np.nan for row, good in zip(records, whole, strict=True)]
        axes.barh(places, values, color=list(map(style.color, own)), height=0.7)
        axes.set_xlabel(f"{INTEGRALS[name].label} [{INTEGRALS[name].unit}]")
        axes.set_yticks(places, labels if panel == 0 else [""] * len(records))
        axes.grid(True, axis="x", color="0.93")
        axes.set_axisbelow(True)
    write_beside(file, partial(figure.savefig, format="png", dpi=DPI))
