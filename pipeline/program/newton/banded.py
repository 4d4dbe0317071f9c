"""Symmetric block-banded systems, also cyclic ones, by LAPACK's banded Cholesky; one small system per start."""

from __future__ import annotations

import numpy as np
from scipy.linalg.lapack import dpbsv, dposv

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
            out[:, place] = off.reshape(*off.shape[:2], place.shape[-1])
        return out.reshape(len(diagonal), self.length, self.above + 1)

    def solve(
        self, matrices: Array, positive: Array, right: Array, rows: Array | None = None, target: Array | None = None
    ) -> tuple[Array, Array, int]:
        """x (S, U, size) and nu (S, T) with H x + G'nu = right and G x = target for each start, and for how many H had
        to be replaced; rows G (S, T, U size) may be none.

        Where H is not positive definite it fades into `positive`, a matrix that is, until its Cholesky factors exist.
        """
        count = len(right)
        rows = np.empty((count, 0, self.length)) if rows is None else rows
        ties = rows.shape[1]
        flat, x = np.empty((count, self.length, 1 + ties)), np.zeros((count, self.length))
        flat[:, self.place, 0] = right.reshape(count, -1)
        flat[:, self.place, 1:] = rows.swapaxes(1, 2)
        nu, changed = np.zeros((count, ties)), 0
        for s, matrix in enumerate(matrices):
            _, solved, info = dpbsv(matrix.T, flat[s])
            changed += bool(info)
            for share in FADING if info else ():
                _, solved, info = dpbsv((share * matrix + (1 - share) * positive[s]).T, flat[s])
                if not info:
                    break
            if ties and target is not None:
                against = flat[s, :, 1:].T @ solved
                nu[s] = _least(against[:, 1:], against[:, 0] - target[s])
            x[s] = solved[:, 0] - solved[:, 1:] @ nu[s]
        return x[:, self.place].reshape(right.shape), nu, changed


def _least(matrix: Array, right: Array) -> Array:
    """The solution of a symmetric positive system; not a number where it is none."""
    _, solution, info = dposv(matrix, right)
    return np.asarray(solution) if not info else np.full(len(right), np.nan)
