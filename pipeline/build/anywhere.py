"""Where no initial configuration is given: of a path that lies somewhere in the world a motion may begin anywhere."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from pipeline.common.arrays import Array
from pipeline.model.clearance import Clearance
from pipeline.model.kinematics import project
from pipeline.problem.problem import Boundary, Problem

DRAWN = 200  # configurations
CLEAR = 20  # of those at the start that are looked at among obstacles


def from_anywhere(problem: Problem) -> Problem:
    """The same with a start to be found, and one that is within limits and clear of obstacles to begin with."""
    free = problem.boundary is Boundary.FIXED
    said = "robot.q_init is not given: where the motion begins is sought in the whole joint space, within its limits"
    reference = replace(problem.reference, notes=(*problem.reference.notes, said))
    boundary = Boundary.FREE if free else problem.boundary
    return replace(problem, reference=reference, boundary=boundary, q_init=_one(problem))


def _one(problem: Problem) -> Array:
    """Of random configurations at the path's start the one nearest to the middle of the joints' ranges that is allowed;
    the given one if none is.
    """
    bounds, arm = problem.bounds, problem.task.arm
    low = np.where(np.isfinite(bounds.lower), bounds.lower, -np.pi)
    high = np.where(np.isfinite(bounds.upper), bounds.upper, np.pi)
    drawn = np.random.default_rng(0).uniform(low, high, (DRAWN, arm.n))
    start = problem.reference.position(np.zeros(1))
    q, error = project(problem.task, drawn, np.tile(start, (DRAWN, 1)), tolerance=1e-10)
    q = q[(error <= 1e-10) & (q >= bounds.lower).all(axis=1) & (q <= bounds.upper).all(axis=1)]
    q = q[np.argsort((((q - (low + high) / 2) / (high - low)) ** 2).sum(axis=1))]
    if problem.keeps_clear and len(q):
        q = q[:CLEAR]
        q = q[Clearance(arm, problem.obstacles, problem.own).clear(q)]
    return np.asarray(q[0]) if len(q) else problem.q_init
