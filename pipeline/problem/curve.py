"""The curve that is exported: the smooth motion through the knots of a joint motion."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from scipy.interpolate import CubicSpline

from pipeline.common.arrays import Array
from pipeline.problem.problem import Boundary, Problem
from pipeline.problem.solution import Trajectory
from pipeline.problem.turns import full_turns

CLOSES = 1e-6  # [rad] within which a cycle comes back, up to full turns


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
    zero where it asks for none, as a path that is entered at speed.

    A cycle too is begun from rest. Of knots alone, those of the spline that closes smoothly, or else of the one that
    nothing holds at its ends.
    """
    time, joints = trajectory.time, trajectory.q[:, problem.task.arm.base.count :]
    if not problem.reference.timing.at_rest:
        return np.zeros((2, joints.shape[1]))
    if trajectory.ends is not None:
        return trajectory.ends
    closes = problem.boundary is Boundary.CYCLIC and turns_of_cycle(problem, joints) is not None
    spline = curve(problem, time, joints) if closes else CubicSpline(time, joints)
    return np.asarray(spline(time[[0, -1]], 1))


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
