"""Symmetric block-banded systems, also cyclic ones, by LAPACK's banded Cholesky; one small system per start."""

from __future__ import annotations

import numpy as np
from scipy.linalg.lapack import dpbsv

from pipeline.common.arrays import Array
from pipeline.program.newton.knots import Blocks

FADING = (0.7, 0.4, 0.2, 0.0)  # how much of an indefinite matrix is kept beside a positive one


class Banded:
    """`count` blocks of size x size, each coupled to the `reach` next ones, in LAPACK's upper band storage.

    A cycle is folded: in the order 0, 1, U-1, 2, U-2, ... those `reach` apart stay within twice as many places.
    """

    def __init__(self, count: int, size: int, cyclic: bool, reach: int = 1) -> None:
        order = np.arange(count)
        if cyclic:
            order[1::2] = np.arange(1, 1 + len(order[1::2]))
            order[2::2] = count - np.arange(1, 1 + len(order[2::2]))
        place = np.empty(count, dtype=int)
        place[order] = np.arange(count)
        self.length = count * size
        self.above = min((1 + (2 * reach if cyclic else reach)) * size, self.length) - 1
        self.place = (place[:, None] * size + np.arange(size)).ravel()
        row, column = np.triu_indices(size)
        self.triangle = row, column
        self._diagonal = self._position(place[:, None] * size + row, place[:, None] * size + column)
        self._off = [self._above(place, size, apart, cyclic) for apart in range(1, reach + 1)]

    def _above(self, place: Array, size: int, apart: int, cyclic: bool) -> Array:
        count = len(place)
        one = np.arange(count if cyclic else max(count - apart, 0))
        rows = place[one, None] * size + np.repeat(np.arange(size), size)
        columns = place[(one + apart) % count, None] * size + np.tile(np.arange(size), size)
        return self._position(np.minimum(rows, columns), np.maximum(rows, columns))

    def _position(self, row: Array, column: Array) -> Array:
        return column * (self.above + 1) + self.above + row - column

    def assemble(self, blocks: Blocks) -> Array:
        """(S, U size, above + 1): every start's matrix, transposed as LAPACK wants it."""
        diagonal = blocks[0]
        out = np.zeros((len(diagonal), self.length * (self.above + 1)))
        out[:, self._diagonal] = diagonal[:, :, self.triangle[0], self.triangle[1]]
        for place, off in zip(self._off, blocks[1:], strict=False):
            out[:, place] = off.reshape(*off.shape[:2], -1)
        return out.reshape(len(diagonal), self.length, self.above + 1)

    def solve(self, matrices: Array, positive: Array, right: Array) -> tuple[Array, int]:
        """x (S, U, size) with H x = right for each start, and for how many H had to be replaced.

        Where H is not positive definite it fades into `positive`, a matrix that is, until its Cholesky factors exist.
        """
        flat, x = np.empty((len(right), self.length)), np.zeros((len(right), self.length))
        flat[:, self.place] = right.reshape(len(right), -1)
        changed = 0
        for s, matrix in enumerate(matrices):
            _, x[s], info = dpbsv(matrix.T, flat[s])
            changed += bool(info)
            for share in FADING if info else ():
                _, x[s], info = dpbsv((share * matrix + (1 - share) * positive[s]).T, flat[s])
                if not info:
                    break
        return x[:, self.place].reshape(right.shape), changed
