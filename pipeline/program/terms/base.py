"""What a floating base brings: its momentum, the ends of its cycles and its attitude."""

from __future__ import annotations

from typing import Any

import numpy as np

from pipeline.common.arrays import Array
from pipeline.model.base import Base
from pipeline.program.differentiable import DifferentiableConstraint
from pipeline.program.program import Block, Lifted, Program, Rate, blocks
from pipeline.program.scaling import POSITION_SCALE

DEPENDENT = 1e-6  # relative: a singular value below it is zero


def comes_back(program: Lifted) -> bool:
    """Whether closed joints bring the end effector back, but for turns about a centre of mass that rests (`close`)."""
    return program.arm.base.after_cycle(program.arm, program.guess.q[-1]) is not None


def enters(program: Program) -> bool:
    """Whether a cycle begins with a base velocity that is no interval's: the last one's base has turned since."""
    return program.closed and bool(program.forces) and program.arm.base.kind == "floating"


def momentum(program: Program) -> None:
    """M_b qd_i = p over every interval from q_(i-1): exact for linear momentum, of second order for angular."""
    if program.arm.base.kind != "floating":
        return
    for block in blocks(0, program.intervals):
        _conserve(program, block)
    if enters(program):
        _enter(program)


def _conserve(program: Program, block: Block) -> None:
    arm, dt = program.arm, program.dt[block]

    def residual(q: Array, qd: Array) -> tuple[Array, Array, Array]:
        return arm.base.mean_momentum_residual(arm, q, qd, dt)

    _momentum_rows(program, residual, program.y[block], program.w[block], block)


def _enter(program: Program) -> None:
    """The velocity that a cycle is entered with: the joints' last one, and the base's that momentum gives it."""
    arm = program.arm
    entry, last = program["entry"], np.array([program.intervals - 1])
    joints = program.scaling.to_velocity[-1][program.nb :]
    joints = joints / np.abs(joints).max()
    both = np.hstack([joints, -joints])
    unknowns = np.concatenate([entry[0], program.w[-1]])
    program.drake.AddLinearEqualityConstraint(both, np.zeros(len(joints)), unknowns)

    def residual(q: Array, qd: Array) -> tuple[Array, Array, Array]:
        return arm.base.momentum_residual(arm, q, qd)

    _momentum_rows(program, residual, program.y[:1], entry, last)


def _momentum_rows(program: Program, residual: Rate, y: Any, w: Any, intervals: Block) -> None:
    """The residual of the positions y and velocities w is zero: each row divided by M_bb of the guess and the size of
    its velocity.
    """
    nb, n, count = program.nb, program.n, len(intervals)
    rate = program.scaling.to_velocity[intervals]
    size = np.abs(rate[:, :nb]).max(axis=2)
    weight = np.linalg.inv(program.arm.mass_matrix(program.guess.q[intervals])[:, :nb, :nb]) / size[:, :, None]
    diagonal, split = np.arange(count), count * n

    def momentum(x: Array) -> tuple[Array, Array]:
        qd = (rate @ x[split:].reshape(count, n, 1))[:, :, 0]
        value, by_q, by_qd = residual(x[:split].reshape(count, n) / POSITION_SCALE, qd)
        rows = np.zeros((count, nb, 2 * count, n))
        rows[diagonal, :, diagonal] = weight @ by_q / POSITION_SCALE
        rows[diagonal, :, count + diagonal] = weight @ by_qd @ rate
        return (weight @ value[:, :, None]).ravel(), rows.reshape(count * nb, -1)

    pattern = [
        (k * nb + i, c * n + j) for k in range(count) for i in range(nb) for c in (k, count + k) for j in range(n)
    ]
    program.add_rows(momentum, np.zeros(count * nb), np.concatenate([y.ravel(), w.ravel()]), pattern)


def close(program: Program) -> None:
    """The last knot of a cycle whose centre of mass rests: all that the system can have done is to turn about it.

    Of the tracking error as many combinations are rows as such turns can change; the others, like the distance from
    the centre, are met already, and as rows they would leave the multipliers undetermined.
    """
    q = program.guess.q[-1:]
    turns = program.arm.base.after_cycle(program.arm, q[0]) if program.closed else None
    if turns is None or not turns.size:
        return
    task, target = program.task, program.x_ref[-1:]
    directions, sizes, _ = np.linalg.svd(task.error_and_jacobian(q, target)[1][0, :, : program.nb] @ turns)
    across = directions[:, : len(sizes)][:, sizes > DEPENDENT * max(sizes.max(), 1e-300)].T
    count = len(across)

    def closing(x: Array) -> tuple[Array, Array]:
        error, jacobian = task.error_and_jacobian(x[None] / POSITION_SCALE, target)
        return across @ error[0], across @ jacobian[0] / POSITION_SCALE

    pattern = [(i, j) for i in range(count) for j in range(program.n)]
    program.add_rows(closing, np.zeros(count), program.y[-1], pattern)


def attitude(program: Program) -> None:
    """The base's turn from its start at all knots: a bound on yaw in the plane, else on its cosine."""
    base, bound = program.arm.base, program.limits.attitude
    if base.kind != "floating" or not np.isfinite(bound):
        return
    angles = program.y[1:, base.angles]
    if angles.shape[1] == 1:
        most = np.full(program.intervals, POSITION_SCALE * bound)
        program.keep_within("attitude", -most, most, angles[:, 0], most)
        return
    for knots in blocks(1, program.intervals + 1):
        _attitude(program, base, bound, knots)


def _attitude(program: Program, base: Base, bound: float, knots: Block) -> None:
    count, split, room = len(knots), len(knots) * 3, 1 - np.cos(bound)

    def rows(x: Array) -> tuple[Array, Array]:
        q = np.zeros((count, program.n))
        q[:, base.angles] = x[:split].reshape(count, 3) / POSITION_SCALE
        cosine, by_q = base.attitude_cosine(q)
        jacobian = np.zeros((count, x.size))
        for k in range(count):
            jacobian[k, 3 * k : 3 * k + 3] = -by_q[k, base.angles] / (POSITION_SCALE * room)
        jacobian[:, split:] = -1.0
        return (1 - cosine) / room - x[split:].sum(), jacobian

    unknowns = np.concatenate(
        [program.y[knots, base.angles].ravel(), program["excess"] if "attitude" in program.elastic else []]
    )
    free = np.full(count, -np.inf)
    program.drake.AddConstraint(DifferentiableConstraint(rows), lb=free, ub=np.ones(count), vars=unknowns)
