"""Rows of a spline program that need no dynamics: its continuity, its ends, and limits that are linear in it."""

from __future__ import annotations

from typing import Any

import numpy as np
import scipy.sparse as sp
from pydrake.solvers import LinearConstraint, QuadraticConstraint

from pipeline.common.arrays import Array
from pipeline.program.scaling import POSITION_SCALE
from pipeline.program.spline.program import Spline

LEAST, MOST = 0.02, 50.0  # times the motion time


def link(program: Spline) -> None:
    """v1 - v0 = h/2 (a0 + a1) and q1 - q0 = h v0 + h^2/6 (2 a0 + a1) over every interval."""
    continuous(program, program.y, program.v, program.a)


def continuous(program: Spline, position: Any, velocity: Any, acceleration: Any) -> None:
    """The same of any spline, by its unknowns at the knots, each (N + 1, width)."""
    h = program.dt
    first = [(pairs(-1.0, 1.0, h), velocity), (pairs(-h / 2, -h / 2, h), acceleration)]
    second = [
        (pairs(-1.0, 1.0, h), position),
        (pairs(-h, 0.0, h), velocity),
        (pairs(-(h**2) / 3, -(h**2) / 6, h), acceleration),
    ]
    _equal(program, first, program.unit(velocity))
    _equal(program, second, program.unit(position))


def rest(program: Spline) -> None:
    """No velocity, and where it is asked for no acceleration, at ends that rest; a cycle without rest ends as it began.

    Of one with rest nothing more is asked: between two of its rounds the arm stands still, and its path, at rest at
    every knot but these, gives its ends all accelerations that it can give.
    """
    still = np.zeros(program.n)
    for knot, rests in zip((0, -1), program.problem.rest, strict=True):
        if rests:
            program.drake.AddBoundingBoxConstraint(still, still, program.v[knot])
            if program.problem.zero_acceleration:
                program.drake.AddBoundingBoxConstraint(still, still, program.a[knot])
    if not program.closed or all(program.problem.rest):
        return
    both = np.hstack([np.eye(program.n), -np.eye(program.n)])
    for own, given in ((program.v, any(program.problem.rest)), (program.a, program.problem.zero_acceleration)):
        if not given:
            program.drake.AddLinearEqualityConstraint(both, still, np.concatenate([own[0], own[-1]]))


def enter(program: Spline) -> None:
    """J(q) v = 0 at an end of a resting path where the joints need not rest."""
    if program.closed or not program.problem.reference.timing.at_rest:
        return
    task, n = program.task, program.n
    for knot, rests in zip((0, -1), program.problem.rest, strict=True):
        if rests:
            continue

        def still(x: Array) -> tuple[Array, Array]:
            q, v = x[None, :n] / POSITION_SCALE, x[n:] / program.v_unit
            jacobian, by_q = task.jacobian_and_gradient(q)
            rows = np.hstack([np.einsum("ijk,j->ik", by_q[0], v) / POSITION_SCALE, jacobian[0] / program.v_unit])
            return program.v_unit * (jacobian[0] @ v), program.v_unit * rows

        pattern = [(i, j) for i in range(task.m) for j in range(2 * n)]
        unknowns = np.concatenate([program.y[knot], program.v[knot]])
        program.add_rows(still, np.zeros(task.m), unknowns, pattern)


def shorten(program: Spline) -> None:
    """The motion time is what is minimised: r, r^2 and r^3 are unknowns."""
    r = program["stretch"]
    program.drake.AddBoundingBoxConstraint(LEAST, MOST, r[:1])
    program.drake.AddLinearCost(np.ones(1), r[:1])
    for power in (1, 2):
        form = np.zeros((3, 3))
        form[0, 1] = form[1, 0] = 1.0
        form = form if power == 2 else np.diag([2.0, 0.0, 0.0])
        unknowns = r[[0, 1, 2]] if power == 2 else r[[0, 2, 1]]
        linear = np.array([0.0, 0.0, -1.0])
        indefinite = QuadraticConstraint.HessianType.kIndefinite
        program.drake.AddConstraint(QuadraticConstraint(form, linear, 0.0, 0.0, indefinite), unknowns)


