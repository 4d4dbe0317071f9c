"""The figures of one run as PNG files: the content of the PMKE paper's Figs 2-12, for any arm and any set of motions.

Each public function below draws one figure from the evaluations and returns it; `write` puts them all into a folder.
What a singular motion does after its singularity is drawn faint and dotted: it is not to be used.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.cm import ScalarMappable
from matplotlib.colors import LinearSegmentedColormap, Normalize, to_hex
from matplotlib.figure import Figure
from matplotlib.layout_engine import ConstrainedLayoutEngine
from matplotlib.lines import Line2D
from matplotlib.ticker import MaxNLocator
from numpy.typing import NDArray
from scipy.ndimage import median_filter

from pipeline.arrays import Array
from pipeline.artifacts import solids, style
from pipeline.artifacts.spacecraft import outlines
from pipeline.evaluation import Evaluation
from pipeline.files import write_beside
from pipeline.floating import FloatingArm
from pipeline.problem import Problem
from pipeline.task import AXES

DPI = 130
POINTS = 1001  # most points per line: more than a screen shows
POSES = 18  # of one stroboscopic view
COLUMNS = 5  # most panels side by side
INK, PALE, EVENT, PATH = "#1A202C", "#D5D9DF", "#C53030", "#B83280"
TIME_RAMP = LinearSegmentedColormap.from_list("time", ["#CBDCEE", "#6A9BCB", "#12304F"])

Values = Callable[[Evaluation], Array]


def write(folder: Path, problem: Problem, evaluations: Sequence[Evaluation], *, name: str) -> list[Path]:
    """Draw the seven figures of a run into `folder`; returns the files."""
    folder.mkdir(parents=True, exist_ok=True)
    files = []
    for draw in (reference, energy, stroboscopic, joints, torques, spectral_radius, tracking):
        file = folder / f"{draw.__name__}.png"
        figure = draw(problem, evaluations, name)
        write_beside(file, partial(figure.savefig, format="png", dpi=DPI))
        files.append(file)
    return files


def reference(problem: Problem, evaluations: Sequence[Evaluation], name: str) -> Figure:
    """The curvilinear abscissa and its derivatives (Fig. 2)."""
    t = np.linspace(0.0, problem.reference.duration, 501)
    curves = problem.reference.timing.sample(t, problem.reference.geometry.length)
    figure = _figure(f"{name}: reference along the path", 7.0, 6.0)
    labels = ("Abscissa $s$ [m]", r"Speed $\dot s$ [m/s]", r"Acceleration $\ddot s$ [m/s$^2$]")
    for axes, values, label in zip(_stack(figure, problem, 3), curves, labels, strict=True):
        axes.plot(t, values, color=style.joint_color(0), linewidth=1.8)
        axes.set_ylabel(label)
    return figure


def energy(problem: Problem, evaluations: Sequence[Evaluation], name: str) -> Figure:
    """The running integral of the kinetic energy (Fig. 3) and the energy itself."""
    figure = _figure(f"{name}: kinetic energy", 10.0, 6.0)
    integral, rate = _stack(figure, problem, 2)
    integral.set_ylabel(r"Integral $\int T\,dt$ [J s]")
    rate.set_ylabel("Kinetic energy $T$ [J]")
    for i, e in enumerate(evaluations):
        event = e.solution.event_time
        legend = f"{style.name(e.label)}\n{e.energy_integral[-1]:.4g} J s"
        legend += "" if event is None else f"\n(singular at {event:.2f} s)"
        _draw(integral, e, e.energy_integral, style.color(e.label), legend, i)
        _draw(rate, e, e.kinetic_energy, style.color(e.label), order=i)
    _limit(rate, evaluations, lambda e: e.kinetic_energy)
    for e in evaluations:
        _note(rate, e, e.kinetic_energy, "J")
    _legend(figure, integral)
    return figure


def stroboscopic(problem: Problem, evaluations: Sequence[Evaluation], name: str) -> Figure:
    """The arm in poses equally spaced in time (Figs 4-7 and 9-12, top): in its plane, or in space."""
    points = np.concatenate([e.skeleton.reshape(-1, 3) for e in evaluations])
    arm = problem.task.arm
    edges = [outlines(arm, e.base) for e in evaluations] if isinstance(arm, FloatingArm) and arm.floats else []
    points = np.concatenate([points, *(edge.reshape(-1, 3) for edge in edges)])
    low, high = np.nanmin(points, axis=0), np.nanmax(points, axis=0)
    size = high - low
    planar = size.min() < 1e-6 * size.max()
    dims = np.delete(np.arange(3), np.argmin(size)) if planar else np.arange(3)
    margin = 0.06 * size.max()
    obstacles = problem.obstacles.shapes if problem.obstacles is not None else ()
    for shape in obstacles:
        corners = solids.surface(shape)
        low, high = np.minimum(low, corners.min(axis=0)), np.maximum(high, corners.max(axis=0))
    low, high = low[dims] - margin, high[dims] + margin
    rows, columns = _shape(len(evaluations))
    width = 4.4 if columns < 4 else 3.4
    height = 0.9 + (width - 0.9) * (float((high - low)[1] / (high - low)[0]) if planar else 1.0)
    height = min(height, 2 * width)
    figure = _figure(f"{name}: stroboscopic view", width * columns + 1.2, height * rows + 0.9)
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
        axes.plot(*e.position[_thin(e.time)][:, dims].T, color=PATH, linewidth=1.4, zorder=4)
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
            _tidy(axes)
        else:
            axes.set_box_aspect(high - low, zoom=0.88)
            axes.view_init(elev=22, azim=-55)
    bar = figure.colorbar(ScalarMappable(clock, TIME_RAMP), ax=panels, shrink=0.8, aspect=30, pad=0.02)
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
    figure.legend(handles=entries, loc="outside lower center", ncols=2 if columns == 1 else len(entries), frameon=False)
    return figure


def joints(problem: Problem, evaluations: Sequence[Evaluation], name: str) -> Figure:
    """Joint positions with their limits, and velocities (PMKE paper Figs 4-7, 9-12, below; Pontryagin report Figs 3-7 a)."""
    position, velocity = _unit(problem, "rad", "m"), _unit(problem, "rad/s", "m/s")
    return _by_joint(
        f"{name}: joint positions and velocities",
        evaluations,
        (f"Position $q$ [{position}]", position, lambda e: e.q),
        (rf"Velocity $\dot q$ [{velocity}]", velocity, lambda e: e.qd),
        bounds=_ranges(problem),
    )


def torques(problem: Problem, evaluations: Sequence[Evaluation], name: str) -> Figure:
    """Joint torques and powers."""
    unit = _unit(problem, "N m", "N")
    return _by_joint(
        f"{name}: joint torques and powers",
        evaluations,
        (rf"Torque $\tau$ [{unit}]", unit, lambda e: e.tau),
        (r"Power $|\tau\,\dot q|$ [W]", "W", lambda e: e.power),
    )


def spectral_radius(problem: Problem, evaluations: Sequence[Evaluation], name: str) -> Figure:
    """The largest eigenvalue of the inertia matrix (Fig. 8), each motion's least value marked."""
    figure = _figure(f"{name}: spectral radius of the inertia matrix", 10.0, 4.8)
    (axes,) = _stack(figure, problem, 1)
    unit = "kg m$^2$" if problem.task.arm.description.turning.all() else "SI units"
    axes.set_ylabel(rf"Spectral radius $\rho(M)$ [{unit}]")
    lowest = []
    for i, e in enumerate(evaluations):
        k = int(np.nanargmin(e.spectral_radius[: _usable(e, e.time)]))
        lowest.append((e.time[k], e.spectral_radius[k], e))
        _draw(axes, e, e.spectral_radius, style.color(e.label), style.name(e.label), i)
    # The values stand in one row below the curves, near their moments but apart from one another.
    lowest.sort(key=lambda entry: entry[0])
    gap = min(0.13, 1 / len(lowest))
    place = -gap / 2
    for after, (t, value, e) in zip(reversed(range(len(lowest))), lowest, strict=True):
        place = min(max(t / problem.reference.duration, place + gap), 1 - gap * (after + 0.5))
        axes.plot([t], [value], "o", color=style.color(e.label), markersize=7, markeredgecolor="white", clip_on=False)
        axes.annotate(
            f"min {value:.4g}\nat {t:.2f} s",
            xy=(t, value),
            xytext=(place, 0.03),
            textcoords="axes fraction",
            ha="center",
            va="bottom",
            fontsize=9,
            color=style.color(e.method),
            arrowprops={"arrowstyle": "-", "color": style.color(e.label), "linewidth": 0.8},
        )
    bottom, top = axes.get_ylim()
    axes.set_yticks([tick for tick in axes.get_yticks() if bottom <= tick <= top])
    axes.set_ylim(bottom - 0.3 * (top - bottom), top)
    _legend(figure, axes)
    return figure


