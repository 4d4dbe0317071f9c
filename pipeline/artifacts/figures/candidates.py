"""The Global paper's Fig. 1: distance of the best candidate from the optimum against the number of candidates."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure

from pipeline.artifacts import style
from pipeline.common.files import write_beside
from pipeline.studies.candidates import Study

PRINTED = (-4.0733, -0.2030)  # eq. (16): logarithm of the factor, exponent


def draw(study: Study, name: str) -> Figure:
    """The mean curve, its fitted power law and the printed one, on logarithmic axes."""
    figure = Figure(figsize=(7.0, 4.6), layout="constrained")
    FigureCanvasAgg(figure)
    axes = figure.add_subplot()
    axes.loglog(study.count, study.distance, ".-", color=style.color("global"), label="mean over populations")
    tail = study.count[study.count >= study.parameters].astype(float)
    for (intercept, exponent), label, line in (
        ((study.intercept, study.exponent), "fit", "k-"),
        (PRINTED, "printed, eq. (16)", "k:"),
    ):
        law = np.exp(intercept) * tail**exponent
        axes.loglog(tail, law, line, label=f"{label}: $e^{{{intercept:.3f}}} N^{{{exponent:.3f}}}$")
    axes.axvline(study.parameters, color="0.7", linewidth=1.0)
    axes.annotate(f" {study.parameters} parameters", (study.parameters, study.distance.min()), color="0.4")
    axes.set(xlabel="Number of candidates $N$", ylabel="Best candidate above the optimum [J s]", title=name)
    axes.grid(True, which="both", color="0.93")
    axes.legend()
    return figure


def write(folder: Path, study: Study, *, name: str) -> Path:
    """Draw it into `folder`/candidate_study.png."""
    file = folder / "candidate_study.png"
    figure = draw(study, name)
    write_beside(file, lambda part: figure.savefig(part, format="png", dpi=130))
    return file
