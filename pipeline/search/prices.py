"""What velocity limits cost a motion that they hold: their multipliers."""

from __future__ import annotations

import numpy as np
from scipy.optimize import nnls

from pipeline.common.arrays import Array
from pipeline.problem.problem import Boundary, Problem
from pipeline.search.manifold import Manifold
from pipeline.search.self_motion import tangent

HELD = 1e-4  # relative: how near to its limit a step is that is held by it
MOVE = 1e-6  # [rad] of the differences


def prices(problem: Problem, times: Array, q: Array) -> Array:
    """(N, n) for a motion q (N + 1, n) on its self-motion loops (r = 1): of every step that a velocity limit holds the
    multiplier, with the sign of the step.

    They balance the cost's derivatives along the loops as well as multipliers that are not negative can (Karush, Kuhn
    and Tucker); knots at a position limit need no balance.
    """
    count, n = q.shape
    bounds, limit = problem.bounds, np.diff(times)[:, None] * problem.bounds.velocity
    found = np.zeros((count - 1, n))
    step = np.diff(q, axis=0)
    interval, joint = np.nonzero(np.abs(step) >= limit * (1 - HELD))
    if not len(interval):
        return found
    along = tangent(problem.task.jacobian(q))
    moved = q + MOVE * np.eye(count)[:, :, None] * along, q - MOVE * np.eye(count)[:, :, None] * along
    up, down = (Manifold(problem).cost(times, motions) for motions in moved)
    slope = (up - down) / (2 * MOVE)
    side, column = np.sign(step[interval, joint]), np.arange(len(interval))
    balance = np.zeros((count, len(interval)))
    balance[interval + 1, column] += side * along[interval + 1, joint]
    balance[interval, column] -= side * along[interval, joint]
    if problem.boundary is Boundary.CYCLIC:
        same = np.sign((along[0] * along[-1]).sum())
        balance[0] += same * balance[-1]
        slope[0] += same * slope[-1]
        balance, slope, q = balance[:-1], slope[:-1], q[:-1]
    free = np.all((q > bounds.lower + HELD) & (q < bounds.upper - HELD), axis=1)
    free[0] &= problem.boundary is not Boundary.FIXED
    multipliers, _ = nnls(balance[free], -slope[free])
    found[interval, joint] = side * multipliers
    return found
