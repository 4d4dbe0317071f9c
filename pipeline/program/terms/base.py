"""The rows of the lifted program (`transcription.py`) that a floating base brings: its momentum and its attitude."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import null_space

from pipeline.common.arrays import Array
from pipeline.model.base import FloatingArm
from pipeline.program.differentiable import DifferentiableConstraint

if TYPE_CHECKING:
    from pipeline.program.program import Rate, Transcription

DEPENDENT = 1e-6  # relative: a singular value below it is zero


Block = NDArray[np.int_]


def conserve_momentum(made: Transcription, arm: FloatingArm, block: Block) -> None:
    """M_b qd_i = p over every interval from q_(i-1): exact for linear momentum, of second order for angular."""
    dt = made.dt[block]

    def residual(q: Array, qd: Array) -> tuple[Array, Array, Array]:
        return arm.mean_momentum_residual(q, qd, dt)

    _momentum_rows(made, arm, residual, made.y[block], made.w[block], block)


def enter(made: Transcription, arm: FloatingArm) -> None:
    """The velocity that a cycle is entered with: the joints' is the last interval's, the base's follows from momentum."""
    nb, last = made.nb, np.array([made.intervals - 1])
    joints = made.to_velocity[-1][nb:] / np.abs(made.to_velocity[-1][nb:]).max()
    both = np.hstack([joints, -joints])
    unknowns = np.concatenate([made.w_entry[0], made.w[-1]])
    made.program.AddLinearEqualityConstraint(both, np.zeros(len(joints)), unknowns)
    _momentum_rows(made, arm, arm.momentum_residual, made.y[:1], made.w_entry, last)


def close_path(made: Transcription, arm: FloatingArm) -> None:
    """The last knot of a cycle whose centre of mass rests: all that the system can have done is to turn about it.

    Of the tracking error as many combinations are rows as such turns can change; the others, like the distance from
    the centre, are met already, and as rows they would leave the multipliers undetermined.
    """
    task, target, q = made.problem.task, made.x_ref[-1:], made.q_guess[-1:]
    turns = null_space(arm.center_of_mass(q)[1][0, :, : made.nb])
    directions, sizes, _ = np.linalg.svd(task.error_and_jacobian(q, target)[1][0, :, : made.nb] @ turns)
    across = directions[:, : len(sizes)][:, sizes > DEPENDENT * max(sizes.max(), 1e-300)].T
    count, scale = len(across), made.position_scale

    def closing(x: Array) -> tuple[Array, Array]:
        error, jacobian = task.error_and_jacobian(x[None] / scale, target)
        return across @ error[0], across @ jacobian[0] / scale

    pattern = [(i, j) for i in range(count) for j in range(made.n)]
    made.add_rows(closing, np.zeros(count), made.y[-1], pattern)


def _momentum_rows(made: Transcription, arm: FloatingArm, residual: Rate, y: Any, w: Any, intervals: Block) -> None:
    """The residual of the positions y and velocities w is zero: each row divided by M_bb of the guess and the size of its
    velocity.
    """
    nb, n, count = made.nb, made.n, len(intervals)
    rate = made.to_velocity[intervals]
    size = np.abs(rate[:, :nb]).max(axis=2)
    weight = np.linalg.inv(arm.mass_matrix(made.q_guess[intervals])[:, :nb, :nb]) / size[:, :, None]
    diagonal, split = np.arange(count), count * n

    def momentum(x: Array) -> tuple[Array, Array]:
        qd = (rate @ x[split:].reshape(count, n, 1))[:, :, 0]
        value, by_q, by_qd = residual(x[:split].reshape(count, n) / made.position_scale, qd)
        rows = np.zeros((count, nb, 2 * count, n))
        rows[diagonal, :, diagonal] = weight @ by_q / made.position_scale
        rows[diagonal, :, count + diagonal] = weight @ by_qd @ rate
        return (weight @ value[:, :, None]).ravel(), rows.reshape(count * nb, -1)

    pattern = [
        (k * nb + i, c * n + j) for k in range(count) for i in range(nb) for c in (k, count + k) for j in range(n)
    ]
    made.add_rows(momentum, np.zeros(count * nb), np.concatenate([y.ravel(), w.ravel()]), pattern)


def limit_attitude(made: Transcription, arm: FloatingArm) -> None:
    """The base's turn from its start at all knots: a bound on yaw in the plane, else on its cosine."""
    bound = made.limits.attitude
    if arm.planar:
        most = np.full(made.intervals, made.position_scale * bound)
        made.keep_within("attitude", -most, most, made.y[1:, 2], most)
        return
    soft = "attitude" in made.elastic
    room = 1 - np.cos(bound)
    for knots in made.blocks(1, made.intervals + 1):
        count, split = len(knots), len(knots) * 3

        def rows(x: Array, count: int = count, split: int = split) -> tuple[Array, Array]:
            q = np.zeros((count, made.n))
            q[:, 3:6] = x[:split].reshape(count, 3) / made.position_scale
            cosine, by_q = arm.attitude_cosine(q)
            jacobian = np.zeros((count, x.size))
            for k in range(count):
                jacobian[k, 3 * k : 3 * k + 3] = -by_q[k, 3:6] / (made.position_scale * room)
            jacobian[:, split:] = -1.0
            return (1 - cosine) / room - x[split:].sum(), jacobian

        unknowns = np.concatenate([made.y[knots, 3:6].ravel(), made.excess if soft else []])
        free = np.full(count, -np.inf)
        made.program.AddConstraint(DifferentiableConstraint(rows), lb=free, ub=np.ones(count), vars=unknowns)