def tracking(problem: Problem, evaluations: Sequence[Evaluation], name: str) -> Figure:
    """How far the end effector is off its path, and how far the arm is from a singular configuration."""
    figure = _figure(f"{name}: tracking and distance from singularity", 10.0, 6.0)
    error, singular = _stack(figure, problem, 2)
    error.set_yscale("log", nonpositive="mask")
    error.set_ylabel("Tracking error [m]")
    singular.set_ylabel(rf"Least singular value of $J$ [{_unit(problem, 'm/rad', '1')}]")
    for i, e in enumerate(evaluations):
        legend = f"{style.name(e.label)}\nlargest error {e.tracking_error.max():.1e} m"
        _draw(error, e, e.tracking_error, style.color(e.label), legend, i)
        _draw(singular, e, e.singular_value, style.color(e.label), order=i)
    singular.set_ylim(bottom=0.0)
    _legend(figure, error)
    return figure


def _ranges(problem: Problem) -> Array:
    """The joint limits (2, n) that the motion must keep, or is to stay in the middle of; infinite without any."""
    bounds, secondary = problem.bounds, problem.objective.secondary
    if secondary is not None and "joint_centering" in secondary.criteria:
        return np.array([secondary.lower, secondary.upper])
    return np.array([bounds.lower, bounds.upper])[:, problem.task.arm.base_coordinates :]


