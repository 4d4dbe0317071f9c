"""Limits of positions and velocities as one-sided rows c(x) >= 0, with what an interior point needs of them."""

from __future__ import annotations

import numpy as np

from pipeline.common.arrays import Array
from pipeline.problem.limits import Limits
from pipeline.program.newton.knots import Blocks, Knots


class Bounds:
    """L rows: q_ij - lower_j, upper_j - q_ij at the unknown knots, and dt_i V_j -+ (q_ij - q_(i-1)j); if finite."""

    def __init__(self, knots: Knots, limits: Limits) -> None:
        self.knots, self.n = knots, len(limits.lower)
        step = np.where(knots.weight > 0, knots.dt, np.inf)[:, None] * limits.velocity
        low = np.concatenate([np.tile(limits.lower, (knots.count, 1)), -step]).ravel()
        high = np.concatenate([np.tile(limits.upper, (knots.count, 1)), step]).ravel()
        self.low, self.high = np.flatnonzero(np.isfinite(low)), np.flatnonzero(np.isfinite(high))
        self.offset = np.concatenate([low[self.low], -high[self.high]])
        both = np.isfinite(low) & np.isfinite(high)
        width = np.ones(len(low))
        width[both] = (high - low)[both]
        self.width = np.concatenate([width[self.low], width[self.high]])

    def __bool__(self) -> bool:
        return len(self.offset) > 0

    def values(self, x: Array, begin: Array) -> Array:
        """c (S, L)."""
        return self._rows(x, self.knots.steps(x, begin)) - self.offset

    def change(self, d: Array) -> Array:
        """C d (S, L)."""
        return self._rows(d, self.knots.steps(d, np.zeros_like(d[:, :1])))

    def pull(self, z: Array) -> Array:
        """C'z (S, U, n)."""
        position, step = self._columns(z, -1.0)
        return position + self.knots.spread(step, -step)

    def weigh(self, sigma: Array) -> Blocks:
        """C' diag(sigma) C: diagonal entries of the blocks on (S, U, n) and above (S, pairs, n) the diagonal."""
        position, step = self._columns(sigma, 1.0)
        return position + self.knots.spread(step, step), -self.knots.between(step)

    def _rows(self, x: Array, steps: Array) -> Array:
        flat = np.concatenate([x, steps], axis=1).reshape(len(x), -1)
        return np.concatenate([flat[:, self.low], -flat[:, self.high]], axis=1)

    def _columns(self, values: Array, sign: float) -> tuple[Array, Array]:
        count = self.knots.count
        out = np.zeros((len(values), 2 * count * self.n))
        out[:, self.low] = values[:, : len(self.low)]
        out[:, self.high] += sign * values[:, len(self.low) :]
        both = out.reshape(len(values), 2 * count, self.n)
        return both[:, :count], both[:, count:]
