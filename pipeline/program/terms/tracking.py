"""The end effector is on its path at every knot."""

from __future__ import annotations

import numpy as np

from pipeline.common.arrays import Array
from pipeline.program.program import POSITIONS_PER_BINDING, Block, Lifted, blocks
from pipeline.program.scaling import POSITION_SCALE
from pipeline.program.terms import base


def follow(program: Lifted) -> None:
    """x(q_i) = x_ref,i, and for poses R(q_i) = R_ref,i; not at a start that is given, nor where closed joints do it."""
    end = program.intervals + (0 if program.closed and base.comes_back(program) else 1)
    for knots in blocks(program.first_free, end, POSITIONS_PER_BINDING):
        _at(program, np.setdiff1d(knots, program.left_out))


def _at(program: Lifted, knots: Block) -> None:
    task, count, n, m = program.task, len(knots), program.n, program.task.m
    diagonal, target = np.arange(count), program.x_ref[knots]

    def position(x: Array) -> tuple[Array, Array]:
        value, jacobian = task.error_and_jacobian(x.reshape(count, n) / POSITION_SCALE, target)
        rows = np.zeros((count, m, count, n))
        rows[diagonal, :, diagonal] = jacobian / POSITION_SCALE
        return value.ravel(), rows.reshape(count * m, count * n)

    pattern = [(k * m + i, k * n + j) for k in range(count) for i in range(m) for j in range(n)]
    program.add_rows(position, np.zeros(count * m), program.y[knots].ravel(), pattern)
