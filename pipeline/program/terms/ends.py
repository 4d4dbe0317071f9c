"""Velocities are differences of positions, and what the boundary prescribes of the first and last."""

from __future__ import annotations

import numpy as np
import scipy.sparse as sp

from pipeline.problem.problem import Boundary
from pipeline.problem.turns import full_turns
from pipeline.program.program import Lifted, Program
from pipeline.program.scaling import POSITION_SCALE


def link(program: Program) -> None:
    """y_i - y_(i-1) = POSITION_SCALE dt_i qd_i, as one sparse linear binding."""
    count, n = program.intervals, program.n
    pairs = sp.diags_array([-np.ones(count), np.ones(count)], offsets=[0, 1], shape=(count, count + 1))
    steps = sp.block_diag(list(POSITION_SCALE * program.dt[:, None, None] * program.scaling.to_velocity))
    rows = sp.csc_matrix(sp.hstack([sp.kron(pairs, sp.eye_array(n)), -steps]))
    rows.eliminate_zeros()
    unknowns = np.concatenate([program.y.ravel(), program.w.ravel()])
    program.drake.AddLinearEqualityConstraint(rows, np.zeros(count * n), unknowns)


def bound(program: Lifted) -> None:
    """q(0) given, or q(T) = q(0) up to the full turns of the guess; a base starts where it is, a held one stays."""
    start, nb = POSITION_SCALE * program.problem.q_init, program.nb
    if program.problem.boundary is Boundary.FIXED:
        program.drake.AddBoundingBoxConstraint(start, start, program.y[0])
    elif nb:
        program.drake.AddBoundingBoxConstraint(start[:nb], start[:nb], program.y[0, :nb])
    if program.arm.base.kind == "held":
        still = np.tile(start[:nb], program.intervals)
        program.drake.AddBoundingBoxConstraint(still, still, program.y[1:, :nb].ravel())
    if program.closed:
        joints = program.n - nb
        closing = np.hstack([np.eye(joints), -np.eye(joints)])
        ends = np.concatenate([program.y[0, nb:], program.y[-1, nb:]])
        turns = POSITION_SCALE * full_turns(program.problem, program.guess.q[0], program.guess.q[-1])[nb:]
        program.drake.AddLinearEqualityConstraint(closing, -turns, ends)
