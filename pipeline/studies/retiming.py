"""How fast could the joints run through the path of a motion? Its time-optimal parametrisation, by toppra.

Pham and Pham 2018 (IEEE Trans. Robotics 34(3)): along a joint path q(u) the limits of velocity, acceleration and torque
are linear in u'' and u'^2, and so are those of the tool's speed and, by a polygon about its ball, acceleration. The
motion jumps between its limits with jerks without bound: a lower bound on the time in which this path can be run
through, not a motion to send. The path is taken by the arc length of its joints: that of the tool stands still where
the joints move in the null space.
"""

from __future__ import annotations

import logging
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np

from pipeline.common.arrays import Array
from pipeline.common.errors import ConfigError
from pipeline.evaluation.evaluation import Evaluation
from pipeline.problem.curve import curve
from pipeline.problem.problem import Problem
from pipeline.studies.study import Motions, Result

POINTS = 400  # of the path; 800 change the time of a Panda's by less than 1e-3


SIDES = 49  # of the polygon: it leaves the ball by 0.2 %; odd, since toppra fails on sides that leave u'' free


TINY = 1e-12


FREE = 1e6  # for toppra, which wants a number where there is no limit


@dataclass(frozen=True)
class Retiming(Result):
    """seconds: of each motion, by its label, the least time [s] for its joint path; NaN where toppra finds none."""

    name: ClassVar[str] = "retiming"
    units: ClassVar[Mapping[str, str]] = {"retimed_duration": "s"}
    seconds: Mapping[str, float]

    def section(self) -> list[str]:
        listed = ", ".join(f"{label} {seconds:.3f} s" for label, seconds in self.seconds.items())
        return [
            f"Retimed by toppra: {listed}. Lower bounds on the time for these joint paths: their jerks have no bound, "
            "and limits of power and jerk are left out."
        ]

    def said(self) -> list[str]:
        return self.section()

    def columns(self, motion: Evaluation) -> Mapping[str, Any]:
        return {"retimed_duration": self.seconds[motion.label]} if motion.label in self.seconds else {}

    def facts(self) -> Mapping[str, Any]:
        return dict(self.seconds)


def study(motions: Motions) -> Retiming | None:
    """Where it is asked for: of every confirmed motion that rests at its ends."""
    if not motions.config.retiming.run:
        return None
    return Retiming({motion.label: least_time(motions.problem, motion) for motion in motions.solved})


def least_time(problem: Problem, motion: Evaluation) -> float:
    """The least time [s] for the joint path of a motion, from rest to rest within its limits."""
    moments = np.linspace(motion.time[0], motion.time[-1], POINTS + 1)
    q = curve(problem, motion.time, motion.q, motion.solution.trajectory.ends)(moments)
    return retimed(problem, q)


def retimed(problem: Problem, q: Array) -> float:
    """The same of a joint path through the points q (K, n)."""
    try:
        import toppra
        from toppra import algorithm, constraint
    except ImportError:
        raise ConfigError("retiming.run = true: needs toppra; pip install '.[retiming]'") from None
    logging.getLogger("toppra").setLevel(logging.CRITICAL)
    bounds, arm = problem.bounds, problem.task.arm
    u = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(q, axis=0), axis=1))])
    kept = np.concatenate([[True], np.diff(u) > 1e-9 * u[-1]])
    path = toppra.SplineInterpolator(u[kept], q[kept])
    known: list[Any] = []
    for bound, kind in (
        (bounds.velocity, constraint.JointVelocityConstraint),
        (bounds.acceleration, constraint.JointAccelerationConstraint),
    ):
        if np.isfinite(bound).any():
            known.append(kind(_both(bound, arm.n)))
    if np.isfinite(bounds.torque).any():

        def torque(place: Array, rate: Array, second: Array) -> Array:
            return arm.inverse_dynamics(place[None], rate[None], second[None])[0]

        known.append(constraint.JointTorqueConstraint(torque, _both(bounds.torque, arm.n), np.zeros(arm.n)))
    if bounds.limits_tool:
        known.append(_tool(constraint.LinearConstraint, problem))
    found = algorithm.TOPPRA(known, path, gridpoints=u[kept], solver_wrapper="seidel").compute_trajectory(0, 0)
    return float("nan") if found is None else float(found.duration)


def _tool(linear: Any, problem: Problem) -> Any:
    """The tool's speed |x'| u' <= V, and its acceleration x' u'' + x'' u'^2 within SIDES sides about its ball, in the
    plane of x' and x''.
    """
    bounds, task = problem.bounds, problem.task
    angle = 2 * np.pi * np.arange(SIDES) / SIDES

    class Tool(linear):  # type: ignore[misc]
        def compute_constraint_params(self, path: Any, gridpoints: Array) -> tuple[Any, ...]:
            q, first, second = (np.asarray(path(gridpoints, order)) for order in range(3))
            jacobian = task.arm.jacobian(q)[:, task.rows]
            along = np.einsum("kij,kj->ki", jacobian, first)
            across = np.einsum("kij,kj->ki", jacobian, second) + task.arm.jacobian_rate_term(q, first)[:, task.rows]
            speed = np.linalg.norm(along, axis=1)
            part = np.einsum("ki,ki->k", along, across) / np.maximum(speed, TINY)
            rest = np.sqrt(np.maximum((across**2).sum(axis=1) - part**2, 0.0))
            most = np.minimum((bounds.tool_speed / np.maximum(speed, TINY)) ** 2, FREE)
            fastest = np.column_stack([0 * most, most]) if np.isfinite(bounds.tool_speed) else None
            a, b = np.column_stack([speed, 0 * speed]), np.column_stack([part, rest])
            sides, room = np.column_stack([np.cos(angle), np.sin(angle)]), min(bounds.tool_acceleration, FREE)
            return a, b, 0 * a, sides, np.full(SIDES, room), None, fastest

    made = Tool()
    made.identical = True
    return made


def _both(bound: Array, n: int) -> Array:
    most = np.where(np.isfinite(bound), bound, FREE) * np.ones(n)
    return np.column_stack([-most, most])
