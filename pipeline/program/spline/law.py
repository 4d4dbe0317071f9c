"""The law of the path as an unknown of a spline program: s(t) is a spline on the same knots, and moves on.

The path's rows are then of the arc length too: x(q_i) = x_ref(s_i).
"""

from __future__ import annotations

import numpy as np
import scipy.sparse as sp

from pipeline.common.arrays import Array
from pipeline.program.program import Block, blocks
from pipeline.program.scaling import POSITION_SCALE
from pipeline.program.spline.program import Law, Spline
from pipeline.program.spline.rows import continuous, pairs, within
from pipeline.program.terms import base, tracking


def advance(program: Spline) -> None:
    """s from 0 to L, at rest at both ends, and sd >= 0 by the Bezier points of every interval."""
    if program.law is None:
        return
    law, h = program.law, program.dt
    continuous(program, law.s, law.sd, law.sdd)
    length = np.array([law.s_unit * program.problem.reference.geometry.length])
    nothing, free = np.zeros(1), np.full(1, np.inf)
    for unknown, value in ((law.s[0], nothing), (law.s[-1], length), (law.sd[0], nothing), (law.sd[-1], nothing)):
        program.drake.AddBoundingBoxConstraint(value, value, unknown)
    if program.problem.zero_acceleration:
        for unknown in (law.sdd[0], law.sdd[-1]):
            program.drake.AddBoundingBoxConstraint(nothing, nothing, unknown)
    inner = law.s[1:-1].ravel()
    program.drake.AddBoundingBoxConstraint(np.zeros(len(inner)), np.full(len(inner), length[0]), inner)
    within(program, [(sp.eye_array(program.intervals + 1), law.sd)], nothing, free, program.unit(law.sd), 0)
    between = [(pairs(1.0, 0.0, h), law.sd), (pairs(h / 2, 0.0, h), law.sdd)]
    within(program, between, nothing, free, program.unit(law.sd), 0)


def follow(program: Spline) -> None:
    """The end effector is on its path at every knot, where the law has it or leaves it."""
    if program.law is None:
        tracking.follow(program)
        return
    tracking.loosen(program)
    end = program.intervals + (0 if program.closed and base.comes_back(program) else 1)
    for knots in blocks(program.first_free, end):
        _at(program, program.law, np.setdiff1d(knots, program.left_out))


def _at(program: Spline, law: Law, knots: Block) -> None:
    task, count, n, m = program.task, len(knots), program.n, program.task.m
    diagonal, size, reference = np.arange(count), count * program.n, program.problem.reference

    def position(x: Array) -> tuple[Array, Array]:
        q, s = x[:size].reshape(count, n) / POSITION_SCALE, x[size:] / law.s_unit
        target, rate, _ = reference.along(s)
        value, jacobian = task.error_and_jacobian(q, target)
        rows, by_s = np.zeros((count, m, count, n)), np.zeros((count, m, count))
        rows[diagonal, :, diagonal] = jacobian / POSITION_SCALE
        by_s[diagonal, :, diagonal] = task.error_by_target(q, target, rate) / law.s_unit
        return value.ravel(), np.hstack([rows.reshape(count * m, size), by_s.reshape(count * m, count)])

    pattern = [(k * m + i, k * n + j) for k in range(count) for i in range(m) for j in range(n)]
    pattern += [(k * m + i, size + k) for k in range(count) for i in range(m)]
    unknowns = np.concatenate([program.y[knots].ravel(), law.s[knots].ravel()])
    tracking.hold(program, knots, position, unknowns, pattern)
