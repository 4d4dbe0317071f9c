"""Every link keeps its distance from every obstacle, and from the links that it may not touch."""

from __future__ import annotations

import numpy as np

from pipeline.common.arrays import Array
from pipeline.model.clearance import Clearance, Rows
from pipeline.program.differentiable import DifferentiableConstraint
from pipeline.program.program import Lifted, blocks
from pipeline.program.scaling import POSITION_SCALE


def keep(program: Lifted) -> None:
    """By Drake's smooth penalty at every knot: at most 1 (`model/clearance.py`)."""
    problem = program.problem
    if problem.keeps_clear:
        for rows in Clearance(program.arm, problem.obstacles, problem.own).rows(program.keep_off):
            _add(program, rows)


def _add(program: Lifted, penalty: Rows) -> None:
    soft, n = penalty.kind in program.elastic, program.n
    for knots in blocks(program.first_free, program.intervals + 1):
        shape, split = (len(knots), n), len(knots) * n

        def rows(x: Array, shape: tuple[int, int] = shape, split: int = split) -> tuple[Array, Array]:
            value, by_q = penalty(x[:split].reshape(shape) / POSITION_SCALE)
            jacobian = np.zeros((shape[0], x.size))
            for k, row in enumerate(by_q):
                jacobian[k, k * shape[1] : (k + 1) * shape[1]] = row / POSITION_SCALE
            jacobian[:, split:] = -1.0
            return value - x[split:].sum(), jacobian

        unknowns = np.concatenate([program.y[knots].ravel(), program["excess"] if soft else []])
        free, most = np.full(len(knots), -np.inf), np.full(len(knots), penalty.UPPER)
        binding = program.drake.AddConstraint(DifferentiableConstraint(rows), lb=free, ub=most, vars=unknowns)
        pattern = [(k, k * n + j) for k in range(len(knots)) for j in range(n)]
        pattern += [(k, split) for k in range(len(knots)) if soft]
        binding.evaluator().SetGradientSparsityPattern(pattern)