def _by_joint(
    title: str, evaluations: Sequence[Evaluation], *kinds: tuple[str, str, Values], bounds: Array | None = None
) -> Figure:
    """A column per motion, a row per kind (label, unit, values); many motions are broken into blocks of such rows.

    bounds (2, n) are drawn, broken lines in the joints' colours, into the row of the first kind.
    """
    blocks, columns = _shape(len(evaluations))
    rows = blocks * len(kinds)
    figure = _figure(title, 1.0 + columns * (4.4 if columns < 4 else 3.4), 1.2 + rows * 2.6)
    first: dict[str, Axes] = {}
    for i, e in enumerate(evaluations):
        block, column = divmod(i, columns)
        for row, (label, unit, values) in enumerate(kinds):
            place = (block * len(kinds) + row) * columns + column + 1
            axes = figure.add_subplot(rows, columns, place, sharey=first.get(label))
            if label not in first:
                first[label] = axes
                _limit(axes, evaluations, values)
            for joint, line in enumerate(values(e).T):
                _draw(axes, e, line, style.joint_color(joint), f"Joint {joint + 1}")
                for bound in () if bounds is None or row else bounds[:, joint]:
                    if np.isfinite(bound):
                        axes.axhline(bound, color=style.joint_color(joint), linestyle=(0, (2, 3)), linewidth=1.0)
                        low, high = axes.get_ylim()
                        axes.set_ylim(min(low, 1.05 * bound), max(high, 1.05 * bound))
            axes.set_xlim(e.time[0], e.time[-1])
            if row == 0:
                axes.set_title(style.name(e.label), color=style.color(e.method), fontweight="bold", fontsize=11)
            if row == len(kinds) - 1:
                axes.set_xlabel("Time [s]")
            if column == 0:
                axes.set_ylabel(label)
            axes.tick_params(labelleft=column == 0, labelbottom=row == len(kinds) - 1)
            _tidy(axes)
            _note(axes, e, values(e), unit)
    figure.align_ylabels()
    handles, labels = figure.axes[0].get_legend_handles_labels()
    figure.legend(handles, labels, loc="outside lower center", ncols=min(len(labels), 4 * columns), frameon=False)
    return figure


