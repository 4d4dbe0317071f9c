"""The momentum of a system that floats: rows c = 0 of every interval that tie a knot to the one before.

Linear momentum by how far the centre of mass moves, angular momentum in the middle (`Floating.mean_momentum_residual`):

    m (c(q_k) - c(q_(k-1))) / dt = p,        M_a(q) qd = p_a  at q = (q_k + q_(k-1)) / 2,  qd = (q_k - q_(k-1)) / dt,

M_a being the rows of the base's angles. With P(q, v) = d(M v)/dq the second derivatives of nu'm c are P(q, nu), and
since T is a quadratic form those of nu'M qd are half the differences of T's at qd + nu and at qd - nu. Those of p_a,
where a momentum is given, are left out.
"""

from __future__ import annotations

from typing import Protocol

import numpy as np

from pipeline.common.arrays import Array
from pipeline.model.arm import Arm
from pipeline.model.kernel.chain import Chain
from pipeline.model.kernel.energy import energy
from pipeline.model.kernel.system import KernelSystem
from pipeline.program.newton import stencils
from pipeline.program.newton.knots import Blocks, Knots
from pipeline.program.newton.stencils import By


class Ties(Protocol):
    """Equalities c(x) = 0, `count` (T) for each knot."""

    count: int

    def values(self, x: Array, begin: Array) -> Array:
        """c (S, U, T)."""

    def differentiate(self, x: Array, begin: Array) -> tuple[Array, By]:
        """c and its derivatives (`stencils.py`)."""

    def curvature(self, x: Array, begin: Array, nu: Array) -> Blocks:
        """Blocks of the second derivatives of the sum of nu (S, U, T) times c."""


class Loose:
    """No such rows."""

    count = 0

    def values(self, x: Array, begin: Array) -> Array:
        return np.empty((*x.shape[:2], 0))

    def differentiate(self, x: Array, begin: Array) -> tuple[Array, By]:
        return self.values(x, begin), ()

    def curvature(self, x: Array, begin: Array, nu: Array) -> Blocks:
        return ()


LOOSE = Loose()


class Momentum:
    """Of motions from a start that is given."""

    def __init__(self, arm: Arm, chain: Chain, knots: Knots) -> None:
        self.chain, self.knots, self.base, self.system = chain, knots, arm.base, KernelSystem(arm, chain)
        self.count = arm.base.count
        self.linear, self.angular = slice(arm.base.angles.start), arm.base.angles

    def values(self, x: Array, begin: Array) -> Array:
        return self.differentiate(x, begin)[0]

    def differentiate(self, x: Array, begin: Array) -> tuple[Array, By]:
        S, U, n = x.shape
        _, before, qd = self._motion(x, begin)
        dt = np.tile(self.knots.dt, S)
        value, by_before, by_qd = self.base.mean_momentum_residual(self.system, before, qd, dt)
        by_qd = by_qd / dt[:, None, None]
        by = (by_qd, by_before - by_qd)
        return value.reshape(S, U, -1), tuple(part.reshape(S, U, -1, n) for part in by)

    def curvature(self, x: Array, begin: Array, nu: Array) -> Blocks:
        S, U, n = x.shape
        q, before, qd = self._motion(x, begin)
        along, about = np.zeros_like(q), np.zeros_like(q)
        along[:, self.linear] = nu.reshape(S * U, -1)[:, self.linear]
        about[:, self.angular] = nu.reshape(S * U, -1)[:, self.angular]
        ahead, behind = (energy(self.chain, (q + before) / 2, qd + sign * about) for sign in (1, -1))
        qq, dq = (ahead.by_q_q - behind.by_q_q) / 8, (ahead.mixed - behind.mixed) / 4
        step = np.tile(self.knots.dt, S)[:, None, None]
        dq = dq / step
        turned, own = dq.swapaxes(1, 2), [energy(self.chain, at, along).mixed / step for at in (q, before)]
        parts = {(0, 0): qq + dq + turned + own[0], (1, 0): qq - dq + turned, (1, 1): qq - dq - turned - own[1]}
        return stencils.gather(self.knots, {key: part.reshape(S, U, n, n) for key, part in parts.items()}, 2)

    def _motion(self, x: Array, begin: Array) -> tuple[Array, Array, Array]:
        """q_k, q_(k-1) and the velocity between them (S U, n)."""
        n, step = x.shape[-1], self.knots.steps(x, begin)
        return x.reshape(-1, n), (x - step).reshape(-1, n), (step / self.knots.dt[:, None]).reshape(-1, n)
