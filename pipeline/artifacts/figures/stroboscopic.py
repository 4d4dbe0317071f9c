"""The arm at even moments of its motion, in the plane or in space."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from matplotlib.cm import ScalarMappable
from matplotlib.colors import LinearSegmentedColormap, Normalize, to_hex
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.ticker import MaxNLocator

from pipeline.artifacts.figures import solids
from pipeline.artifacts.figures.panels import EVENT, INK, PALE, PATH, new_figure, shape_of, thin, tidy
from pipeline.artifacts.scene import around, carried, limbs, outlines
from pipeline.evaluation.evaluation import Evaluation
from pipeline.model.arm import Arm
from pipeline.model.task import AXES
from pipeline.problem.problem import Problem
from pipeline.robot.shapes import Shape
from pipeline.studies import style

POSES = 18  # of one stroboscopic view
TOOLS = 4  # poses in which what the end effector carries is drawn


TIME_RAMP = LinearSegmentedColormap.from_list("time", ["#CBDCEE", "#6A9BCB", "#12304F"])


def stroboscopic(problem: Problem, evaluations: Sequence[Evaluation], name: str) -> Figure:
    """The arm in poses equally spaced in time (Figs 4-7 and 9-12, top): in its plane, or in space."""
    points = np.concatenate([e.skeleton.reshape(-1, 3) for e in evaluations])
    arm = problem.task.arm
    edges = [outlines(arm, e.base) for e in evaluations] if arm.base.kind == "floating" else []
    points = np.concatenate([points, *(edge.reshape(-1, 3) for edge in edges)])
    low, high = np.nanmin(points, axis=0), np.nanmax(points, axis=0)
    size = high - low
    planar = size.min() < 1e-6 * size.max()
    dims = np.delete(np.arange(3), np.argmin(size)) if planar else np.arange(3)
    margin = 0.06 * size.max()
    tools = [_tools(arm, e) for e in evaluations]
    points = np.concatenate([points, *(solids.surface(shape) for held in tools for shape in held)])
    low, high = np.nanmin(points, axis=0), np.nanmax(points, axis=0)
    obstacles = around(problem, points)
    for shape in obstacles:
        corners = solids.surface(shape)
        low, high = np.minimum(low, corners.min(axis=0)), np.maximum(high, corners.max(axis=0))
    beside = () if planar else limbs(problem)
    for shape in beside:
        corners = solids.surface(shape)
        low, high = np.minimum(low, corners.min(axis=0)), np.maximum(high, corners.max(axis=0))
    low, high = low[dims] - margin, high[dims] + margin
    rows, columns = shape_of(len(evaluations))
    width = 4.4 if columns < 4 else 3.4
    height = 0.9 + (width - 0.9) * (float((high - low)[1] / (high - low)[0]) if planar else 1.0)
    height = min(height, 2 * width)
    figure = new_figure(f"{name}: stroboscopic view", width * columns + 1.2, height * rows + 0.9)
    clock = Normalize(0.0, problem.reference.duration)
    prescribed = problem.reference.position(np.linspace(0.0, problem.reference.duration, 301))
    panels: list[Any] = []  # plane or 3-D axes
    for i, e in enumerate(evaluations):
        axes: Any = figure.add_subplot(rows, columns, i + 1, projection=None if planar else "3d")
        panels.append(axes)
        for shape in obstacles:
            solids.draw(axes, shape, dims)
        path = problem.task.in_world(prescribed, e.position[0])[:, dims]
        axes.plot(*path.T, color=PATH, linewidth=5, alpha=0.25, solid_capstyle="round")
        event = e.solution.event_time
        for k in np.searchsorted(e.time, np.linspace(e.time[0], e.time[-1], POSES) - 1e-9):
            usable = event is None or e.time[k] <= event
            shade = to_hex(TIME_RAMP(clock(e.time[k]))) if usable else PALE
            axes.plot(*e.skeleton[k][:, dims].T, "o-", color=shade, linewidth=1.7, markersize=2.8, zorder=2 + usable)
            for edge in edges[i : i + 1]:
                axes.plot(*edge[k][:, dims].T, color=shade, linewidth=1.2, zorder=1.5 + usable)
        for shape in beside:
            solids.draw(axes, shape, dims, solids.GROUND)
        for held in tools[i]:
            solids.draw(axes, held, dims, to_hex(TIME_RAMP(0.5)))
        axes.plot(*e.position[thin(e.time)][:, dims].T, color=PATH, linewidth=1.4, zorder=4)
        axes.plot(*e.skeleton[0, :1, dims], "s", color=INK, markersize=8, zorder=5)
        if event is not None:
            here = e.position[int(np.searchsorted(e.time[:-1], event)), dims]
            axes.plot(*here[:, None], "o", color=EVENT, fillstyle="none", markersize=11, markeredgewidth=1.8, zorder=6)
        axes.set_title(style.name(e.label), color=style.color(e.method), fontweight="bold", fontsize=11)
        for axis, dim, start, end in zip("xyz", dims, low, high, strict=False):
            axes.set(**{f"{axis}lim": (start, end), f"{axis}label": f"{AXES[dim]} [m]"})
            getattr(axes, f"{axis}axis").set_major_locator(MaxNLocator(5 if planar else 3, steps=[1, 2, 2.5, 5, 10]))
        if planar:
            axes.set_aspect("equal")
            tidy(axes)
        else:
            axes.set_box_aspect(high - low, zoom=1.1)
            axes.patch.set_visible(False)  # it would cover the label of the panel before
            axes.view_init(elev=22, azim=-55)
    apart = 0.02 if planar else 0.1  # room for the label of a third axis
    bar = figure.colorbar(ScalarMappable(clock, TIME_RAMP), ax=panels, shrink=0.8, aspect=30, pad=apart)
    bar.set_label("Time of the pose [s]")
    entries = [
        Line2D([], [], marker="s", linestyle="", color=INK, markersize=7, label="Joint 1"),
        Line2D([], [], color=PATH, linewidth=5, alpha=0.25, label="Prescribed path"),
        Line2D([], [], color=PATH, linewidth=1.4, label="End effector"),
    ]
    if obstacles:
        entries.append(Line2D([], [], marker="o", linestyle="", color=solids.COLOR, alpha=0.5, label="Obstacle"))
    if any(e.solution.event_time is not None for e in evaluations):
        ring = Line2D([], [], color=EVENT, marker="o", linestyle="", fillstyle="none", markersize=9)
        ring.set_label("Singularity; poses after it in grey")
        entries.append(ring)
    if any(tools):
        entries.append(Line2D([], [], marker="s", linestyle="", color=to_hex(TIME_RAMP(0.5)), alpha=0.5, label="Tool"))
    figure.legend(handles=entries, loc="outside lower center", ncols=2 if columns == 1 else len(entries), frameon=False)
    return figure


def _tools(arm: Arm, e: Evaluation) -> list[Shape]:
    """What the end effector carries, in the world, in poses equally spaced in time."""
    if not arm.description.tool:
        return []
    moments = np.searchsorted(e.time, np.linspace(e.time[0], e.time[-1], TOOLS) - 1e-9)
    return carried(arm, e, np.unique(moments))
