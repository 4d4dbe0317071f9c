"""The figures of the motions over time: the content of the PMKE paper's Figs 2-12, for any arm and any set of motions.

What a singular motion does after its singularity is drawn faint and dotted: it is not to be used.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from matplotlib.figure import Figure

from pipeline.artifacts.bands import bands
from pipeline.artifacts.figures.panels import (
    BROKEN,
    EVENT,
    add_legend,
    annotate,
    by_joint,
    draw_lines,
    limit_line,
    new_figure,
    stacked_panels,
    unit_of,
    usable,
)
from pipeline.common.arrays import Array
from pipeline.evaluation.evaluation import Evaluation
from pipeline.problem.problem import Problem
from pipeline.studies import style

FLOOR = 1e-12  # [m] what is nearer to the path than that is rounding


def reference(problem: Problem, evaluations: Sequence[Evaluation], name: str) -> Figure:
    """The curvilinear abscissa and its derivatives (Fig. 2)."""
    t = np.linspace(0.0, problem.reference.duration, 501)
    curves = problem.reference.timing.sample(t, problem.reference.geometry.length)
    figure = new_figure(f"{name}: reference along the path", 7.0, 6.0)
    labels = ("Abscissa $s$ [m]", r"Speed $\dot s$ [m/s]", r"Acceleration $\ddot s$ [m/s$^2$]")
    for axes, values, label in zip(stacked_panels(figure, problem, 3), curves, labels, strict=True):
        axes.plot(t, values, color=style.joint_color(0), linewidth=1.8)
        axes.set_ylabel(label)
    return figure


def energy(problem: Problem, evaluations: Sequence[Evaluation], name: str) -> Figure:
    """The running integral of the kinetic energy (Fig. 3) and the energy itself."""
    figure = new_figure(f"{name}: kinetic energy", 10.0, 6.0)
    integral, rate = stacked_panels(figure, problem, 2)
    integral.set_ylabel(r"Integral $\int T\,dt$ [J s]")
    rate.set_ylabel("Kinetic energy $T$ [J]")
    for e in evaluations:
        event = e.solution.event_time
        legend = f"{style.name(e.label)}\n{e.energy_integral[-1]:.4g} J s"
        legend += "" if event is None else f"\n(singular at {event:.2f} s)"
        draw_lines(integral, e, e.energy_integral, style.color(e.label), legend, style.dashes(e.label))
        draw_lines(rate, e, e.kinetic_energy, style.color(e.label), dashes=style.dashes(e.label))
    limit_line(rate, evaluations, lambda e: e.kinetic_energy)
    for e in evaluations:
        annotate(rate, e, e.kinetic_energy, "J")
    add_legend(figure, integral)
    return figure


def joints(problem: Problem, evaluations: Sequence[Evaluation], name: str) -> Figure:
    """Joint positions with their limits, and velocities (PMKE paper Figs 4-7, 9-12; Pontryagin report Figs 3-7 a)."""
    position, velocity = unit_of(problem, "rad", "m"), unit_of(problem, "rad/s", "m/s")
    return by_joint(
        f"{name}: joint positions and velocities",
        problem.task.arm.description.actuated,
        evaluations,
        (f"Position $q$ [{position}]", position, lambda e: e.q, _ranges(problem)),
        (rf"Velocity $\dot q$ [{velocity}]", velocity, lambda e: e.qd, _bounds(problem, "velocity")),
    )


def accelerations(problem: Problem, evaluations: Sequence[Evaluation], name: str) -> Figure | None:
    """Joint accelerations with their limits, and jerks; nothing where no limit is on either."""
    if not problem.bounds.smooth:
        return None
    acceleration, jerk = unit_of(problem, "rad/s$^2$", "m/s$^2$"), unit_of(problem, "rad/s$^3$", "m/s$^3$")
    own = np.broadcast_to(problem.bounds.jerk, problem.task.arm.n)[problem.task.arm.joints]

    def rate(e: Evaluation) -> Array:
        change = np.diff(e.qdd, axis=0) / np.diff(e.time)[:, None]
        return np.vstack([change[:1], change])

    return by_joint(
        f"{name}: joint accelerations and jerks",
        problem.task.arm.description.actuated,
        evaluations,
        (rf"Acceleration $\ddot q$ [{acceleration}]", acceleration, lambda e: e.qdd, _bounds(problem, "acceleration")),
        (f"Jerk [{jerk}]", jerk, rate, np.array([-own, own])),
    )


def torques(problem: Problem, evaluations: Sequence[Evaluation], name: str) -> Figure:
    """Joint torques and powers."""
    unit = unit_of(problem, "N m", "N")
    return by_joint(
        f"{name}: joint torques and powers",
        problem.task.arm.description.actuated,
        evaluations,
        (rf"Torque $\tau$ [{unit}]", unit, lambda e: e.tau, _bounds(problem, "torque")),
        (r"Power $|\tau\,\dot q|$ [W]", "W", lambda e: e.power, _bounds(problem, "power")[1:]),
    )


def spectral_radius(problem: Problem, evaluations: Sequence[Evaluation], name: str) -> Figure:
    """The largest eigenvalue of the inertia matrix (Fig. 8), each motion's least value marked."""
    figure = new_figure(f"{name}: spectral radius of the inertia matrix", 10.0, 4.8)
    (axes,) = stacked_panels(figure, problem, 1)
    unit = "kg m$^2$" if problem.task.arm.description.turning.all() else "SI units"
    axes.set_ylabel(rf"Spectral radius $\rho(M)$ [{unit}]")
    lowest = []
    for e in evaluations:
        k = int(np.nanargmin(e.spectral_radius[: usable(e, e.time)]))
        lowest.append((e.time[k], e.spectral_radius[k], e))
        draw_lines(axes, e, e.spectral_radius, style.color(e.label), style.name(e.label), style.dashes(e.label))
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
    add_legend(figure, axes)
    return figure


