"""Secondary criteria w(q), to be maximised along a motion: how far an arm is from singularities and joint limits.

Pontryagin report Section 6: eq. (14), the manipulability measure, and eq. (15), the distance from the joint limits,
whose sum lacks the square that gives it its meaning (and the report its numbers). Gradients are exact.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from pipeline.common.arrays import Array
from pipeline.model.task import Task

CRITERIA = ("manipulability", "joint_centering")


@dataclass(frozen=True)
class Secondary:
    """k0 times the sum of `criteria`; lower, upper (n,) [rad or m] are the ranges that joints are centred in.

    Joints whose range is not finite have no centre and do not count in eq. (15)'s sum (its 1/(2 n) keeps all n).
    """

    criteria: tuple[str, ...]
    k0: float
    lower: Array
    upper: Array

    def gain(self, task: Task, q: Array) -> tuple[Array, Array]:
        """k0 w (K,) and its gradient (K, n) at q (K, n)."""
        value, gradient = np.zeros(len(q)), np.zeros_like(q)
        for criterion in self.criteria:
            if criterion == "manipulability":
                one, by_q = manipulability(task, q)
            else:
                one, by_q = joint_centering(q, self.lower, self.upper)
            value, gradient = value + self.k0 * one, gradient + self.k0 * by_q
        return value, gradient


def manipulability(task: Task, q: Array) -> tuple[Array, Array]:
    """w = sqrt(det(J J')) (K,), the product of J's singular values (eq. (14); Yoshikawa 1985), and dw/dq (K, n).

    d sigma_i = u_i' dJ v_i, and no singular value is divided by: the gradient is finite at a singularity too.
    """
    jacobian, gradient = task.jacobian_and_gradient(q)
    u, sigma, vt = np.linalg.svd(jacobian, full_matrices=False)
    m = sigma.shape[1]
    others = np.stack([np.prod(np.delete(sigma, i, axis=1), axis=1) for i in range(m)], axis=1)
    by_jacobian = (u * others[:, None, :]) @ vt  # (K, m, n)
    return np.prod(sigma, axis=1), np.einsum("kij,kijl->kl", by_jacobian, gradient)


def joint_centering(q: Array, lower: Array, upper: Array) -> tuple[Array, Array]:
    """w = -1/(2 n) sum ((q_i - qbar_i) / (q_iM - q_im))^2 (K,) and dw/dq (K, n): eq. (15) with its square."""
    ranged = np.isfinite(upper - lower)
    low, high = np.where(ranged, lower, 0.0), np.where(ranged, upper, 0.0)
    middle, span = (low + high) / 2, np.where(ranged, high - low, np.inf)
    offset = (q - middle) / span
    n = q.shape[1]
    return -(offset**2).sum(axis=1) / (2 * n), -offset / (n * span)
