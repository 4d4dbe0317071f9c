"""Starts for the global planner: initial configurations, a population of motions, their ranking, distinct basins.

Global paper Sections 3.1.2 and 3.1.3: qd = W^-1 J'(J W^-1 J')^-1 xd with random symmetric positive definite W (eqs
(9)-(11)), from initial configurations spread by random self-motion (eq. (17)).
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from pipeline.common.arrays import Array
from pipeline.model.arm import Arm
from pipeline.model.kernel.arm import on_kernel
from pipeline.model.kinematics import project
from pipeline.problem.costs import objective_values
from pipeline.problem.problem import Boundary, Problem
from pipeline.problem.turns import full_turns


def random_inverse_weights(rng: np.random.Generator, count: int, n: int) -> Array:
    """(count, n, n) inverses of random SPD weights: eigenvalues of W in (0, 1] and eigenvectors, both uniform."""
    basis, triangle = np.linalg.qr(rng.normal(size=(count, n, n)))
    basis = basis * np.sign(np.diagonal(triangle, axis1=1, axis2=2))[:, None, :]
    eigenvalues = 1.0 - rng.random((count, n))
    return np.asarray(np.einsum("kij,kj,klj->kil", basis, 1.0 / np.maximum(eigenvalues, 1e-3), basis))


def population(
    problem: Problem, times: Array, starts: Array, count: int, rng: np.random.Generator, *, plain: bool = True
) -> Array:
    """Motions (K, N + 1, n) that stay on the path at every knot; K <= count: those that lose it are left out.

    They are spread evenly over the initial configurations `starts` (C, n); of each, the first is the inertia-weighted
    and the second the plain pseudoinverse (unless `plain` is False), the others have random constant weights.
    """
    if not problem.task.arm.base.count:
        problem = replace(problem, task=on_kernel(problem.task))  # thousands of motions, a knot at a time
    arm = problem.task.arm
    x_ref = problem.reference.position(times)
    which = np.arange(count) % len(starts)
    turn = np.arange(count) // len(starts) + (0 if plain else 2)
    joints = arm.n - arm.base.count
    constant = random_inverse_weights(rng, count, joints)
    constant[turn == 1] = np.eye(joints)
    motions: Array = np.empty((count, len(times), arm.n))
    motions[:, 0] = starts[which]
    alive = np.ones(count, dtype=bool)
    by_inertia = np.flatnonzero(turn == 0)
    for i in range(1, len(times)):
        rows = np.flatnonzero(alive)
        if not rows.size:
            break
        before = motions[rows, i - 1]
        weight = arm.lift(before, constant[rows])
        weighted = np.isin(rows, by_inertia)
        if weighted.any():
            weight[weighted] = arm.inverse_inertia(before[weighted])
        target = np.tile(x_ref[i], (len(rows), 1))
        drifted = before + (times[i] - times[i - 1]) * arm.follow(before, np.zeros_like(before))
        motions[rows, i], error = project(problem.task, drifted, target, weight, tolerance=1e-9, max_iterations=12)
        alive[rows] = error < 1e-6
    motions = motions[alive]
    if problem.boundary is Boundary.CYCLIC and len(motions):
        motions = _close(problem, times, motions)
    return motions


def _close(problem: Problem, times: Array, motions: Array) -> Array:
    """Spread the gap between end and start of each motion over its knots, and put the knots back on the path."""
    arm = problem.task.arm
    turns = full_turns(problem, motions[:, 0], motions[:, -1])
    gap = motions[:, -1] - motions[:, 0] - turns
    gap[:, : arm.base.count] = 0.0
    ramp = np.linspace(0.0, 1.0, len(times))[:, None]
    moved = motions - ramp * gap[:, None, :]
    if arm.base.count:
        return _refloat(arm, times, moved)
    count, knots, n = moved.shape
    target = np.tile(problem.reference.position(times), (count, 1))
    closed, error = project(problem.task, moved.reshape(-1, n), target, tolerance=1e-9)
    closed = closed.reshape(moved.shape)
    fine = (error.reshape(count, knots).max(axis=1) < 1e-6) & (
        np.abs(closed[:, -1] - closed[:, 0] - turns).max(axis=1) < 1e-6
    )
    return closed[fine]


def _refloat(arm: Arm, times: Array, motions: Array) -> Array:
    """Motions (K, N + 1, n) with the same joints, and the base where they take it; the path is the solver's to find."""
    out = motions.copy()
    for i in range(1, len(times)):
        step = motions[:, i] - motions[:, i - 1]
        middle = out[:, i - 1].copy()
        middle[:, arm.joints] = (motions[:, i] + motions[:, i - 1])[:, arm.joints] / 2
        out[:, i] = out[:, i - 1] + arm.follow(middle, step / (times[i] - times[i - 1])) * (times[i] - times[i - 1])
    return out


def ranking(problem: Problem, times: Array, motions: Array, limit_weight: float) -> Array:
    """Cost (K,) of each motion plus the distance from the joint limits, eq. (14), over the joints that have limits."""
    limits = problem.bounds
    span = limits.upper - limits.lower
    cost = objective_values(problem, times, motions)
    limited = np.isfinite(span)
    if limited.any():
        middle = (limits.upper[limited] + limits.lower[limited]) / 2
        distance = ((motions[:, :, limited] - middle) / span[limited]) ** 2
        cost = cost + limit_weight * distance.sum(axis=(1, 2)) / motions.shape[2]
    return cost
