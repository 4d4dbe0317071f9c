"""Rows that belong to intervals: functions of the unknown at which an interval ends and of those just before.

`by` are their derivatives (S, U, R, n) by x_k, x_(k-1), ...: knot k owns R rows. What lies before the first unknown is
given: nothing is differentiated by it.
"""

from __future__ import annotations

import numpy as np

from pipeline.common.arrays import Array
from pipeline.program.newton.knots import Knots

By = tuple[Array, ...]


def change(knots: Knots, by: By, d: Array) -> Array:
    """By how much the rows change (S, U, R) with d (S, U, n)."""
    return np.asarray(sum((g @ knots.before(d, s)[..., None])[..., 0] for s, g in enumerate(by)))


def pull(knots: Knots, by: By, z: Array) -> Array:
    """The gradient (S, U, n) of the sum of z (S, U, R) times the rows."""
    return np.asarray(sum(knots.after((z[:, :, None] @ g)[:, :, 0], s) for s, g in enumerate(by)))


def dense(knots: Knots, by: By) -> Array:
    """The rows (S, U R, U n), all of them."""
    starts, count, rows, n = by[0].shape
    out, knot = np.zeros((starts, count, rows, count, n)), np.arange(count)
    for s, g in enumerate(by):
        own = knot if knots.cyclic else knot[s:]
        out[:, own, :, own - s] = g[:, own].swapaxes(0, 1)
    return out.reshape(starts, count * rows, count * n)


def weigh(knots: Knots, by: By, sigma: Array) -> tuple[Array, ...]:
    """The sum of sigma (S, U, R) times the outer squares of the rows' gradients, as blocks (`gather`)."""
    weighted = [g.swapaxes(-1, -2) * sigma[:, :, None] for g in by]
    return gather(knots, {(s, t): weighted[s] @ by[t] for s in range(len(by)) for t in range(s + 1)}, len(by))


def gather(knots: Knots, parts: dict[tuple[int, int], Array], count: int) -> tuple[Array, ...]:
    """The blocks of a symmetric matrix on its diagonal (S, U, n, n) and at distances 1, .. count - 1 from it.

    parts[s, t] (S, U, n, n), t <= s: what each interval adds between the unknowns s and t places before its own.
    """
    own = sum(knots.after(parts[s, s], s) for s in range(count))
    apart = [sum(knots.pairs(parts[t + j, t], t + j, j) for t in range(count - j)) for j in range(1, count)]
    return tuple(map(np.asarray, (own, *apart)))
