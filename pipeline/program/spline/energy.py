"""The energy of a spline program: velocities w = S qd at the stations of its sum, and 1/2 qd' G qd of them.

Midway between two knots lies q_m = (q0 + q1)/2 + h/8 (v0 - v1), with qd_m = (v0 + v1)/2 + h/8 (a0 - a1). The one is put
into the objective, the other is an unknown: that is what makes the objective's Hessian nearly the identity.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
import scipy.sparse as sp

from pipeline.common.arrays import Array
from pipeline.program.program import Block, blocks
from pipeline.program.scaling import POSITION_SCALE
from pipeline.program.spline.program import Spline
from pipeline.program.spline.rows import pairs
from pipeline.program.terms.energy import add_sum, weighted_sum

INTERVALS_PER_BINDING = 5  # each has the positions and velocities of both its ends


def velocities(program: Spline) -> None:
    """S qd_m = w, and at the knots, where they count, S v = w."""
    if not program.counts:
        return
    h, half = program.dt, 0.5 * np.ones(program.intervals)
    first = len(program.w) - program.intervals
    _velocities(program, slice(first, None), [(pairs(half, half, h), program.v), (pairs(h / 8, -h / 8, h), program.a)])
    if first:
        _velocities(program, slice(0, first), [(sp.eye_array(first), program.v)])


def _velocities(program: Spline, which: slice, parts: list[tuple[Any, Any]]) -> None:
    """to_velocity w = what the parts say, each station's rows divided by their size."""
    rates = program.scaling.to_velocity[which]
    size = np.abs(rates).max(axis=(1, 2))
    columns = [sp.block_diag(list(-rates / size[:, None, None]))]
    unknowns = [program.w[which].ravel()]
    for form, own in parts:
        columns.append(sp.kron(sp.diags_array(1 / size) @ form / program.unit(own), sp.eye_array(program.n)))
        unknowns.append(own.ravel())
    rows = sp.csc_matrix(sp.hstack(columns))
    program.drake.AddLinearEqualityConstraint(rows, np.zeros(rows.shape[0]), np.concatenate(unknowns))


def quadratic(program: Spline) -> None:
    """The sum of 1/2 qd' G(q) qd over the stations: the knots first, where they count."""
    if not program.counts:
        return
    first = len(program.w) - program.intervals
    for knots in blocks(0, first):
        add_sum(program, program.y[knots], knots)
    for intervals in blocks(0, program.intervals, INTERVALS_PER_BINDING):
        knots = np.append(intervals, intervals[-1] + 1)
        unknowns = [program.y[knots], program.v[knots], program.w[first + intervals]]
        program.add_cost(_between(program, intervals, first), np.concatenate([one.ravel() for one in unknowns]))


def _between(program: Spline, intervals: Block, first: int) -> Callable[[Array], tuple[float, Array]]:
    """The sum midway in `intervals`, by (y, v) at their knots and w there; first: how many stations are knots."""
    count, n = len(intervals), program.n
    station, size = first + intervals, (len(intervals) + 1) * program.n
    weight = program.weights[station] / program.scaling.cost
    energy = weighted_sum(program, program.lagrangian.quadratic_gradient, station, weight)
    share = program.dt[intervals, None] / 8 * POSITION_SCALE / program.v_unit

    def between(x: Array) -> tuple[float, Array]:
        y, v = x[:size].reshape(-1, n), x[size : 2 * size].reshape(-1, n)
        middle = (y[:-1] + y[1:]) / 2 + share * (v[:-1] - v[1:])
        value, gradient = energy(np.concatenate([middle.ravel(), x[2 * size :]]))
        own = gradient[: count * n].reshape(count, n)
        by_y, by_v = np.zeros_like(y), np.zeros_like(v)
        by_y[:-1] += own / 2
        by_y[1:] += own / 2
        by_v[:-1] += share * own
        by_v[1:] -= share * own
        return value, np.concatenate([by_y.ravel(), by_v.ravel(), gradient[count * n :]])

    return between
