"""The rows of the lifted program (`transcription.py`) that a floating base brings: its momentum and its attitude."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from pipeline.arrays import Array
from pipeline.differentiable import DifferentiableConstraint
from pipeline.floating import FloatingArm

if TYPE_CHECKING:
    from pipeline.transcription import Transcription

Block = NDArray[np.int_]


def conserve_momentum(made: Transcription, arm: FloatingArm, block: Block) -> None:
    """M_b qd_i = p at the middle of every interval, q_(i-1) + dt_i / 2 qd_i: of second order in the step."""
    _momentum_rows(made, arm, made.y[block], made.w[block], block, made.dt[block] / 2)


def enter(made: Transcription, arm: FloatingArm) -> None:
    """The velocity that a cycle is entered with: the joints' is the last interval's, the base's follows from momentum."""
    nb, last = made.nb, np.array([made.intervals - 1])
    joints = made.to_velocity[-1][nb:] / np.abs(made.to_velocity[-1][nb:]).max()
    both = np.hstack([joints, -joints])
    unknowns = np.concatenate([made.w_entry[0], made.w[-1]])
    made.program.AddLinearEqualityConstraint(both, np.zeros(len(joints)), unknowns)
    _momentum_rows(made, arm, made.y[:1], made.w_entry, last, np.zeros(1))


def _momentum_rows(made: Transcription, arm: FloatingArm, y: Any, w: Any, intervals: Block, ahead: Array) -> None:
    """M_b qd = p `ahead` [s] of the positions y, each row divided by M_bb of the guess and the size of its velocity."""
    nb, n, count = made.nb, made.n, len(intervals)
    rate = made.to_velocity[intervals]
    size = np.abs(rate[:, :nb]).max(axis=2)
    weight = np.linalg.inv(arm.mass_matrix(made.q_guess[intervals])[:, :nb, :nb]) / size[:, :, None]
    diagonal, split = np.arange(count), count * n

    def momentum(x: Array) -> tuple[Array, Array]:
        qd = (rate @ x[split:].reshape(count, n, 1))[:, :, 0]
        q = x[:split].reshape(count, n) / made.position_scale + ahead[:, None] * qd
        value, by_q, by_qd = arm.momentum_residual(q, qd)
        rows = np.zeros((count, nb, 2 * count, n))
        rows[diagonal, :, diagonal] = weight @ by_q / made.position_scale
        rows[diagonal, :, count + diagonal] = weight @ (by_qd + ahead[:, None, None] * by_q) @ rate
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
