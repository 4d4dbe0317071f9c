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
from pipeline.evaluation.limits import excesses, limit_excess, of_tool
from pipeline.evaluation.plant import SinglePlant
from pipeline.evaluation.sums import differences, weighted_sum
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
    tau, pace, nb, way = np.zeros_like(q), np.zeros((len(q), 2)), plant.nb, np.tile(plant.start, (len(moments), 1, 1))
    known = smooth or problem.bounds.any
    for i in range(len(moments)):
        plant.at(q[i], qd[i])
        energy[i] = plant.kinetic_energy()
        if nb:
            way[i], spinning[i] = plant.base()[1], plant.spin_squared()
        if known:
            tau[i] = plant.torque(qdd[i])
        if problem.bounds.limits_tool:
            pace[i] = plant.pace(problem.task, qdd[i])
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
    excess = limit_excess(
        problem, q, qd, tau, clear.obstacles.bound, turn, own=clear.own.bound, qdd=qdd, jerk=jerk, pace=pace
    )
    return Between(weighted_sum(problem, ends_at, ends_at["secondary"]), excess, running)


def tool_pace(
    problem: Problem, plant: SinglePlant, trajectory: Trajectory, position: Array, rates: tuple[Array, Array]
) -> Array | None:
    """Speed [m/s] and acceleration [m/s^2] of the tool (N + 1, 2) at the knots, where they are limited; of a motion
    that is known at its knots alone by backward differences of the tool's own positions (N + 1, 3).
    """
    if not problem.bounds.limits_tool:
        return None
    if trajectory.ends is None:
        own = Trajectory(trajectory.time, position[:, problem.task.rows])
        both = differences(own, problem.boundary, problem.reference.timing.at_rest)
        return np.column_stack([np.linalg.norm(values, axis=1) for values in both])
    found = np.empty((len(position), 2))
    for i, (q, qd, qdd) in enumerate(zip(trajectory.q, *rates, strict=True)):
        plant.at(q, qd)
        found[i] = plant.pace(problem.task, qdd)
    return found


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
    pace = np.zeros((len(time), 2))
    for i in range(len(time)):
        plant.at(q[i], qd[i])
        error[i], turned[i] = plant.task_error(problem.task, targets[i])
        tau[i], way[i] = plant.torque(qdd[i]), plant.base()[1]
        pace[i] = plant.pace(problem.task, qdd[i])
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
    worst |= {kind: (int(np.argmax(excess)), 0) for kind, excess in of_tool(problem, pace).items()}
    nearest, most = clear.obstacles.bound, float(turn.max())
    excess = limit_excess(problem, q, qd, tau, nearest, most, own=clear.own.bound, qdd=qdd, jerk=jerk, pace=pace)
    return Audit(float(error.max()), float(turned.max()), excess, worst)  # type: ignore[arg-type]
