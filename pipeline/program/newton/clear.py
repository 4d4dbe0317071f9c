"""Clearance rows: at every knot 1 - p(q) >= 0, p Drake's smooth penalty of the closest pairs (`model/clearance.py`)."""

from __future__ import annotations

import numpy as np

from pipeline.common.arrays import Array
from pipeline.model import clearance
from pipeline.program.newton.knots import Blocks
from pipeline.program.newton.stencils import By


class Clear:
    """One row for each knot and margin: that from obstacles, that of the arm from itself."""

    reach, penalty, kinks = 0, 1e3, True

    def __init__(self, rows: list[clearance.Rows]) -> None:
        self.rows, self.count = rows, len(rows)

    def values(self, x: Array, begin: Array) -> tuple[Array, Array]:
        return np.zeros(len(x)), self.differentiate(x, begin)[3]

    def differentiate(self, x: Array, begin: Array) -> tuple[Array, Array, Blocks, Array, By]:
        flat = x.reshape(-1, x.shape[-1])
        values, slopes = zip(*(row(flat) for row in self.rows), strict=True)
        kept = clearance.Rows.UPPER - np.stack(values, axis=-1)
        by_q = -np.stack(slopes, axis=1).reshape(*x.shape[:2], self.count, -1)
        return np.zeros(len(x)), np.zeros(()), (), kept.reshape(*x.shape[:2], self.count), (by_q,)

    def curvature(self, x: Array, begin: Array, z: Array, scale: Array) -> Blocks:
        """Left out: by differences of the gradient it costs more than the iterations that it saves."""
        return ()
