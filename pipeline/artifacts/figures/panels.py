"""Panels, lines and notes that all figures over time share."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from matplotlib.layout_engine import ConstrainedLayoutEngine
from matplotlib.lines import Line2D
from numpy.typing import NDArray
from scipy.ndimage import median_filter

from pipeline.common.arrays import Array
from pipeline.evaluation.evaluation import Evaluation
from pipeline.problem.problem import Problem
from pipeline.studies import style

POINTS = 1001  # most points per line: more than a screen shows
COLUMNS = 5  # most panels side by side
FAR = 2.5  # times the largest value: limits beyond are told and not drawn
LETTERS, LINE = 13, 9  # of a legend: in an inch, and as wide as the line before a name
LIMITED, BROKEN = "limited", (0, (2, 3))
INK, PALE, EVENT, PATH = "#1A202C", "#D5D9DF", "#C53030", "#B83280"


Values = Callable[[Evaluation], Array]


def by_joint(
    title: str,
    joints: Sequence[str],
    evaluations: Sequence[Evaluation],
    *kinds: tuple[str, str, Values, Array | None],
) -> Figure:
    """A column per motion, a row per kind (label, unit, values, bounds); many motions are broken into blocks of rows.

    bounds (2, n) of the joints, if any: broken lines in the joints' colours; those far outside are told instead.
    """
    blocks, columns = shape_of(len(evaluations))
    rows = blocks * len(kinds)
    figure = new_figure(title, 1.0 + columns * (4.4 if columns < 4 else 3.4), 1.2 + rows * 2.6)
    first: dict[str, Axes] = {}
    noted: list[tuple[Axes, Evaluation, Array, str]] = []
    for i, e in enumerate(evaluations):
        block, column = divmod(i, columns)
        for row, (label, unit, values, bounds) in enumerate(kinds):
            place = (block * len(kinds) + row) * columns + column + 1
            axes = figure.add_subplot(rows, columns, place, sharey=first.get(label))
            if label not in first:
                first[label] = axes
                limit_line(axes, evaluations, values)
            for joint, line in enumerate(values(e).T):
                draw_lines(axes, e, line, style.joint_color(joint), joints[joint])
            limits(axes, bounds)
            axes.set_xlim(e.time[0], e.time[-1])
            if row == 0:
                axes.set_title(style.name(e.label), color=style.color(e.method), fontweight="bold", fontsize=11)
            if row == len(kinds) - 1:
                axes.set_xlabel("Time [s]")
            if column == 0:
                axes.set_ylabel(label)
            axes.tick_params(labelleft=column == 0, labelbottom=row == len(kinds) - 1)
            tidy(axes)
            noted.append((axes, e, values(e), unit))
    for axes, e, shown, unit in noted:  # when every panel has its range: rows share it
        annotate(axes, e, shown, unit)
    figure.align_ylabels()
    handles, labels = figure.axes[0].get_legend_handles_labels()
    if any(axes.get_gid() == LIMITED for axes in figure.axes):
        handles, labels = [*handles, Line2D([], [], color=INK, linestyle=BROKEN, linewidth=1.0)], [*labels, "Limits"]
    letters = max(len(label) for label in labels) + LINE
    across = max(1, int(LETTERS * figure.get_figwidth() / letters))
    figure.legend(handles, labels, loc="outside lower center", ncols=min(len(labels), across), frameon=False)
    return figure


def limits(axes: Axes, bounds: Array | None) -> None:
    """Bounds (2, n) as broken lines; one that would press the motions flat is told in the corner instead."""
    if bounds is None or not np.isfinite(bounds).any():
        return
    low, high = axes.get_ylim()
    reach = FAR * max(abs(low), abs(high))
    for joint, pair in enumerate(bounds.T):
        for bound in pair[np.abs(pair) <= reach]:
            axes.axhline(bound, color=style.joint_color(joint), linestyle=BROKEN, linewidth=1.0)
            axes.set_gid(LIMITED)
            low, high = min(low, bound), max(high, bound)
    margin = 0.03 * (high - low)
    axes.set_ylim(min(axes.get_ylim()[0], low - margin), max(axes.get_ylim()[1], high + margin))
    outside = np.abs(bounds[np.isfinite(bounds) & (np.abs(bounds) > reach)])
    if outside.size:
        said = f"limits from {outside.min():.4g} on, outside"
        axes.text(0.98, 0.02, said, transform=axes.transAxes, ha="right", va="bottom", fontsize=8, color="#5A6472")


def draw_lines(
    axes: Axes, e: Evaluation, values: Array, shade: str, label: str | None = None, dashes: Any = "-"
) -> None:
    """One line over time (N + 1,); what comes after a singularity thin and dotted.

    dashes: of its method (`style.dashes`), so that two motions that coincide both stay visible; broken lines on top.
    """
    keep = thin(e.time)
    time, values, until = e.time[keep], values[keep], usable(e, e.time[keep])
    above = 2.0 if dashes == "-" else 2.1
    axes.plot(time[:until], values[:until], color=shade, linewidth=1.8, linestyle=dashes, zorder=above, label=label)
    if until < len(time):
        axes.plot(time[until - 1 :], values[until - 1 :], color=shade, linewidth=1.1, linestyle=":", alpha=0.8)


def limit_line(axes: Axes, evaluations: Sequence[Evaluation], values: Values) -> None:
    """Show every motion but for spikes that would flatten the rest: at a singularity, or at one knot (a jump)."""
    shown = []
    for e in evaluations:
        smooth = median_filter(values(e), size=5, axes=0, mode="nearest")
        smooth = smooth[np.isfinite(smooth)]
        shown.append(smooth if e.solution.event_time is None else np.percentile(smooth, [5, 95]))
    low, high = np.min(np.concatenate(shown)), np.max(np.concatenate(shown))
    margin = 0.07 * (high - low) or 1.0
    headroom = 4 if any(e.solution.event_time is not None for e in evaluations) else 1  # for the note
    axes.set_ylim(low - margin, high + headroom * margin)


def annotate(axes: Axes, e: Evaluation, values: Array, unit: str) -> None:
    """Say where the motion met a singularity and how far its values leave the panel."""
    event, lines = e.solution.event_time, []
    if event is not None:
        axes.axvline(event, color=EVENT, linewidth=1.0, linestyle="--")
        lines.append(f"singular at {event:.2f} s")
    low, high = axes.get_ylim()
    size = np.abs(values).reshape(len(e.time), -1).max(axis=1)
    if np.nanmax(values) > high or np.nanmin(values) < low:
        lines.append(f"peak of {np.nanmax(size):.3g} {unit} cut off")
    moment = event if event is not None else float(e.time[np.nanargmax(size)])
    late = moment > (e.time[0] + e.time[-1]) / 2
    axes.annotate(
        "\n".join(lines),
        xy=(moment, 0.98),
        xycoords=("data", "axes fraction"),
        xytext=(-16 if late else 8, 0),
        textcoords="offset points",
        ha="right" if late else "left",
        va="top",
        fontsize=8.5,
        color=EVENT,
    )


def new_figure(title: str, width: float, height: float) -> Figure:
    figure = Figure(figsize=(width, height), layout=ConstrainedLayoutEngine(w_pad=0.08, h_pad=0.08))
    FigureCanvasAgg(figure)
    figure.suptitle(title, fontsize=min(13.0, 115 * width / len(title)), fontweight="bold", color=INK)
    return figure


def stacked_panels(figure: Figure, problem: Problem, rows: int) -> list[Axes]:
    """Panels one above the other over the same time."""
    panels = list(figure.subplots(rows, 1, sharex=True, squeeze=False)[:, 0])
    for axes in panels:
        tidy(axes)
    panels[-1].set_xlabel("Time [s]")
    panels[-1].set_xlim(0.0, problem.reference.duration)
    return panels


def tidy(axes: Axes) -> None:
    axes.grid(color="#E2E8F0", linewidth=0.7)
    axes.set_axisbelow(True)
    axes.spines[["top", "right"]].set_visible(False)


def add_legend(figure: Figure, axes: Axes) -> None:
    """Beside the panels: there it hides no line, however many there are."""
    figure.align_ylabels()
    figure.legend(*axes.get_legend_handles_labels(), loc="outside right center", frameon=False, labelspacing=0.9)


def shape_of(count: int) -> tuple[int, int]:
    """Rows and columns of `count` panels, evenly filled."""
    rows = math.ceil(count / COLUMNS)
    return rows, math.ceil(count / rows)


def thin(time: Array) -> NDArray[np.intp]:
    """Indices of at most POINTS knots, the first and the last among them."""
    return np.linspace(0, len(time) - 1, min(len(time), POINTS)).round().astype(np.intp)


def usable(e: Evaluation, time: Array) -> int:
    """How many of the moments `time` lie before the singularity that `e` met, if it met one."""
    event = e.solution.event_time
    return len(time) if event is None else max(1, int(np.searchsorted(time, event, side="right")))


def unit_of(problem: Problem, turning: str, sliding: str) -> str:
    revolute = problem.task.arm.description.turning
    return turning if revolute.all() else f"{turning} or {sliding}" if revolute.any() else sliding
