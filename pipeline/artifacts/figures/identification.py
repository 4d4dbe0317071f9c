"""What the printed and the identified masses give for every printed number: residuals in units of its rounding."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pandas as pd
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure

from pipeline.artifacts import style
from pipeline.common.files import write_beside
from pipeline.studies.identification import Identification


def draw(found: Identification, name: str) -> Figure:
    """One line per number, on a logarithmic scale on both sides of zero."""
    numbers = found.numbers.iloc[::-1]
    place = np.arange(len(numbers))
    figure = Figure(figsize=(9.0, 0.27 * len(numbers) + 1.8), layout="constrained")
    FigureCanvasAgg(figure)
    axes = figure.add_subplot()
    axes.axvspan(-1, 1, color="#E2E8F0", zorder=0, label="rounding of the printed digits")
    for column, method, label, marker in (
        ("residual_printed", "lsv", "printed masses", "x"),
        ("residual_identified", "global", "identified masses", "o"),
    ):
        axes.plot(numbers[column], place, marker, color=style.color(method), markersize=5, label=label)
    axes.set_xscale("symlog", linthresh=2.0)
    axes.set_yticks(place, _labels(numbers), fontsize=7.5)
    axes.set_ylim(-0.8, len(numbers) - 0.2)
    axes.set_xlabel("Recomputed minus printed, in half units of the last printed digit")
    masses = "  ".join(
        f"$m_{row['link']}$ = {row['identified']:.4f} ± {(row['high'] - row['low']) / 2:.4f}"
        for row in found.masses.to_dict("records")
    )
    figure.suptitle(f"{name}: {masses} kg", fontsize=11)
    axes.grid(True, axis="x", color="0.93")
    axes.spines[["top", "right"]].set_visible(False)
    figure.legend(loc="outside lower center", ncols=3, frameon=False)
    return figure


def _labels(numbers: pd.DataFrame) -> list[str]:
    used = np.where(numbers["used"] == "fit", "", " (not fitted)")
    return [
        f"{row['document']}, {row['place']}: {row['quantity']}{mark}"
        for row, mark in zip(numbers.to_dict("records"), used, strict=True)
    ]


def write(folder: Path, found: Identification, *, name: str) -> Path:
    """Draw it into `folder`/identification.png."""
    file = folder / "identification.png"
    figure = draw(found, name)
    write_beside(file, lambda part: figure.savefig(part, format="png", dpi=130))
    return file
