"""All that must not be negative: limits of positions and steps (`bounds.py`), and rows of other kinds (`motion.Rows`).

Slacks and multipliers (S, L) have the former first, behind them the latter's (S, U, R), flat.
"""

from __future__ import annotations

import numpy as np

from pipeline.common.arrays import Array
from pipeline.program.newton import stencils
from pipeline.program.newton.bounds import Bounds
from pipeline.program.newton.knots import Blocks
from pipeline.program.newton.stencils import By

PENALTY = 1e3  # of positions and steps


class Inequalities:
    """`bounds`, and `rows` more at each knot, of order one.

    penalty (L,): of an excess [rad or 1] in units of the start's cost; multipliers of what can be kept are smaller.
    """

    def __init__(self, bounds: Bounds, rows: int, penalty: float) -> None:
        self.bounds, self.knots, self.rows, self.own = bounds, bounds.knots, rows, len(bounds.offset)
        self.penalty = np.concatenate([np.full(self.own, PENALTY), np.full(rows * self.knots.count, penalty)])
        self.width = np.concatenate([bounds.width, np.ones(rows * self.knots.count)])

    def __bool__(self) -> bool:
        return len(self.width) > 0

    def values(self, x: Array, begin: Array, kept: Array) -> Array:
        """c (S, L)."""
        return np.concatenate([self.bounds.values(x, begin), kept.reshape(len(x), -1)], axis=1)

    def change(self, by: By, d: Array) -> Array:
        """C d (S, L)."""
        linear = self.bounds.change(d)
        if not self.rows:
            return linear
        return np.concatenate([linear, stencils.change(self.knots, by, d).reshape(len(d), -1)], axis=1)

    def pull(self, by: By, z: Array) -> Array:
        """C'z (S, U, n)."""
        linear = self.bounds.pull(z[:, : self.own])
        return linear + stencils.pull(self.knots, by, self.of_rows(z)) if self.rows else linear

    def add(self, by: By, sigma: Array, *matrices: Blocks) -> None:
        """Add C' diag(sigma) C to matrices."""
        joint = np.arange(self.bounds.n)
        linear = self.bounds.weigh(sigma[:, : self.own])
        full = stencils.weigh(self.knots, by, self.of_rows(sigma)) if self.rows else ()
        for blocks in matrices:
            for block, entries in zip(blocks, linear, strict=False):
                block[..., joint, joint] += entries
            for block, more in zip(blocks, full, strict=False):
                block += more

    def of_rows(self, values: Array) -> Array:
        """Those (S, U, R) of the rows."""
        return values[:, self.own :].reshape(len(values), self.knots.count, self.rows)
