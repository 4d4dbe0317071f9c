"""Extremals: motions that keep Lagrange's equations along the path, many at once, by Dormand and Prince's 8(5,3).

With a multiplier lambda(t) for the task J qdd = xdd - Jd qd, Lagrange's equations of L = 1/2 qd' G qd - k0 w are
G qdd + n = J' lambda, hence

    qdd = J_G+ (xdd - Jd qd) - (I - J_G+ J) G^-1 n,   J_G+ = G^-1 J' (J G^-1 J')^-1.

The Global paper (after Nedungadi and Kazerouinian) prints a plus sign and no inverse of M, which is G for the kinetic
energy; n holds the gradient of k0 w (`problem/lagrangian.py`).
"""

from __future__ import annotations

import numpy as np
from scipy.integrate import DOP853

from pipeline.common.arrays import Array
from pipeline.model.kinematics import pseudoinverse
from pipeline.problem.lagrangian import Lagrangian
from pipeline.problem.problem import Problem

MOST_STEPS = 300


def initial_state(q: Array, qd: Array) -> Array:
    """(P, 2 n + 1): q, qd and the objective so far."""
    return np.hstack([q, qd, np.zeros((len(q), 1))])


def rate(problem: Problem, t: Array, state: Array) -> Array:
    """d/dt of the states (P, 2 n + 1) at times t (P,): the stationarity condition (see the module)."""
    task, n = problem.task, problem.task.arm.n
    q, qd = state[:, :n], state[:, n : 2 * n]
    lagrangian = Lagrangian(task, problem.objective)
    jacobian, metric = task.jacobian(q), lagrangian.metric(q)
    _, xd_ref, xdd_ref = problem.reference.sample(t)
    wanted = task.acceleration(q, qd, xd_ref, xdd_ref) - task.jacobian_rate_term(q, qd)
    bias, inverse = lagrangian.bias(q, qd), np.linalg.inv(metric)
    right = inverse @ np.swapaxes(jacobian, 1, 2)
    free = -(inverse @ bias[:, :, None])
    multiplier = np.linalg.solve(jacobian @ right, wanted[:, :, None] - jacobian @ free)
    qdd = (free + right @ multiplier)[:, :, 0]
    value = 0.5 * np.einsum("ki,kij,kj->k", qd, metric, qd) - lagrangian.gain(q)[0]
    return np.hstack([qd, qdd, value[:, None]])


def integrate(
    problem: Problem, state: Array, begin: float, end: float, tolerance: float, most_steps: int = MOST_STEPS
) -> Array:
    """The states (P, 2 n + 1) at `end`: Dormand-Prince 8(5,3) with a step of its own for every row, all rows in step.

    After each step q and qd are moved the least distance back onto the path. Rows that take too many steps become nan.
    """
    a, b, c = DOP853.A[:12, :12], DOP853.B, DOP853.C[:12]
    e3, e5 = DOP853.E3[:12], DOP853.E5[:12]
    y, t = state.copy(), np.full(len(state), begin)
    h = np.full(len(state), min(end - begin, 0.05 * problem.reference.duration))
    live = np.flatnonzero(np.isfinite(y).all(axis=1))
    for _ in range(most_steps):
        if not live.size:
            break
        step = np.minimum(h[live], end - t[live])[:, None]
        slopes = np.empty((12, len(live), y.shape[1]))
        for stage in range(12):
            inner = y[live] + step * np.tensordot(a[stage, :stage], slopes[:stage], axes=1)
            slopes[stage] = rate(problem, t[live] + c[stage] * step[:, 0], inner)
        ahead = y[live] + step * np.tensordot(b, slopes, axes=1)
        scale = tolerance * (1 + np.maximum(np.abs(y[live]), np.abs(ahead)))
        fifth = (np.tensordot(e5, slopes, axes=1) / scale) ** 2
        third = (np.tensordot(e3, slopes, axes=1) / scale) ** 2
        fifth, third = fifth.mean(axis=1), third.mean(axis=1)
        error = step[:, 0] * fifth / np.sqrt(np.maximum(fifth + 0.01 * third, 1e-300))
        good = error <= 1
        moved = live[good]
        y[moved], t[moved] = ahead[good], t[moved] + step[good, 0]
        if moved.size:
            y[moved] = _back_on_path(problem, t[moved], y[moved])
        h[live] = step[:, 0] * np.clip(0.9 * np.maximum(error, 1e-300) ** -0.125, 0.2, 6.0)
        live = live[(t[live] < end - 1e-14) & (h[live] > 1e-10)]
    y[t < end - 1e-12] = np.nan
    return y


def _back_on_path(problem: Problem, t: Array, state: Array) -> Array:
    n = problem.task.arm.n
    x_ref, xd_ref, _ = problem.reference.sample(t)
    error, jacobian = problem.task.error_and_jacobian(state[:, :n], x_ref)
    inverse = pseudoinverse(jacobian)
    xd = problem.task.velocity(state[:, :n], xd_ref)
    state[:, :n] -= (inverse @ error[:, :, None])[:, :, 0]
    state[:, n : 2 * n] += (inverse @ (xd[:, :, None] - jacobian @ state[:, n : 2 * n, None]))[:, :, 0]
    return state
