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

Blocks = tuple[Array, ...]  # of a symmetric matrix: (S, U, n, n) on its diagonal, and those 1, 2, .. above it


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

    def before(self, values: Array, places: int) -> Array:
        """Of every knot what stands so many places before it; zero where that is before the first unknown."""
        if self.cyclic:
            return np.roll(values, places, axis=1)
        out = np.zeros_like(values)
        out[:, places:] = values[:, : values.shape[1] - places]
        return out

    def after(self, values: Array, places: int) -> Array:
        """The transpose of `before`: what belongs to the knot so many places after."""
        if self.cyclic:
            return np.roll(values, -places, axis=1)
        if not places:
            return values
        out = np.zeros_like(values)
        out[:, : values.shape[1] - places] = values[:, places:]
        return out

    def pairs(self, blocks: Array, places: int, apart: int) -> Array:
        """Couplings of knots k and k + apart (S, pairs, ...), in a cycle round its end: of owners `places` after k."""
        return self.after(blocks, places)[:, : self.pairs_of(apart)]

    def pairs_of(self, apart: int) -> int:
        """How many knots have one that is so far on."""
        return self.count if self.cyclic else max(self.count - apart, 0)

    def spread(self, at_end: Array, at_begin: Array) -> Array:
        """The sum (S, U, ...) of parts of owned intervals at their ends and at their beginnings."""
        return np.asarray(at_end + self.after(at_begin, 1))

    def between(self, blocks: Array) -> Array:
        """Blocks (S, U, ...) of owned intervals: couplings of the knots k and k + 1."""
        return self.pairs(blocks, 1, 1)

    def product(self, blocks: Blocks, d: Array) -> Array:
        """H d (S, U, n) of a symmetric matrix: its blocks on the diagonal, and those 1, 2, .. above."""
        out: Array = (blocks[0] @ d[..., None])[..., 0]
        for apart, off in enumerate(blocks[1:], 1):
            pairs = off.shape[1]
            out[:, :pairs] += (off @ np.roll(d, -apart, axis=1)[:, :pairs, :, None])[..., 0]
            back = (off.swapaxes(-1, -2) @ d[:, :pairs, :, None])[..., 0]
            if self.cyclic:
                out += np.roll(back, apart, axis=1)
            else:
                out[:, apart:] += back
        return out

    def reduce(self, Z: Array, blocks: Blocks) -> Blocks:
        """Z'HZ by blocks, for bases Z (S, U, n, r)."""
        transposed = Z.swapaxes(-1, -2)
        apart = [
            transposed[:, : off.shape[1]] @ off @ np.roll(Z, -j, axis=1)[:, : off.shape[1]]
            for j, off in enumerate(blocks[1:], 1)
        ]
        return (transposed @ blocks[0] @ Z, *apart)
