"""Limits on joint motion: of position and torque as bounds, of velocity as bounds or linear rows, of power bilinear."""

from __future__ import annotations

import numpy as np
import scipy.sparse as sp
from pydrake.solvers import QuadraticConstraint

from pipeline.program.program import Lifted, Program
from pipeline.program.scaling import POSITION_SCALE


def give_way(program: Program) -> None:
    """The fraction by which elastic limits may be exceeded is an unknown, and all that is minimised."""
    if not program.elastic:
        return
    excess = program.new("excess", np.ones(1))
    program.drake.AddBoundingBoxConstraint(0.0, np.inf, excess)
    program.drake.AddLinearCost(np.ones(1), excess)


def positions(program: Lifted) -> None:
    """At every knot but a given start."""
    limits, first = program.limits, program.first_free
    if np.isfinite(limits.lower).any() or np.isfinite(limits.upper).any():
        knots = program.intervals + 1 - first
        low, high = (np.tile(POSITION_SCALE * bound, knots) for bound in (limits.lower, limits.upper))
        program.keep_within("position", low, high, program.y[first:].ravel(), (high - low) / 2)


def joints(program: Program) -> None:
    """Velocity, torque and power, over every interval."""
    limits = program.limits
    if np.isfinite(limits.velocity).any():
        # Scaled so that a row's coefficients are of order one.
        to_velocity = program.scaling.to_velocity
        size = np.abs(to_velocity).max(axis=(1, 2))
        bound = (limits.velocity / size[:, None]).ravel()
        rows = None if program.scaling.diagonal else sp.block_diag(list(to_velocity / size[:, None, None]))
        program.keep_within("velocity", -bound, bound, program.w.ravel(), bound, rows)
    if np.isfinite(limits.torque).any():
        bound = (limits.torque[program.forces.rows] * program.scaling.force).ravel()
        program.keep_within("torque", -bound, bound, program["forces"].ravel(), bound)
    for joint in np.flatnonzero(np.isfinite(limits.power)):
        _power(program, int(joint), float(limits.power[joint]))


def _power(program: Program, joint: int, power: float) -> None:
    """|tau_j qd_j| <= P for one joint at all intervals: u_ij (to_velocity_i w_i)_j s_i^-1, relative to P."""
    column, forces = program.forces.rows.index(joint), program["forces"]
    indefinite = QuadraticConstraint.HessianType.kIndefinite
    for i in range(program.intervals):
        row = program.scaling.to_velocity[i, joint]
        used = np.flatnonzero(row)
        form = np.zeros((len(used) + 1, len(used) + 1))
        form[0, 1:] = form[1:, 0] = row[used] / (program.scaling.force[i, column] * power)
        unknowns = np.concatenate([[forces[i, column]], program.w[i, used]])
        if "power" not in program.elastic:
            constraint = QuadraticConstraint(form, np.zeros(len(form)), -1.0, 1.0, indefinite)
            program.drake.AddConstraint(constraint, unknowns)
            continue
        form = np.pad(form, (0, 1))
        linear = np.append(np.zeros(len(used) + 1), -1.0)
        for sign in (1.0, -1.0):
            constraint = QuadraticConstraint(sign * form, linear, -np.inf, 1.0, indefinite)
            program.drake.AddConstraint(constraint, np.concatenate([unknowns, program["excess"]]))
