"""The figures of a run as PNG files: those of its motions, and those that its studies draw."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from functools import partial
from pathlib import Path

from matplotlib.figure import Figure

from pipeline.artifacts.figures.base import base
from pipeline.artifacts.figures.motions import (
    accelerations,
    clearance,
    energy,
    joints,
    reference,
    spectral_radius,
    torques,
    tracking,
)
from pipeline.artifacts.figures.stroboscopic import stroboscopic
from pipeline.artifacts.report import Report
from pipeline.common.files import write_beside
from pipeline.evaluation.evaluation import Evaluation
from pipeline.problem.problem import Problem

DPI = 130
Draw = Callable[[Problem, Sequence[Evaluation], str], Figure | None]  # None: nothing to show
FIGURES: dict[str, Draw] = {
    "reference": reference,
    "energy": energy,
    "stroboscopic": stroboscopic,
    "joints": joints,
    "accelerations": accelerations,
    "torques": torques,
    "spectral_radius": spectral_radius,
    "tracking": tracking,
    "clearance": clearance,
    "base": base,
}


def write(report: Report, folder: Path) -> None:
    """All figures of the run, each drawn, saved and forgotten: `folder`/figures/*.png."""
    for name, figure in draw(report):
        save(figure, folder / "figures" / f"{name}.png")


def draw(report: Report) -> Iterator[tuple[str, Figure]]:
    """Each figure by the name of its file."""
    motions, title = report.motions, report.motions.config.name
    for name, of_motions in FIGURES.items():
        if (figure := of_motions(motions.problem, report.shown, title)) is not None:
            yield name, figure
    for result in report.results:
        yield from result.figures(title).items()


def save(figure: Figure, file: Path) -> None:
    """One figure as PNG."""
    layout = figure.get_layout_engine()
    if layout is not None:  # by itself matplotlib would draw everything once more for it
        layout.execute(figure)
        figure.set_layout_engine("none")
    write_beside(file, partial(figure.savefig, format="png", dpi=DPI))
