"""The end effector is on its path at every knot, or within a tolerance of its point there."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
from pydrake.solvers import QuadraticConstraint

from pipeline.common.arrays import Array
from pipeline.problem.lagrangian import trapezoid_weights
from pipeline.program.ipopt import Outcome
from pipeline.program.program import POSITIONS_PER_BINDING, Block, Lifted, blocks
from pipeline.program.scaling import POSITION_SCALE, Prices
from pipeline.program.terms import base

OFF_SCALE = 0.01  # of a departure by the whole tolerance where no prices are known: small, like the positions
LEAST = 0.05  # of the largest price, where the path's is less
INSIDE = 1e-6  # relative: by how much less than the tolerance, so that rounding does not exceed it

Errors = Callable[[Array], tuple[Array, Array]]


def follow(program: Lifted) -> None:
    """x(q_i) = x_ref,i, and for poses R(q_i) = R_ref,i; not at a start that is given, nor where closed joints do it."""
    loosen(program)
    end = program.intervals + (0 if program.closed and base.comes_back(program) else 1)
    for knots in blocks(program.first_free, end, POSITIONS_PER_BINDING):
        _at(program, np.setdiff1d(knots, program.left_out))


def loosen(program: Lifted) -> None:
    """The departures from a path that need not be kept exactly are unknowns e_i (N + 1, m), in units of its tolerances:

    |e_i| <= 1, its position's m coordinates and its orientation's each in a ball of their own.
    """
    if program.problem.reference.exact:
        return
    error, scales = program.task.error(program.guess.q, program.x_ref), _scales(program)
    off = program.new("off", scales * error / _units(program))
    convex = QuadraticConstraint.HessianType.kPositiveSemidefinite
    count = len(program.task.axes)
    for part, width in zip((slice(0, count), slice(count, None)), program.tube.T, strict=True):
        size = off[0, part].size
        for knot in range(program.first_free, len(off)) if size else ():
            form = np.diag(2 / (scales[knot, part] * width[knot] * (1 - INSIDE)) ** 2)
            ball = QuadraticConstraint(form, np.zeros(size), -np.inf, 1.0, convex)
            program.drake.AddConstraint(ball, off[knot, part])


def hold(program: Lifted, knots: Block, errors: Errors, unknowns: Any, pattern: list[tuple[int, int]]) -> None:
    """errors(x), all m of every one of the knots, with their Jacobian, are zero, or the departures allowed there."""
    m, count, zero = program.task.m, len(knots), np.zeros(len(knots) * program.task.m)
    if program.problem.reference.exact:
        program.followed.append((knots, program.add_rows(errors, zero, unknowns, pattern)))
        return
    split, units = len(unknowns), (_units(program) / _scales(program)[knots]).ravel()
    own = np.diag(-units)

    def less(x: Array) -> tuple[Array, Array]:
        value, jacobian = errors(x[:split])
        return value - units * x[split:], np.hstack([jacobian, own])

    everything = np.concatenate([unknowns, program["off"][knots].ravel()])
    program.add_rows(less, zero, everything, [*pattern, *((i, split + i) for i in range(count * m))])


def _units(program: Lifted) -> Array:
    """The tolerance of each of the m errors [m or rad]."""
    count = len(program.task.axes)
    return np.repeat(program.problem.reference.tolerances, (count, program.task.m - count))


def prices(program: Lifted, outcome: Outcome) -> Prices:
    """The path's prices where a program that keeps it exactly ended: the size of its rows' multipliers."""
    found, count = np.zeros((len(program.times), program.task.m)), len(program.task.axes)
    for knots, binding in program.followed:
        found[knots] = outcome.result.GetDualSolution(binding).reshape(len(knots), -1)
    sizes = [np.linalg.norm(part, axis=1) for part in (found[:, :count], found[:, count:])]
    return Prices(program.times, np.transpose(sizes) / trapezoid_weights(program.times)[:, None])


def _scales(program: Lifted) -> Array:
    """What departures by the whole tolerance are among the unknowns (N + 1, m).

    IPOPT's Hessians start as the identity. Where the objective falls by p |e| with a departure, the wall |e|^2 <= 1 has
    the multiplier p / 2, and the Lagrangian the Hessian p in e: the root of p makes that the identity too.
    """
    if program.prices is None:
        return np.full((len(program.times), program.task.m), OFF_SCALE)
    falls = program.prices.at(program.times) * program.problem.reference.tolerances
    roots = np.sqrt(np.maximum(falls, LEAST * falls.max(axis=0)))
    count = len(program.task.axes)
    scales: Array = np.repeat(np.where(roots > 0, roots, OFF_SCALE), (count, program.task.m - count), axis=1)
    return scales


def _at(program: Lifted, knots: Block) -> None:
    task, count, n, m = program.task, len(knots), program.n, program.task.m
    diagonal, target = np.arange(count), program.x_ref[knots]

    def position(x: Array) -> tuple[Array, Array]:
        value, jacobian = task.error_and_jacobian(x.reshape(count, n) / POSITION_SCALE, target)
        rows = np.zeros((count, m, count, n))
        rows[diagonal, :, diagonal] = jacobian / POSITION_SCALE
        return value.ravel(), rows.reshape(count * m, count * n)

    pattern = [(k * m + i, k * n + j) for k in range(count) for i in range(m) for j in range(n)]
    hold(program, knots, position, program.y[knots].ravel(), pattern)
