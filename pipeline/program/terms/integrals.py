"""Bounds on integrals (epsilon-constraint, Global paper eqs (21), (22)): rows over sums of a few knots each."""

from __future__ import annotations

from typing import Any

import numpy as np
from pydrake.solvers import QuadraticConstraint

from pipeline.common.arrays import Array
from pipeline.problem.integrals import INTEGRALS
from pipeline.problem.lagrangian import Lagrangian
from pipeline.problem.objective import Objective
from pipeline.program.differentiable import DifferentiableConstraint
from pipeline.program.program import Block, Program, blocks
from pipeline.program.terms.energy import weighted_sum


def bound(program: Program) -> None:
    """Sums of a few knots are unknowns of their own, bounded together: the rows stay sparse."""
    if program.elastic:
        return
    parts = blocks(0, program.intervals)
    for name, bound in program.problem.bounds_of_integrals.items():
        sums = program.new(f"{name} sums", np.full(len(parts), 1.0 / len(parts)))
        for block, total in zip(parts, sums, strict=True):
            add = _first_order if INTEGRALS[name].order == 1 else _squares
            add(program, name, block, total, bound)
        # Scaled by the bound: the sums add up to at most 1.
        program.drake.AddLinearConstraint(np.ones((1, len(sums))), [-np.inf], [1.0], sums)


def _first_order(program: Program, name: str, block: Block, total: Any, bound: float) -> None:
    rate = Lagrangian(program.task, Objective({name: 1.0})).quadratic_gradient
    energy = weighted_sum(program, rate, block, program.dt[block] / bound)

    def excess(x: Array) -> tuple[Array, Array]:
        value, gradient = energy(x[:-1])
        return np.array([value - x[-1]]), np.append(gradient, -1.0)[None]

    unknowns = np.concatenate([program.y[block + 1].ravel(), program.w[block].ravel(), [total]])
    program.drake.AddConstraint(DifferentiableConstraint(excess), lb=[-np.inf], ub=[0.0], vars=unknowns)


def _squares(program: Program, name: str, block: Block, total: Any, bound: float) -> None:
    """u = s tau, and the integral is the sum of tau'tau dt."""
    own = program.forces.of(name)
    weight = (program.dt[block, None] / (program.scaling.force[block][:, own] ** 2 * bound)).ravel()
    form = np.diag(np.append(2 * weight, 0.0))
    linear = np.append(np.zeros(len(weight)), -1.0)
    convex = QuadraticConstraint.HessianType.kPositiveSemidefinite
    constraint = QuadraticConstraint(form, linear, -np.inf, 0.0, convex)
    program.drake.AddConstraint(constraint, np.append(program["forces"][block][:, own].ravel(), total))
