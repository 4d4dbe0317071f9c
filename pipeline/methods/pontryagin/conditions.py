"""Necessary conditions of Pontryagin's maximum principle for qd = J_G+ xd + (I - J_G+ J) u and L = 1/2 qd' G qd - k0 w.

With the Hamiltonian H = -L + lambda' qd (report eq. (7)) and lambda = G qd + J' mu, the control that maximises it gives

    qd = J_G+ xd + (I - J_G+ J) G^-1 lambda,        J_G+ = G^-1 J' (J G^-1 J')^-1,
    lambdad = -dH/dq = dL/dq + Jd' mu,               mu = J_G+' (lambda - G qd).

These are the report's eqs (20) and (17) for G = 2 I, but for the sign of k0 w: J f = xd for every q turns
(df/dq)' J' mu into -Jd' mu, so that no pseudoinverse is differentiated. mu is free: what it adds to lambda, J' mu,
never reaches qd. A solution is told by t' lambda, its projection on the null space, t tangent to the self-motion.
"""

from __future__ import annotations

import numpy as np

from pipeline.common.arrays import Array
from pipeline.methods.method import Serves
from pipeline.model.kinematics import weighted_pseudoinverse
from pipeline.problem.lagrangian import Lagrangian
from pipeline.problem.problem import Boundary

SERVES = Serves(
    order=1,
    boundaries=frozenset((Boundary.FIXED, Boundary.FREE)),
    constraints=False,
    orientation=False,
    moving_base=False,
    rest=False,
)


def rates(lagrangian: Lagrangian, xd: Array, q: Array, costate: Array) -> tuple[Array, Array]:
    """qd and lambdad (K, n) at q, lambda (K, n) where the path asks for xd (K, m)."""
    task = lagrangian.task
    jacobian, gradient = task.jacobian_and_gradient(q)
    metric = lagrangian.metric(q)
    inverse = np.linalg.inv(metric)
    right = weighted_pseudoinverse(jacobian, inverse)
    free = _times(inverse, costate)
    qd = free + _times(right, xd - _times(jacobian, free))
    multiplier = _times(right.swapaxes(1, 2), costate - _times(metric, qd))
    by_q = lagrangian.quadratic_gradient(q, qd)[1] - lagrangian.gain(q)[1]
    return qd, by_q + np.einsum("kijl,kl,ki->kj", gradient, qd, multiplier)


def costates(lagrangian: Lagrangian, times: Array, q: Array, qd: Array) -> Array:
    """lambda (K, n) along a motion that is nearly an extremal, with lambda = 0 at its end but for the null space."""
    task = lagrangian.task
    jacobian, metric = task.jacobian(q), lagrangian.metric(q)
    left = weighted_pseudoinverse(jacobian, np.linalg.inv(metric)).swapaxes(1, 2)
    momentum = _times(metric, qd)
    by_q = lagrangian.quadratic_gradient(q, qd)[1] - lagrangian.gain(q)[1]
    rate = _times(left, by_q - np.gradient(momentum, times, axis=0))
    middle = (rate[1:] + rate[:-1]) / 2 * np.diff(times)[:, None]
    multiplier = np.vstack([-middle[::-1].cumsum(axis=0)[::-1], np.zeros((1, task.m))]) - _times(left, momentum)[-1]
    return momentum + _times(jacobian.swapaxes(1, 2), multiplier)


def null_space(jacobian: Array) -> Array:
    """An orthonormal basis Z (K, n, r) of the null spaces of J (K, m, n)."""
    return np.linalg.svd(jacobian)[2][:, jacobian.shape[1] :].swapaxes(1, 2)


def transversality(lagrangian: Lagrangian, q: Array, costate: Array) -> float:
    """|(I - J+ J) lambda| at an end, q, lambda (n,): zero if q is free on its self-motion manifold (report, (12))."""
    basis = null_space(lagrangian.task.jacobian(q[None]))[0]
    return float(np.linalg.norm(basis.T @ costate))


def _times(matrix: Array, vector: Array) -> Array:
    return np.asarray((matrix @ vector[:, :, None])[:, :, 0])
