"""Clearance rows: at every knot 1 - p(q) >= 0, p Drake's smooth penalty of the closest pairs (`model/clearance.py`)."""

from __future__ import annotations

from pipeline.common.arrays import Array
from pipeline.model import clearance
from pipeline.program.newton.knots import Blocks
from pipeline.program.newton.stencils import By


class Clear:
    """One row for each knot."""

    count, reach = 1, 0

    def __init__(self, penalty: clearance.Rows) -> None:
        self.penalty = penalty

    def values(self, x: Array, begin: Array) -> Array:
        return self.differentiate(x, begin)[0]

    def differentiate(self, x: Array, begin: Array) -> tuple[Array, By]:
        value, by_q = self.penalty(x.reshape(-1, x.shape[-1]))
        return (self.penalty.UPPER - value).reshape(*x.shape[:2], 1), (-by_q.reshape(*x.shape[:2], 1, -1),)

    def curvature(self, x: Array, begin: Array, z: Array) -> Blocks:
        """Left out: by differences of the gradient it costs more than the iterations that it saves."""
        return ()
