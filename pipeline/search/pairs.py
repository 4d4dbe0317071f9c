"""The cost of one interval between two cells, as a quadratic of the places in both; many pairs at once."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from pipeline.common.arrays import Array
from pipeline.search.cells import Cells, Index
from pipeline.search.quadratics import fitted

LONGEST_STEP = 2.5  # [rad] of a turning joint in one interval: longer ones are not covered
MARGIN = 2.0  # times what a fit misses where it is looked at
BEYOND = 0.1  # share of what a pair's step spans by which it may reach beyond what is seen of it
BLOCK = 4096  # pairs at a time: what stays in the processor's cache


@dataclass(frozen=True)
class Pairs:
    """cost (6, P): 1/2 d'G d/dt on the unit square (place in the first cell, in the second), within error (P,).

    possible (P,): not too fast everywhere.
    """

    cost: Array
    error: Array
    possible: NDArray[np.bool_]

    def take(self, rows: NDArray[np.bool_] | Index | slice) -> Pairs:
        return Pairs(self.cost[:, rows], self.error[rows], self.possible[rows])


@dataclass(frozen=True)
class Steps:
    """What a step may be: of every interval its duration dt (N,) [s], the limits (N, n) of its joint differences, and
    the prices (N, n) of those limits.

    A price, of the sign of the step that it holds, is a multiplier: a step d costs price d - |price| limit more, which
    is no cost for a step within its limit. So any prices leave a bound from below one; those of a motion that limits
    hold make it a good one near there.
    """

    dt: Array
    limit: Array
    price: Array


def pairs_of(cells: Cells, first: Index, second: Index, steps: Steps) -> Pairs:
    """Of the cells `first` (P,) and `second` (P,), which belong to neighbouring knots."""
    blocks = range(0, max(1, len(first)), BLOCK)
    parts = [_block(cells, first[k : k + BLOCK], second[k : k + BLOCK], steps) for k in blocks]
    return Pairs(
        np.concatenate([part.cost for part in parts], axis=1),
        np.concatenate([part.error for part in parts]),
        np.concatenate([part.possible for part in parts]),
    )


def _block(cells: Cells, first: Index, second: Index, steps: Steps) -> Pairs:
    a, b, root, interval = cells.q[first], cells.q[second], cells.root[second], cells.layer[first]
    turning = cells.curves.turning
    turns = np.where(turning, 2 * np.pi * np.rint((b[:, 2] - a[:, 2]) / (2 * np.pi)), 0.0)
    n = a.shape[2]
    moves = [(b[:, None, :, j] - turns[:, j, None, None]) - a[:, :, None, j] for j in range(n)]
    cost = np.zeros((len(a), 5, 5))
    for k in range(n):
        whitened = sum(moves[j] * root[:, None, :, j, k] for j in range(k, n))
        cost += whitened * whitened
    cost *= (0.5 / steps.dt[interval])[:, None, None]
    possible = np.ones(len(a), bool)
    for j, move in enumerate(moves):
        limit, price = steps.limit[interval, j], steps.price[interval, j]
        shortest = np.minimum(limit, LONGEST_STEP if turning[j] else np.inf)
        if np.isinf(shortest).all():
            continue
        least, most = move.min(axis=(1, 2)), move.max(axis=(1, 2))
        room = shortest + BEYOND * (most - least) + 1e-12
        possible &= (least <= room) & (most >= -room)
        held = np.flatnonzero((price != 0) & (np.maximum(np.sign(price) * least, np.sign(price) * most) > limit))
        if len(held):
            row, paid = held, price[held, None, None]
            cost[row] += paid * move[row] - np.abs(paid) * limit[row, None, None]
    coefficients, missed = fitted(cost.reshape(-1, 25))
    return Pairs(coefficients, MARGIN * missed, possible)
