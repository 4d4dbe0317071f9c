"""Velocities, accelerations, running integrals by the documents' backward differences (Global paper eqs (3) to (6))."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
from scipy.interpolate import CubicSpline

from pipeline.common.arrays import Array
from pipeline.problem.problem import Boundary, Problem
from pipeline.problem.solution import Trajectory


def differences(trajectory: Trajectory, boundary: Boundary, at_rest: bool) -> tuple[Array, Array]:
    """qd, qdd (N + 1, n) by backward differences: qd_i = (q_i - q_(i-1)) / dt_i, qdd_i = (qd_i - qd_(i-1)) / dt_i.

    qd_0 is zero for a motion from rest, qd_N for a cyclic one, and qd_1 for a path that is entered at speed.
    """
    dt = np.diff(trajectory.time)[:, None]
    step = np.diff(trajectory.q, axis=0) / dt
    if boundary is Boundary.CYCLIC:
        first = step[-1]
    else:
        first = np.zeros_like(step[0]) if at_rest else step[0]
    qd = np.vstack([first, step])
    change = np.diff(qd, axis=0) / dt
    return qd, np.vstack([change[-1] if boundary is Boundary.CYCLIC else np.zeros_like(first), change])


def derivatives(trajectory: Trajectory, boundary: Boundary, at_rest: bool) -> tuple[Array, Array, Array]:
    """qd, qdd, jerk (N + 1, n): a spline's, its jerk that of the interval before each knot; else by differences."""
    time, ends = trajectory.time, trajectory.ends
    if ends is None:
        qd, qdd = differences(trajectory, boundary, at_rest)
        jerk = np.diff(qdd, axis=0) / np.diff(time)[:, None]
        return qd, qdd, np.vstack([np.zeros_like(qdd[:1]), jerk])
    spline = CubicSpline(time, trajectory.q, bc_type=((1, ends[0]), (1, ends[1])))
    return spline(time, 1), spline(time, 2), 6 * np.vstack([spline.c[0, :1], spline.c[0]])


def weighted_sum(problem: Problem, integrals: Mapping[str, float], secondary: float) -> float:
    """The objective from its integrals by name; one that is not known does not matter unless it counts."""
    objective = problem.objective
    total = sum(weight * integrals.get(name, np.nan) for name, weight in objective.weights.items())
    return total - objective.secondary.k0 * secondary if objective.secondary else total


def running_integral(rate: Array, dt: Array) -> Array:
    return np.concatenate([[0.0], np.cumsum(rate[1:] * dt)])
