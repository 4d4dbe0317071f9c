"""animation.gif or animation.mp4: all shown motions of a run in one picture that moves, for slides."""

from __future__ import annotations

import shutil
from functools import partial
from importlib import import_module
from pathlib import Path
from typing import Any

import matplotlib as mpl
import numpy as np
from matplotlib.animation import FFMpegWriter, FuncAnimation, PillowWriter

from pipeline.artifacts.figures import solids
from pipeline.artifacts.figures.panels import INK, PATH, new_figure
from pipeline.artifacts.report import Report
from pipeline.artifacts.scene import around, outlines, path_in_world
from pipeline.common.arrays import Array
from pipeline.common.files import write_beside
from pipeline.evaluation.evaluation import Evaluation
from pipeline.model.task import AXES
from pipeline.studies import style

PER_SECOND, LONGEST = 15, 5.0  # [s] of the film: longer motions are shown faster
DPI = 90
WRITERS: dict[str, Any] = {"gif": PillowWriter, "mp4": FFMpegWriter}


def write(report: Report, folder: Path) -> None:
    """In `folder`, where the configuration asks for one and there is a motion to show."""
    kind = report.motions.config.artifacts.animation
    shown = [e for e in report.shown if e.solution.found and np.isfinite(e.skeleton).all()]
    if kind is None or not shown:
        return
    film = draw(report, shown)
    with mpl.rc_context({"animation.ffmpeg_path": ffmpeg() or "ffmpeg"}):
        write_beside(folder / f"animation.{kind}", partial(film.save, writer=WRITERS[kind](fps=PER_SECOND), dpi=DPI))


def ffmpeg() -> str | None:
    """The program: that of the system, or the one that the package imageio-ffmpeg brings; None without either."""
    if (found := shutil.which("ffmpeg")) is not None:
        return found
    try:
        return str(import_module("imageio_ffmpeg").get_ffmpeg_exe())
    except (ImportError, RuntimeError):
        return None


def draw(report: Report, motions: list[Evaluation]) -> FuncAnimation:
    """The film, no frame of it drawn yet."""
    problem = report.motions.problem
    arm, path = problem.task.arm, path_in_world(problem)
    points = np.concatenate([path, *(e.skeleton.reshape(-1, 3) for e in motions)])
    edges = [outlines(arm, e.base) if arm.base.kind == "floating" else None for e in motions]
    points = np.concatenate([points, *(edge.reshape(-1, 3) for edge in edges if edge is not None)])
    size = np.ptp(points, axis=0)
    flat = size.min() < 1e-6 * size.max()
    dims = np.delete(np.arange(3), np.argmin(size)) if flat else np.arange(3)
    figure = new_figure(report.motions.config.name, 7.0, 6.0)
    axes: Any = figure.add_subplot(projection=None if flat else "3d")
    margin = 0.06 * size.max()
    low, high = points.min(axis=0)[dims] - margin, points.max(axis=0)[dims] + margin
    for axis, dim, start, end in zip("xyz", dims, low, high, strict=False):
        axes.set(**{f"{axis}lim": (start, end), f"{axis}label": f"{AXES[dim]} [m]"})
    if flat:
        axes.set_aspect("equal")
    else:
        axes.set_box_aspect(high - low)
    for shape in around(problem, points):
        solids.draw(axes, shape, dims)
    axes.plot(*path[:, dims].T, color=PATH, linewidth=5, alpha=0.25)
    lines = [
        axes.plot([], [], *([[]] * (len(dims) - 2)), "o-", color=style.color(e.label), label=style.name(e.label))[0]
        for e in motions
    ]
    boxes = [axes.plot([], [], *([[]] * (len(dims) - 2)), color=style.color(e.label))[0] for e in motions]
    figure.legend(handles=lines, loc="outside lower center", ncols=4, frameon=False)
    last = max(float(e.time[-1]) for e in motions)
    clock = axes.set_title("", color=INK)

    def show(time: float) -> None:
        clock.set_text(f"{time:.2f} s")
        for e, line, box, edge in zip(motions, lines, boxes, edges, strict=True):
            k = int(np.searchsorted(e.time, min(time, e.time[-1]) - 1e-9))
            _place(line, e.skeleton[k][:, dims])
            if edge is not None:
                _place(box, edge[k][:, dims])

    count = max(2, round(PER_SECOND * min(max(last, 1.0), LONGEST)))
    figure.draw_without_rendering()
    figure.set_layout_engine("none")  # what is laid out once stays there: every frame would be laid out again
    return FuncAnimation(figure, show, frames=np.linspace(0.0, last, count))


def _place(line: Any, points: Array) -> None:
    line.set_data(*points[:, :2].T)
    if points.shape[1] == 3:
        line.set_3d_properties(points[:, 2])
