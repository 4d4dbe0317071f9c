"""Which knots of a motion are unknown, and how what belongs to intervals is spread over them.

    fixed: q_1 .. q_N,    free: q_0 .. q_N,    cyclic: q_0 .. q_(N-1), and q_N is q_0, up to the full
    turns by which a start winds: its matrices are folded.

Each unknown knot owns the interval that ends at it: in a cycle q_0 owns the last one, with a free start it owns none.
Arrays have the starts first: motions (S, N + 1, n), unknowns and owned intervals (S, U, ...).
"""

from __future__ import annotations

import numpy as np

from pipeline.common.arrays import Array
from pipeline.problem.problem import Boundary


class Knots:
    """The unknown knots of motions on the grid `times` (N + 1,).

    dt (U,) [s]: the length of the interval that each owns; weight (U,) [s]: the same, but 0 where it owns none.
    """

    def __init__(self, boundary: Boundary, times: Array) -> None:
        self.fixed, self.cyclic = boundary is Boundary.FIXED, boundary is Boundary.CYCLIC
        dt = np.diff(times)
        self.times, self.first = times, 1 if self.fixed else 0
        self.weight = dt if self.fixed else np.concatenate([dt[-1:], dt[:-1]] if self.cyclic else [[0.0], dt])
        self.dt = np.where(self.weight > 0, self.weight, 1.0)
        self.count = len(self.dt)

    def unknown(self, motions: Array) -> Array:
        """x (S, U, n) of motions (S, N + 1, n)."""
        return motions[:, self.first : self.first + self.count].copy()

    def begin(self, motions: Array) -> Array:
        """What the unknowns leave open (S, 1, n) [rad]: the first knot, or the full turns by which a cycle winds."""
        if not self.cyclic:
            return motions[:, :1].copy()
        turns: Array = 2 * np.pi * np.rint((motions[:, -1:] - motions[:, :1]) / (2 * np.pi))
        return turns

    def whole(self, x: Array, begin: Array) -> Array:
        """Motions (S, N + 1, n) of the unknowns, with what they leave open."""
        if self.fixed:
            return np.concatenate([begin, x], axis=1)
        return np.concatenate([x, x[:, :1] + begin], axis=1) if self.cyclic else x

    def steps(self, x: Array, begin: Array) -> Array:
        """The displacement (S, U, n) over the interval that each knot owns."""
        first = begin if self.fixed else x[:, -1:] - begin if self.cyclic else x[:, :1]
        return x - np.concatenate([first, x[:, :-1]], axis=1)

    def spread(self, at_end: Array, at_begin: Array) -> Array:
        """The sum (S, U, ...) of parts of owned intervals at their ends and at their beginnings."""
        if self.cyclic:
            return at_end + np.roll(at_begin, -1, axis=1)
        total: Array = at_end.copy()
        total[:, :-1] += at_begin[:, 1:]
        return total

    def between(self, blocks: Array) -> Array:
        """Blocks (S, U, ...) of owned intervals' ends: couplings of knots k and k + 1 (in a cycle the last and 0)."""
        return np.roll(blocks, -1, axis=1) if self.cyclic else blocks[:, 1:]

    def product(self, diagonal: Array, off: Array, d: Array) -> Array:
        """H d (S, U, n) of a symmetric matrix with these diagonal and upper blocks."""
        out: Array = (diagonal @ d[..., None])[..., 0]
        pairs = off.shape[1]
        out[:, :pairs] += (off @ np.roll(d, -1, axis=1)[:, :pairs, :, None])[..., 0]
        back = (off.swapaxes(-1, -2) @ d[:, :pairs, :, None])[..., 0]
        if self.cyclic:
            return out + np.roll(back, 1, axis=1)
        out[:, 1:] += back
        return out

    def reduce(self, Z: Array, diagonal: Array, off: Array) -> tuple[Array, Array]:
        """Z'HZ by blocks, for bases Z (S, U, n, r)."""
        transposed, pairs = Z.swapaxes(-1, -2), off.shape[1]
        return transposed @ diagonal @ Z, transposed[:, :pairs] @ off @ np.roll(Z, -1, axis=1)[:, :pairs]
