"""The documents' figures drawn again, from the motions that runs have left: one function per kind, in `DRAW`."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import partial

import numpy as np
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure

from pipeline.artifacts.figures import motions
from pipeline.artifacts.figures.panels import EVENT, INK
from pipeline.artifacts.figures.stroboscopic import stroboscopic
from pipeline.common.arrays import Array
from pipeline.config.found import PowerLaw
from pipeline.evaluation.evaluation import Evaluation
from pipeline.reproduce.recompute import recompute
from pipeline.reproduce.results import Results
from pipeline.studies import style
from pipeline.studies.candidates import Candidates
from pipeline.studies.front import Front
from pipeline.studies.identification import Identification

FIGURES = {
    "reference": motions.reference,
    "stroboscopic": stroboscopic,
    "joints": motions.joints,
    "spectral_radius": motions.spectral_radius,
}
Draw = Callable[[Sequence[Results], Sequence[str], str], Figure]


def _evaluations(run: Results, labels: Sequence[str]) -> list[Evaluation]:
    """The motions named: `lsv`, `global 2`, ..."""
    split = [label.partition(" ") for label in labels]
    return [run.evaluation(method, int(number or 1)) for method, _, number in split]


def _of_one_run(runs: Sequence[Results], labels: Sequence[str], title: str, name: str) -> Figure:
    """A figure that every run has, of the motions named."""
    return FIGURES[name](runs[0].problem, _evaluations(runs[0], labels), title)


def energy_integrals(runs: Sequence[Results], labels: Sequence[str], title: str) -> Figure:
    """The running kinetic-energy integral, a panel per trajectory; cut off above all but a singular motion."""
    figure, panels = _panels(title, len(runs), 2)
    for axes, run in zip(panels, runs, strict=False):
        usable = []
        for e in _evaluations(run, labels):
            event = e.solution.event_time
            line, above = ("--", 3) if e.method == "pmke" else ("-", 2)  # it hides the optimum where they coincide
            axes.plot(
                *(e.time, e.energy_integral, line),
                color=style.color(e.label),
                label=style.name(e.label),
                zorder=above,
            )
            usable.append(e.energy_integral[-1] if event is None else 0.0)
            if event is not None:
                axes.axvline(event, color=EVENT, linewidth=1.0, linestyle="--")
        axes.set(title=run.name, xlim=(0, run.problem.reference.duration), ylim=(0, 1.3 * max(usable)))
        axes.set_ylabel(r"$\int T\,dt$ [J s]")
    _legend(figure, panels[0])
    return figure


def joint_variables(runs: Sequence[Results], labels: Sequence[str], title: str) -> Figure:
    """Positions, velocities, torques and powers of one motion, with their limits."""
    (e,), bounds = _evaluations(runs[0], labels), runs[0].problem.bounds
    figure, panels = _panels(title, 4, 2)
    kinds: tuple[tuple[str, Array, Array], ...] = (
        ("Position $q$ [rad]", e.q, np.array([bounds.lower, bounds.upper])),
        (r"Velocity $\dot q$ [rad/s]", e.qd, np.array([-bounds.velocity, bounds.velocity])),
        (r"Torque $\tau$ [N m]", e.tau, np.array([-bounds.torque, bounds.torque])),
        (r"Power $|\tau\,\dot q|$ [W]", e.power, bounds.power[None]),
    )
    for axes, (label, values, limits) in zip(panels, kinds, strict=True):
        _joints(axes, e.time, values, limits)
        axes.set_ylabel(label)
    _legend(figure, panels[0])
    return figure


def energies(runs: Sequence[Results], labels: Sequence[str], title: str) -> Figure:
    """Kinetic energy, power of all joints, and both integrals of one motion."""
    (e,) = _evaluations(runs[0], labels)
    figure, panels = _panels(title, 4, 2)
    for axes, (label, values) in zip(
        panels,
        (
            ("Kinetic energy $T$ [J]", e.kinetic_energy),
            (r"Power $\sum\tau_j\dot q_j$ [W]", (e.tau * e.qd).sum(axis=1)),
            (r"$\int T\,dt$ [J s]", e.energy_integral),
            (r"$\int\tau'\tau\,dt$ [N$^2$ m$^2$ s]", e.torque_integral),
        ),
        strict=True,
    ):
        axes.plot(e.time, values, color=style.color(e.label))
        axes.set_ylabel(label)
        axes.set_xlim(e.time[0], e.time[-1])
    return figure


def joints_and_error(runs: Sequence[Results], labels: Sequence[str], title: str) -> Figure:
    """Joint positions with the limits that the objective knows (a), and the position error (b)."""
    (e,), criteria = _evaluations(runs[0], labels), runs[0].problem.objective.secondary
    limits = np.empty((0, e.q.shape[1])) if criteria is None else np.array([criteria.lower, criteria.upper])
    figure, (left, right) = _panels(title, 2, 2)
    _joints(left, e.time, e.q, limits)
    left.set_ylabel("Position $q$ [rad]")
    right.plot(e.time, e.tracking_error, color=style.color(e.label))
    right.set_ylabel("Position error [m]")
    right.set_xlim(e.time[0], e.time[-1])
    _legend(figure, left)
    return figure


def candidate_study(runs: Sequence[Results], labels: Sequence[str], title: str) -> Figure:
    """The candidate study's curve, its fit and the printed one."""
    (run,) = runs
    curve, problem = run.table("candidate_study"), run.problem
    intercept, exponent = (
        recompute(PowerLaw(run.name, parameter), {run.name: run}) for parameter in ("intercept", "exponent")
    )
    parameters = len(problem.times) * problem.task.arm.n
    found = Candidates(curve["candidates"].to_numpy(), curve["distance"].to_numpy(), parameters, intercept, exponent)
    return found.figures(title)["candidate_study"]


