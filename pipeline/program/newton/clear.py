"""Clearance rows: at every knot 1 - p(q) >= 0, p Drake's smooth penalty of the closest pairs (`model/clearance.py`)."""

from __future__ import annotations

import numpy as np

from pipeline.common.arrays import Array
from pipeline.model import clearance
from pipeline.program.newton.knots import Blocks
from pipeline.program.newton.stencils import By


class Clear:
    """One row for each knot."""

    count, reach, penalty = 1, 0, 1e3

    def __init__(self, rows: clearance.Rows) -> None:
        self.rows = rows

    def values(self, x: Array, begin: Array) -> tuple[Array, Array]:
        return np.zeros(len(x)), self.differentiate(x, begin)[3]

    def differentiate(self, x: Array, begin: Array) -> tuple[Array, Array, Blocks, Array, By]:
        value, by_q = self.rows(x.reshape(-1, x.shape[-1]))
        kept = (self.rows.UPPER - value).reshape(*x.shape[:2], 1)
        return np.zeros(len(x)), np.zeros(()), (), kept, (-by_q.reshape(*x.shape[:2], 1, -1),)

    def curvature(self, x: Array, begin: Array, z: Array, scale: Array) -> Blocks:
        """Left out: by differences of the gradient it costs more than the iterations that it saves."""
        return ()
