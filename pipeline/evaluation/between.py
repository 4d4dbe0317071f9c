"""What a motion does between its knots: the cubic spline through them, or samples that come with derivatives."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from scipy.interpolate import CubicSpline

from pipeline.common.arrays import Array
from pipeline.evaluation.base import angle_between
from pipeline.evaluation.certified import Near, near
from pipeline.evaluation.clearance import Clearance
from pipeline.evaluation.limits import excesses, limit_excess
from pipeline.evaluation.plant import SinglePlant
from pipeline.evaluation.sums import weighted_sum
from pipeline.problem.problem import Boundary, Problem
from pipeline.problem.solution import Trajectory

BETWEEN = 10  # sub-intervals per knot interval on which the motion between knots is judged


@dataclass(frozen=True)
class Between:
    """What the cubic spline through the knots does, by Simpson's rule: its objective, excess of
    limits, and running integrals (N + 1,) by their names, that of w as `secondary`. Torques count where they are known.
    """

    objective: float = float("nan")
    limit_excess: dict[str, float] = field(default_factory=dict)
    running: dict[str, Array] = field(default_factory=dict)

    @property
    def energy(self) -> float:
        return float(self.running["kinetic_energy"][-1]) if self.running else float("nan")


def between_knots(
    problem: Problem, plant: SinglePlant, clear: Near, trajectory: Trajectory, qd_start: Array
) -> Between:
    """The spline that a motion is; or the one through its knots, from rest where torques count."""
    if not np.all(np.isfinite(trajectory.q)):
        return Between()
    # Only torques tie the first velocity to rest; the energy's sum lets it jump, and nothing prescribes the last one.
    torque_counts = problem.objective.second_order or bool(np.isfinite(problem.bounds.torque).any())
    rest = problem.reference.timing.at_rest and problem.boundary is not Boundary.CYCLIC and torque_counts
    ends: Any = ((1, qd_start), "not-a-knot") if rest else "not-a-knot"
    smooth = trajectory.ends is not None
    if trajectory.ends is not None:
        ends = ((1, trajectory.ends[0]), (1, trajectory.ends[1]))
    spline = CubicSpline(trajectory.time, trajectory.q, bc_type=ends)
    fraction = np.linspace(0.0, 1.0, BETWEEN + 1)
    weights = np.array([1.0, *([4.0, 2.0] * (BETWEEN // 2))[:-1], 1.0]) / (3 * BETWEEN)
    dt = np.diff(trajectory.time)
    moments = (trajectory.time[:-1, None] + dt[:, None] * fraction).ravel()
    q, qd, qdd = spline(moments), spline(moments, 1), spline(moments, 2)
    jerk = np.repeat(6 * spline.c[0], BETWEEN + 1, axis=0)  # constant in every interval
    energy, secondary, spinning = np.zeros((3, len(moments)))
    tau, nb, way = np.zeros_like(q), plant.nb, np.tile(plant.start, (len(moments), 1, 1))
    for i in range(len(moments)):
        plant.at(q[i], qd[i])
        energy[i] = plant.kinetic_energy()
        if nb:
            way[i], spinning[i] = plant.base()[1], plant.spin_squared()
        if problem.bounds.any or smooth:
            tau[i] = plant.torque(qdd[i])
        if problem.objective.secondary:
            secondary[i] = plant.secondary(problem, q[i])
    rates = {"kinetic_energy": energy, "velocity_norm": (qd[:, nb:] ** 2).sum(axis=1), "base_rotation": spinning}
    rates |= {"torque": (tau**2).sum(axis=1)} if smooth else {}
    running = {
        name: np.concatenate([[0.0], np.cumsum(rate.reshape(len(dt), -1) @ weights * dt)])
        for name, rate in (rates | {"secondary": secondary}).items()
    }
    ends_at = {name: float(running[name][-1]) for name in running}
    turn = float(angle_between(plant.start, way).max())
    excess = limit_excess(problem, q, qd, tau, clear.obstacles.bound, turn, own=clear.own.bound, qdd=qdd, jerk=jerk)
    return Between(weighted_sum(problem, ends_at, ends_at["secondary"]), excess, running)


@dataclass(frozen=True)
class Audit:
    """What samples of a motion keep: errors [m, rad], excess of limits and, by kind, sample and joint of the worst."""

    tracking_error: float
    orientation_error: float
    limit_excess: dict[str, float]
    worst: dict[str, tuple[int, int]]


def audit(problem: Problem, curve: Callable[..., Array], knots: Array, time: Array) -> Audit:
    """Judge samples at times (K,) of `curve(moment, order)`, a cubic between `knots`; its clearance is that of all of
    it.
    """
    q, qd, qdd, jerk = (curve(time, order) for order in range(4))
    plant, targets = SinglePlant(problem.task.arm), problem.reference.position(time)
    error, turned, way, tau = np.empty(len(time)), np.empty(len(time)), np.empty((len(time), 3, 3)), np.empty_like(q)
    for i in range(len(time)):
        plant.at(q[i], qd[i])
        error[i], turned[i] = plant.task_error(problem.task, targets[i])
        tau[i], way[i] = plant.torque(qdd[i]), plant.base()[1]
    turn = angle_between(plant.start, way)
    clear = near(problem, Clearance(problem.task.arm, problem.obstacles, problem.own), curve, knots)
    worst = {
        kind: tuple(int(place) for place in np.unravel_index(int(np.argmax(excess)), excess.shape))
        for kind, excess in excesses(problem, q, qd, tau, qdd, jerk).items()
    }
    for kind, found in (("clearance", clear.obstacles), ("self_clearance", clear.own)):
        if np.isfinite(found.bound):
            worst[kind] = (int(np.abs(time - found.time).argmin()), 0)
    if np.isfinite(problem.bounds.attitude):
        worst["attitude"] = (int(np.argmax(turn)), 0)
    excess = limit_excess(
        problem, q, qd, tau, clear.obstacles.bound, float(turn.max()), own=clear.own.bound, qdd=qdd, jerk=jerk
    )
    return Audit(float(error.max()), float(turned.max()), excess, worst)  # type: ignore[arg-type]
