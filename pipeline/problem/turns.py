"""Cycles close up to full turns of the joints that may turn for ever."""

from __future__ import annotations

import numpy as np

from pipeline.common.arrays import Array
from pipeline.problem.problem import Problem


def full_turns(problem: Problem, start: Array, end: Array) -> Array:
    """The full turns [rad] nearest to end - start of the turning joints that nothing limits; zero elsewhere.

    start, end (..., n), or (..., joints) without a moving base's coordinates.
    """
    return 2 * np.pi * np.where(endless(problem)[-start.shape[-1] :], np.rint((end - start) / (2 * np.pi)), 0.0)


def endless(problem: Problem) -> Array:
    """Whether each joint (n,) turns, and no limit holds its position."""
    arm, bounds = problem.task.arm, problem.bounds
    revolute = np.zeros(arm.n, dtype=bool)
    revolute[arm.joints] = np.asarray(arm.description.revolute)[-(arm.n - arm.base.count) :]
    return np.asarray(revolute & np.isinf(bounds.lower) & np.isinf(bounds.upper))
