"""A better start for IPOPT on small, well-scaled programs: a few quasi-Newton steps in dense numpy.

IPOPT's limited-memory Hessian starts from the identity and so do these steps, but one of them costs a third of an IPOPT
iteration, most of which is overhead on a program of a dozen unknowns. IPOPT takes over at the end and decides.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from pipeline.common.arrays import Array


def quasi_newton(
    cost: Callable[[Array], tuple[float, Array]],
    rows: Callable[[Array], tuple[Array, Array]],
    x: Array,
    *,
    tolerance: float,
    max_steps: int = 12,
) -> Array:
    """Improve x (k,) for min cost(x) subject to rows(x) = 0, both with derivatives, by SQP with damped BFGS updates.

    Returns the point with the smallest residual of the optimality conditions; never one worse than x.
    """
    k = len(x)
    (_, gradient), (gap, jacobian) = cost(x), rows(x)
    system = np.zeros((k + len(gap), k + len(gap)))  # of the optimality conditions
    hessian = system[:k, :k]
    np.fill_diagonal(hessian, 1.0)
    best, smallest = x, np.inf
    for _ in range(max_steps):
        system[:k, k:], system[k:, :k] = jacobian.T, jacobian
        try:
            answer = np.linalg.solve(system, -np.concatenate([gradient, gap]))
        except np.linalg.LinAlgError:
            break
        step, multipliers = answer[:k], answer[k:]
        lagrangian = gradient + jacobian.T @ multipliers
        residual = max(np.abs(lagrangian).max(), np.abs(gap).max())
        if residual < smallest:
            best, smallest = x, residual
        if residual < tolerance or not residual < 100 * smallest:
            break
        x = x + step
        (_, gradient), (gap, jacobian) = cost(x), rows(x)
        change = gradient + jacobian.T @ multipliers - lagrangian
        curved = hessian @ step
        along, have = float(step @ change), float(step @ curved)
        if along < 0.2 * have:  # Powell's damping keeps the approximation positive definite
            theta = 0.8 * have / (have - along)
            change = theta * change + (1 - theta) * curved
            along = float(step @ change)
        hessian += change[:, None] * (change / along) - curved[:, None] * (curved / have)
    return best