def tracking(problem: Problem, evaluations: Sequence[Evaluation], name: str) -> Figure:
    """How far the end effector is off its path, and how far the arm is from a singular configuration."""
    figure = new_figure(f"{name}: tracking and distance from singularity", 10.0, 6.0)
    error, singular = stacked_panels(figure, problem, 2)
    error.set_yscale("log")
    error.set_ylabel("Tracking error [m]")
    singular.set_ylabel(rf"Least singular value of $J$ [{unit_of(problem, 'm/rad', '1')}]")
    for e in evaluations:
        legend = f"{style.name(e.label)}\nlargest error {e.tracking_error.max():.1e} m"
        draw_lines(error, e, np.maximum(e.tracking_error, FLOOR), style.color(e.label), legend, style.dashes(e.label))
        draw_lines(singular, e, e.singular_value, style.color(e.label), dashes=style.dashes(e.label))
    singular.set_ylim(bottom=0.0)
    add_legend(figure, error)
    return figure


def clearance(problem: Problem, evaluations: Sequence[Evaluation], name: str) -> Figure | None:
    """The smallest distance of a moving link from an obstacle, and the margin that is to be kept; none without."""
    if problem.obstacles is None:
        return None
    figure = new_figure(f"{name}: clearance", 10.0, 4.4)
    (axes,) = stacked_panels(figure, problem, 1)
    axes.set_ylabel("Clearance [m]")
    for e in evaluations:
        least = min(e.clearance.min(), e.clearance_between)
        legend = f"{style.name(e.label)}\nat least {1000 * least:.3g} mm"
        draw_lines(axes, e, e.clearance, style.color(e.label), legend, style.dashes(e.label))
    axes.axhline(problem.obstacles.margin, color=EVENT, linestyle=BROKEN, linewidth=1.2, label="Margin")
    axes.axhspan(min(0.0, axes.get_ylim()[0]), problem.obstacles.margin, color=EVENT, alpha=0.08, linewidth=0)
    add_legend(figure, axes)
    return figure


def _bounds(problem: Problem, kind: str) -> Array:
    """(2, n) of one kind, infinite where there is none."""
    band = next(band for band in bands(problem) if band.kind == kind)
    return np.array([band.lower, band.upper])


def _ranges(problem: Problem) -> Array:
    """The joint limits (2, n) that the motion must keep, or is to stay in the middle of; infinite without any."""
    bounds, secondary = problem.bounds, problem.objective.secondary
    if secondary is not None and "joint_centering" in secondary.criteria:
        return np.array([secondary.lower, secondary.upper])
    return np.array([bounds.lower, bounds.upper])[:, problem.task.arm.joints]
