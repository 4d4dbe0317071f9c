"""Torques of a spline program as unknowns at its knots: tied to the motion, penalised, and limited with the powers."""

from __future__ import annotations

import numpy as np
from pydrake.solvers import QuadraticConstraint

from pipeline.common.arrays import Array
from pipeline.program.program import Block, blocks
from pipeline.program.scaling import POSITION_SCALE
from pipeline.program.spline.program import Spline


def lift(program: Spline) -> None:
    """u_i = s_i (M(q_i) a_i + n(q_i, v_i) - g(q_i)) of the forces that count; stretched, with v / r and a / r^2."""
    if program.forces:
        for knots in blocks(0, program.intervals + 1):
            _dynamics(program, knots)


def _dynamics(program: Spline, knots: Block) -> None:
    arm, n, count, lifted = program.arm, program.n, len(knots), program.forces.rows
    scale, size, m = program.scaling.force[knots], len(knots) * program.n, len(program.forces.rows)
    own, diagonal = count * m, np.arange(count)
    stretched = program.stretch is not None

    def torque(x: Array) -> tuple[Array, Array]:
        q, v, a = (x[i * size : (i + 1) * size].reshape(count, n) for i in range(3))
        r = x[-1] if stretched else 1.0
        q, v, a = q / POSITION_SCALE, v / (program.v_unit * r), a / (program.a_unit * r**2)
        tau, by_q, by_v, by_a = (part[:, lifted] for part in arm.inverse_dynamics_gradient(q, v, a))
        rows = np.zeros((count, m, 3, count, n))
        factor = -scale[:, :, None]
        units = (POSITION_SCALE, program.v_unit * r, program.a_unit * r**2)
        for place, (by, unit) in enumerate(zip((by_q, by_v, by_a), units, strict=True)):
            rows[diagonal, :, place, diagonal] = factor * by / unit
        columns = [rows.reshape(own, 3 * size), np.eye(own)]
        if stretched:
            by_r = (by_v @ v[:, :, None])[:, :, 0] + 2 * (by_a @ a[:, :, None])[:, :, 0]
            columns.append((scale * by_r / r).reshape(own, 1))
        value = x[3 * size : 3 * size + own].reshape(count, m) - scale * tau
        return value.ravel(), np.hstack(columns)

    unknowns = [program.y[knots].ravel(), program.v[knots].ravel(), program.a[knots].ravel()]
    unknowns.append(program["forces"][knots].ravel())
    if program.stretch is not None:
        unknowns.append(program.stretch[:1])
    pattern = []
    for k in range(count):
        for i in range(m):
            row = k * m + i
            pattern += [(row, part * size + k * n + j) for part in range(3) for j in range(n)]
            pattern.append((row, 3 * size + row))
            if stretched:
                pattern.append((row, 3 * size + own))
    program.add_rows(torque, np.zeros(own), np.concatenate(unknowns), pattern)


def squares(program: Spline) -> None:
    """|u|^2 of the forces that are penalised: the trapezoidal rule is in their scale."""
    weights = program.forces.weights
    if weights.any():
        flat = program["forces"][:, weights > 0].ravel()
        program.drake.AddQuadraticCost(2 * np.eye(len(flat)), np.zeros(len(flat)), flat, is_convex=True)


def limits(program: Spline) -> None:
    """Bounds of torque and |tau_j v_j| <= P_j at the knots, tightened there for what happens between them."""
    bounds = program.limits
    if np.isfinite(bounds.torque).any():
        rows = program.forces.rows
        most = (bounds.torque * program.tightened.torque)[:, rows] * program.scaling.force
        program.drake.AddBoundingBoxConstraint(-most.ravel(), most.ravel(), program["forces"].ravel())
    for joint in np.flatnonzero(np.isfinite(bounds.power)):
        _power(program, int(joint), bounds.power[joint] * program.tightened.power[:, joint])


def _power(program: Spline, joint: int, power: Array) -> None:
    """|u_ij v_ij| / (s_ij unit P) <= 1, or r where the motion is stretched."""
    column = program.forces.rows.index(joint)
    indefinite = QuadraticConstraint.HessianType.kIndefinite
    for i in range(program.intervals + 1):
        form = np.zeros((2, 2))
        form[0, 1] = form[1, 0] = 1 / (program.scaling.force[i, column] * program.v_unit * power[i])
        unknowns = np.array([program["forces"][i, column], program.v[i, joint]])
        if program.stretch is None:
            constraint = QuadraticConstraint(form, np.zeros(2), -1.0, 1.0, indefinite)
            program.drake.AddConstraint(constraint, unknowns)
            continue
        for sign in (1.0, -1.0):
            linear = np.array([0.0, 0.0, -1.0])
            constraint = QuadraticConstraint(sign * np.pad(form, (0, 1)), linear, -np.inf, 0.0, indefinite)
            program.drake.AddConstraint(constraint, np.append(unknowns, program.stretch[0]))