def _draw(axes: Axes, e: Evaluation, values: Array, shade: str, label: str | None = None, order: int = 0) -> None:
    """One line over time (N + 1,); what comes after a singularity thin and dotted.

    Lines of odd `order` are dashed and on top, so that two motions that coincide both stay visible.
    """
    keep = _thin(e.time)
    time, values, usable = e.time[keep], values[keep], _usable(e, e.time[keep])
    dashes, above = ((0, (4, 2.5)), 2.1) if order % 2 else ("-", 2.0)
    axes.plot(time[:usable], values[:usable], color=shade, linewidth=1.8, linestyle=dashes, zorder=above, label=label)
    if usable < len(time):
        axes.plot(time[usable - 1 :], values[usable - 1 :], color=shade, linewidth=1.1, linestyle=":", alpha=0.8)


def _limit(axes: Axes, evaluations: Sequence[Evaluation], values: Values) -> None:
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


def _note(axes: Axes, e: Evaluation, values: Array, unit: str) -> None:
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


def _figure(title: str, width: float, height: float) -> Figure:
    figure = Figure(figsize=(width, height), layout=ConstrainedLayoutEngine(w_pad=0.08, h_pad=0.08))
    FigureCanvasAgg(figure)
    figure.suptitle(title, fontsize=min(13.0, 115 * width / len(title)), fontweight="bold", color=INK)
    return figure


def _stack(figure: Figure, problem: Problem, rows: int) -> list[Axes]:
    """Panels one above the other over the same time."""
    panels = list(figure.subplots(rows, 1, sharex=True, squeeze=False)[:, 0])
    for axes in panels:
        _tidy(axes)
    panels[-1].set_xlabel("Time [s]")
    panels[-1].set_xlim(0.0, problem.reference.duration)
    return panels


def _tidy(axes: Axes) -> None:
    axes.grid(color="#E2E8F0", linewidth=0.7)
    axes.set_axisbelow(True)
    axes.spines[["top", "right"]].set_visible(False)


def _legend(figure: Figure, axes: Axes) -> None:
    """Beside the panels: there it hides no line, however many there are."""
    figure.align_ylabels()
    figure.legend(*axes.get_legend_handles_labels(), loc="outside right center", frameon=False, labelspacing=0.9)


def _shape(count: int) -> tuple[int, int]:
    """Rows and columns of `count` panels, evenly filled."""
    rows = math.ceil(count / COLUMNS)
    return rows, math.ceil(count / rows)


def _thin(time: Array) -> NDArray[np.intp]:
    """Indices of at most POINTS knots, the first and the last among them."""
    return np.linspace(0, len(time) - 1, min(len(time), POINTS)).round().astype(np.intp)


def _usable(e: Evaluation, time: Array) -> int:
    """How many of the moments `time` lie before the singularity that `e` met, if it met one."""
    event = e.solution.event_time
    return len(time) if event is None else max(1, int(np.searchsorted(time, event, side="right")))


def _unit(problem: Problem, turning: str, sliding: str) -> str:
    revolute = problem.task.arm.description.turning
    return turning if revolute.all() else f"{turning} or {sliding}" if revolute.any() else sliding
