"""Limits of positions, velocities, accelerations and jerks as rows of a window: linear in its positions.

Velocities, accelerations and jerks are backward differences (Global paper eqs (3) to (6), and once more), each of the
one before it; at the first knot they continue what has been executed before the window.
"""

from __future__ import annotations

import numpy as np

from pipeline.common.arrays import Array
from pipeline.problem.problem import Problem

STOP = 2  # knots behind the end of a path, from which on a motion by differences has neither speed nor acceleration

Quantity = tuple[Array, Array]  # offset (K, n) and by (K, U), of all joints alike: offset + by @ x at K knots


def linear_rows(window: Problem) -> tuple[Array, ...]:
    """c (U, R) at x = 0, and its derivatives (U, R, n) by x_k, x_(k-1), x_(k-2) and, of jerks, x_(k-3).

    Positions relative to their range, the others to their bounds; only those that are finite. A motion that is to rest
    at the end of its path stands still from there on, by steps as long as the last one, within the same accelerations
    and jerks: rows of the last knot, and of the others rows that always hold.
    """
    bounds, n, U = window.bounds, window.task.arm.n, len(window.times) - 1
    acceleration_limit, jerk_limit = (np.broadcast_to(bound, n) for bound in (bounds.acceleration, bounds.jerk))
    reach = 4 if np.isfinite(jerk_limit).any() else 3
    both = np.isfinite(bounds.upper - bounds.lower)
    width = np.where(both, np.where(both, bounds.upper, 1.0) - np.where(both, bounds.lower, 0.0), 1.0)
    parts: list[list[Array]] = []

    def add(quantity: Quantity, bound: Array, value: Array, sign: float) -> None:
        """sign (bound - quantity) / value >= 0 of the joints whose bound is finite."""
        kept = np.flatnonzero(np.isfinite(bound))
        if kept.size:
            own = (-sign * np.diag(1 / value))[kept]
            by = [weight[:, None, None] * own for weight in _stencil(quantity[1], reach)]
            parts.append([sign * ((bound - quantity[0]) / value)[:, kept], *by])

    dt = np.concatenate([np.diff(window.times), np.full(STOP, window.times[-1] - window.times[-2])])
    position = np.zeros((U + STOP, n)), np.eye(U)[np.arange(U + STOP).clip(max=U - 1)]
    speed, came_with = window.qd_init, window.qdd_init
    if speed is None and window.reference.timing.at_rest:
        speed = np.zeros(n)
    velocity = _rate(position, dt, window.q_init)
    acceleration = _rate(velocity, dt, speed)
    jerk = _rate(acceleration, dt, np.zeros(n) if came_with is None else came_with)
    add(_own(position), bounds.upper, width, 1.0)
    add(_own(position), bounds.lower, width, -1.0)
    stops = bool(np.isclose(window.times[-1], window.reference.duration))
    for quantity, bound, more in (
        (velocity, bounds.velocity, 0),
        (acceleration, acceleration_limit, 1),
        (jerk, jerk_limit, STOP),
    ):
        after = [_behind(quantity, place, stops) for place in range(more)] if window.rest[1] else []
        for one in (_own(quantity), *after):
            add(one, bound, bound, 1.0)
            add(one, -bound, bound, -1.0)
    if not parts:
        return np.zeros((U, 0)), *(np.zeros((U, 0, n)) for _ in range(reach))
    return tuple(np.concatenate(column, axis=1) for column in zip(*parts, strict=True))


def _rate(quantity: Quantity, dt: Array, came_with: Array | None) -> Quantity:
    """The backward differences of a quantity that the motion comes with (n,); None: as it has it at the first knot."""
    offset, by = quantity
    first, fixed = (offset[0], by[0]) if came_with is None else (came_with, np.zeros_like(by[0]))
    before = np.vstack([first, offset[:-1]]), np.vstack([fixed, by[:-1]])
    return (offset - before[0]) / dt[:, None], (by - before[1]) / dt[:, None]


def _own(quantity: Quantity) -> Quantity:
    """At the knots of the window (U,)."""
    return quantity[0][:-STOP], quantity[1][:-STOP]


def _behind(quantity: Quantity, place: int, stops: bool) -> Quantity:
    """At a knot behind the end, as the last knot's (U,); zero at the others, and where the window ends before it."""
    only = np.zeros((len(quantity[1]) - STOP, 1))
    only[-1] = stops
    behind = place - STOP
    return only * quantity[0][behind], only * quantity[1][behind]


def _stencil(by: Array, reach: int) -> Array:
    """Of by (U, U) its weights (reach, U) of x_k, x_(k-1), ...; zero before the first."""
    return np.array([np.concatenate([np.zeros(min(s, len(by))), np.diagonal(by, -s)]) for s in range(reach)])
