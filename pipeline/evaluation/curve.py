"""The curve that is exported: the smooth motion through the knots, and how far it is from its path between them."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from scipy.interpolate import CubicSpline

from pipeline.common.arrays import Array
from pipeline.evaluation.plant import SinglePlant
from pipeline.problem.problem import Boundary, Problem
from pipeline.problem.solution import Trajectory
from pipeline.problem.turns import full_turns

CLOSES = 1e-6  # [rad] within which a cycle comes back, up to full turns
INNER = 4  # sub-intervals per knot interval at which the curve is held against its path
MOST = 100_000  # intervals that may be advised
SAFETY = (1.5, 5.0)  # on the measured error: for at most twice the knots, and for more


def curve(problem: Problem, time: Array, q: Array, ends: Array | None = None) -> CubicSpline:
    """The C2 spline through the joints' knots q (N + 1, joints), with the velocities `ends` (2, joints) of a motion
    that is one; else from rest to rest for a path at rest, and periodic up to full turns for a cycle.
    """
    if ends is not None:
        return CubicSpline(time, q, bc_type=((1, ends[0]), (1, ends[1])))
    if problem.boundary is Boundary.CYCLIC and (winding := turns_of_cycle(problem, q)) is not None:
        rate = winding / (time[-1] - time[0])
        closed = q - rate * (time - time[0])[:, None]
        closed[-1] = closed[0]
        spline = CubicSpline(time, closed, bc_type="periodic", extrapolate=False)
        spline.c[2] += rate
        spline.c[3] += rate * (time[:-1] - time[0])[:, None]
        return spline
    return CubicSpline(time, q, bc_type="clamped" if problem.reference.timing.at_rest else "not-a-knot")


def end_speeds(problem: Problem, trajectory: Trajectory) -> Array:
    """The joints' velocities (2, joints) [rad/s] with which a motion begins and ends that a path at rest asks to rest;
    zero where it asks for none, as a cycle that is repeated or a path that is entered at speed.

    Of knots alone, those of the spline that nothing holds at its ends.
    """
    joints = trajectory.q[:, problem.task.arm.base.count :]
    if problem.boundary is Boundary.CYCLIC or not problem.reference.timing.at_rest:
        return np.zeros((2, joints.shape[1]))
    if trajectory.ends is not None:
        return trajectory.ends
    return np.asarray(CubicSpline(trajectory.time, joints)(trajectory.time[[0, -1]], 1))


def turns_of_cycle(problem: Problem, q: Array) -> Array | None:
    """The full turns [rad] by which the joints of a cycle q (N + 1, joints) wind on; None if it does not close."""
    turns = full_turns(problem, q[0], q[-1])
    return turns if np.abs(q[-1] - q[0] - turns).max() <= CLOSES else None


def whole(problem: Problem, trajectory: Trajectory) -> Callable[..., Array]:
    """The same curve of a trajectory, with a moving base's coordinates before the joints'."""
    time, q = trajectory.time, trajectory.q
    base_of, nb = problem.task.arm.base, problem.task.arm.base.count
    joints = curve(problem, time, q[:, nb:], trajectory.ends)
    if not nb:
        return joints
    rest = problem.reference.timing.at_rest and problem.boundary is not Boundary.CYCLIC
    still = rest and not any(base_of.spacecraft.momentum)
    base = CubicSpline(time, q[:, :nb], bc_type="clamped" if still else "not-a-knot")
    return lambda moment, order=0: np.hstack([base(moment, order), joints(moment, order)])


@dataclass(frozen=True)
class OffPath:
    """The largest errors of a curve, at its knots and between them: distance [m] and angle [rad], and when [s]."""

    distance: float
    angle: float
    when: tuple[float, float]


def off_path(problem: Problem, plant: SinglePlant, trajectory: Trajectory) -> OffPath:
    """How far the curve of a trajectory is from its path; nan where it has none."""
    time, q = trajectory.time, trajectory.q
    if not np.all(np.isfinite(q)) or len(time) < 4:
        return OffPath(np.nan, np.nan, (np.nan, np.nan))
    moments = np.interp(np.arange(INNER * (len(time) - 1) + 1) / INNER, np.arange(len(time)), time)
    motion, targets = whole(problem, trajectory)(moments), problem.reference.position(moments)
    error = np.empty((len(moments), 2))
    for i in range(len(moments)):
        plant.at(motion[i], np.zeros_like(motion[i]))
        error[i] = plant.task_error(problem.task, targets[i])
    worst = error.argmax(axis=0)
    distance, angle = error.max(axis=0)
    return OffPath(float(distance), float(angle), (float(moments[worst[0]]), float(moments[worst[1]])))


def steps_needed(problem: Problem, time: Array, off: float, allowed: float) -> int | None:
    """How many even intervals would bring a curve, `off` [m] its path on the knots `time`, to within `allowed`.

    The path itself, splined through its points at the knots, shows how that error falls with their number (as its
    fourth power, once they resolve it); the curve's is larger by a factor, measured on the knots it has, which tells
    less the farther it is carried. None: no number does.
    """
    count, here = len(time) - 1, _of_path(problem, len(time) - 1)
    factor = max(off / here, 1.0) if here > 0 else np.inf
    near, far = (_least(problem, count, allowed / (safety * factor)) for safety in SAFETY)
    return near if near is not None and near <= 2 * count else far


def _least(problem: Problem, low: int, allowed: float) -> int | None:
    """The intervals, rounded up to two digits, on which the path's own spline is within `allowed` [m] of it."""
    high = MOST
    if not _of_path(problem, high) <= allowed:
        return None
    while high > 1.02 * low + 1:
        middle = max(low + 1, int(np.sqrt(low * high)))
        low, high = (low, middle) if _of_path(problem, middle) <= allowed else (middle, high)
    return int(float(f"{high * 1.04:.1e}"))


def _of_path(problem: Problem, intervals: int) -> float:
    """How far [m] the spline through the path's points at even knots is from the path between them."""
    rows = len(problem.task.axes)
    knots = np.linspace(0.0, problem.reference.duration, intervals + 1)
    middle = (knots[1:] + knots[:-1]) / 2
    ends = "clamped" if problem.reference.timing.at_rest else "not-a-knot"
    spline = CubicSpline(knots, problem.reference.position(knots)[:, :rows], bc_type=ends)
    return float(np.linalg.norm(spline(middle) - problem.reference.position(middle)[:, :rows], axis=1).max())