def limits(program: Spline) -> None:
    """Position, velocity, acceleration, jerk: exact between the knots, or sufficient by the Bezier points there."""
    bounds, h, n = program.limits, program.dt, program.n
    knots = sp.eye_array(program.intervals + 1)
    if np.isfinite(bounds.lower).any() or np.isfinite(bounds.upper).any():
        places = [
            [(knots, program.y)],
            [(pairs(1.0, 0.0, h), program.y), (pairs(h / 3, 0.0, h), program.v)],
            [(pairs(0.0, 1.0, h), program.y), (pairs(0.0, -h / 3, h), program.v)],
        ]
        low, high = (np.broadcast_to(bound, n) for bound in (bounds.lower, bounds.upper))
        for parts in places:
            within(program, parts, low, high, POSITION_SCALE, 0)
    if np.isfinite(bounds.velocity).any():
        between = [(pairs(1.0, 0.0, h), program.v), (pairs(h / 2, 0.0, h), program.a)]
        for parts in ([(knots, program.v)], between):
            within(program, parts, -bounds.velocity, bounds.velocity, program.v_unit, 1)
    if np.isfinite(bounds.acceleration).any():
        within(program, [(knots, program.a)], -bounds.acceleration, bounds.acceleration, program.a_unit, 2)
    if np.isfinite(bounds.jerk).any():
        jerk = [(pairs(-1.0, 1.0, h), program.a)]
        room = h[:, None] * np.broadcast_to(bounds.jerk, n)
        within(program, jerk, -room, room, program.a_unit, 3)


def within(program: Spline, parts: list[tuple[Any, Any]], low: Array, high: Array, unit: float, order: int) -> None:
    """low <= the sum of the parts <= high, each (rows, width) or (width,), of a derivative of this order in time.

    Where the motion is stretched and the order is not zero, low is -high.
    """
    rows, unknowns = _rows(program, parts, unit)
    width = parts[0][1].shape[1]
    count = rows.shape[0] // width
    low, high = ((unit * np.broadcast_to(bound, (count, width))).ravel() for bound in (low, high))
    used = np.flatnonzero(np.isfinite(low) | np.isfinite(high))
    rows, low, high = sp.csr_matrix(rows)[used], low[used], high[used]
    if program.stretch is None or order == 0:
        single = len(parts) == 1 and parts[0][0].nnz == count
        if single:
            program.drake.AddBoundingBoxConstraint(low, high, unknowns[used])
        else:
            program.drake.AddConstraint(LinearConstraint(sp.csc_matrix(rows), low, high), unknowns)
        return
    factor = program.stretch[order - 1 : order]
    both = sp.csc_matrix(sp.vstack([sp.hstack([sign * rows, -sp.csc_matrix(high[:, None])]) for sign in (1.0, -1.0)]))
    free, zero = np.full(both.shape[0], -np.inf), np.zeros(both.shape[0])
    program.drake.AddConstraint(LinearConstraint(both, free, zero), np.concatenate([unknowns, factor]))


def pairs(before: Any, after: Any, h: Array) -> Any:
    """The sparse form (N, N + 1) of `before` at the first and `after` at the last knot of every interval."""
    count = len(h)
    diagonals = [np.broadcast_to(value, count) for value in (before, after)]
    form = sp.csr_array(sp.diags_array(diagonals, offsets=[0, 1], shape=(count, count + 1)))
    form.eliminate_zeros()
    return form


def _rows(program: Spline, parts: list[tuple[Any, Any]], unit: float) -> tuple[Any, Any]:
    columns = [sp.kron(form * (unit / program.unit(own)), sp.eye_array(own.shape[1])) for form, own in parts]
    return sp.csc_matrix(sp.hstack(columns)), np.concatenate([own.ravel() for _, own in parts])


def _equal(program: Spline, parts: list[tuple[Any, Any]], unit: float) -> None:
    """The sum of the parts is zero."""
    rows, unknowns = _rows(program, parts, unit)
    program.drake.AddLinearEqualityConstraint(rows, np.zeros(rows.shape[0]), unknowns)
