"""Generalized forces as unknowns: tied to the motion by its dynamics, and their squares' share of the objective."""

from __future__ import annotations

import numpy as np

from pipeline.common.arrays import Array
from pipeline.program.program import Block, Program, blocks
from pipeline.program.scaling import POSITION_SCALE
from pipeline.program.terms import base


def lift(program: Program) -> None:
    """u_i = s_i (M(q_i) qdd_i + n(q_i, qd_i)) of the forces that count; |u|^2 of those that are penalised."""
    forces = program.forces
    if not forces:
        return
    if base.enters(program):
        program.new("entry", np.linalg.solve(program.scaling.to_velocity[-1], program.guess.qd[0])[None])
    u = program.new("forces", program.scaling.force * program.guess.costs.tau[1:, forces.rows])
    for block in blocks(0, program.intervals):
        _dynamics(program, block)
    if forces.weights.any() and not program.elastic:
        flat = u[:, forces.weights > 0].ravel()
        program.drake.AddQuadraticCost(2 * np.eye(len(flat)), np.zeros(len(flat)), flat, is_convex=True)


def _dynamics(program: Program, block: Block) -> None:
    """The rows of one block of intervals, with qd_(i-1) from the interval before."""
    arm, count, n, lifted = program.arm, len(block), program.n, program.forces.rows
    before = _before(program, block[0])
    has_before = before is not None
    own = count + (1 if has_before else 0)
    every = program.scaling.to_velocity
    step, scale, to_velocity = program.dt[block], program.scaling.force[block], every[block]
    intervals = block if before is None else np.concatenate([[before], block])
    rate = np.concatenate([every, every[-1:]])[intervals]
    given = program.problem.qd_init
    came_with = (np.zeros(n) if given is None else given)[None]
    at_speed = not has_before and given is None and not program.problem.reference.timing.at_rest
    diagonal = np.arange(count)
    offset = 1 if has_before else 0
    split_y, split_w = count * n, count * n + own * n

    def torque(x: Array) -> tuple[Array, Array]:
        q = x[:split_y].reshape(count, n) / POSITION_SCALE
        all_qd = (rate @ x[split_y:split_w].reshape(own, n, 1))[:, :, 0]
        qd = all_qd[offset:]
        first = all_qd[:1] if has_before else qd[:1] if at_speed else came_with
        previous = np.vstack([first, qd[:-1]])
        all_rows = arm.inverse_dynamics_gradient(q, qd, (qd - previous) / step[:, None])
        tau, by_q, by_qd, by_qdd = (values[:, lifted] for values in all_rows)
        by_qdd = by_qdd / step[:, None, None]
        rows = np.zeros((count, len(lifted), count + own, n))
        factor = scale[:, :, None]
        rows[diagonal, :, diagonal] = -factor * by_q / POSITION_SCALE
        rows[diagonal, :, count + offset + diagonal] = -factor * (by_qd + by_qdd) @ to_velocity
        if at_speed:
            rows[0, :, count] = -factor[0] * by_qd[0] @ to_velocity[0]
        late = diagonal if has_before else diagonal[1:]
        earlier = count + offset - 1 + late
        rows[late, :, earlier] += factor[late] * by_qdd[late] @ rate[offset - 1 + late]
        value = x[split_w:].reshape(count, -1) - scale * tau
        size = count * len(lifted)
        return value.ravel(), np.hstack([rows.reshape(size, -1), np.eye(size)])

    rates = np.concatenate([program.w, program["entry"]] if base.enters(program) else [program.w])[intervals]
    unknowns = np.concatenate([program.y[block + 1].ravel(), rates.ravel(), program["forces"][block].ravel()])
    pattern = []
    for k in range(count):
        columns = {k, count + offset + k, *([count + offset + k - 1] if k or has_before else [])}
        for i in range(len(lifted)):
            row = k * len(lifted) + i
            pattern += [(row, c * n + j) for c in sorted(columns) for j in range(n)]
            pattern.append((row, split_w + row))
    program.add_rows(torque, np.zeros(count * len(lifted)), unknowns, pattern)


def _before(program: Program, interval: int) -> int | None:
    """The interval whose velocity precedes this one's; None where the motion begins."""
    if interval > 0:
        return interval - 1
    if not program.closed:
        return None
    return program.intervals if base.enters(program) else program.intervals - 1