def front(runs: Sequence[Results], labels: Sequence[str], title: str) -> Figure:
    """The Pareto front."""
    return Front(runs[0].table("front")).figures(title)["front"]


def identification(runs: Sequence[Results], labels: Sequence[str], title: str) -> Figure:
    """The residuals of every printed number under the printed and the identified masses."""
    found = Identification(runs[0].table("masses"), runs[0].table("identification"))
    return found.figures(title)["identification"]


DRAW: dict[str, Draw] = {
    **{name: partial(_of_one_run, name=name) for name in ("reference", "stroboscopic", "joints", "spectral_radius")},
    "energy_integrals": energy_integrals,
    "joint_variables": joint_variables,
    "energies": energies,
    "joints_and_error": joints_and_error,
    "candidate_study": candidate_study,
    "front": front,
    "identification": identification,
}


def _panels(title: str, count: int, columns: int) -> tuple[Figure, list[Axes]]:
    rows = -(-count // columns)
    figure = Figure(figsize=(5.0 * columns, 2.9 * rows + 0.8), layout="constrained")
    FigureCanvasAgg(figure)
    figure.suptitle(title, fontsize=12, fontweight="bold", color=INK)
    panels = list(np.ravel(figure.subplots(rows, columns, squeeze=False)))[:count]
    for axes in panels:
        axes.grid(color="#E2E8F0", linewidth=0.7)
        axes.set_axisbelow(True)
        axes.spines[["top", "right"]].set_visible(False)
    for axes in panels[-columns:]:
        axes.set_xlabel("Time [s]")
    return figure, panels


def _joints(axes: Axes, time: Array, values: Array, limits: Array) -> None:
    """A line per joint (N + 1, n), and its limits (.., n) broken in its colour where they are finite."""
    for joint, line in enumerate(values.T):
        axes.plot(time, line, color=style.joint_color(joint), label=f"Joint {joint + 1}")
        for bound in limits[:, joint]:
            if np.isfinite(bound):
                axes.axhline(bound, color=style.joint_color(joint), linestyle=(0, (2, 3)), linewidth=1.0)
    axes.set_xlim(time[0], time[-1])


def _legend(figure: Figure, axes: Axes) -> None:
    figure.legend(*axes.get_legend_handles_labels(), loc="outside lower center", ncols=4, frameon=False)
