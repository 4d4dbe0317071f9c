"""Convex quadratic programs of some dozen unknowns: min 1/2 w'Hw + g'w with c + C w >= 0, by a primal-dual interior
point with Mehrotra's corrector (Nocedal and Wright 2006, Algorithm 16.4), in dense numpy.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.linalg.lapack import dpotrf, dpotrs

from pipeline.common.arrays import Array

MOST = 40
GAP = 1e-11  # mean of slack times multiplier
FLOOR = 1e-6  # where slacks and multipliers begin at least
TOWARDS = 0.995


@dataclass(frozen=True)
class Quadratic:
    """hessian (k, k), positive definite, gradient (k,), rows (L, k), values (L,)."""

    hessian: Array
    gradient: Array
    rows: Array
    values: Array


def minimise(program: Quadratic, multipliers: Array) -> tuple[Array, Array] | None:
    """w (k,) and the rows' multipliers (L,), started at those given; None where no w keeps all rows."""
    g, c = program.gradient, program.values
    w = np.zeros(len(g))
    if not len(c):
        factor, info = dpotrf(program.hessian)
        return None if info else (-dpotrs(factor, g)[0], multipliers)
    s, z = np.maximum(c, FLOOR), np.maximum(multipliers, FLOOR)
    with np.errstate(all="ignore"):  # where rows contradict each other the multipliers run away
        return _minimise(program, w, s, z)


def _minimise(program: Quadratic, w: Array, s: Array, z: Array) -> tuple[Array, Array] | None:
    H, g, C, c = program.hessian, program.gradient, program.rows, program.values
    size = max(1.0, float(np.abs(g).max()))
    for _ in range(MOST):
        dual, primal = H @ w + g - z @ C, c + C @ w - s
        mu = float(s @ z) / len(s)
        if mu < GAP and np.abs(primal).max() < GAP and np.abs(dual).max() < 1e-8 * size:
            return w, z
        ratio = z / s
        factor, info = dpotrf(H + C.T @ (ratio[:, None] * C))
        if info:
            return None

        def towards(target: Array) -> tuple[Array, Array, Array]:
            """The step for s z = target, to first order."""
            push = target / s - z - ratio * primal  # noqa: B023 - called within this pass
            dw = dpotrs(factor, push @ C - dual)[0]  # noqa: B023
            ds = C @ dw + primal  # noqa: B023
            return dw, ds, target / s - z - ratio * ds  # noqa: B023

        _, ds, dz = towards(np.zeros(len(s)))
        reach, dual_reach = _fraction(s, ds), _fraction(z, dz)
        after = float((s + reach * ds) @ (z + dual_reach * dz)) / len(s)
        dw, ds, dz = towards((after / mu) ** 3 * mu - ds * dz)
        reach, dual_reach = _fraction(s, ds), _fraction(z, dz)
        if not np.isfinite(dw).all():
            return None
        w, s, z = w + reach * dw, s + reach * ds, z + dual_reach * dz
    return None


def _fraction(values: Array, change: Array) -> float:
    """The longest step, at most one, that leaves all values positive."""
    least = float((change / values).min())
    return min(1.0, TOWARDS / -least) if least < 0 else 1.0
