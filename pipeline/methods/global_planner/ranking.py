"""The order of optima: that of the continuous integral, which the sum over a grid's intervals only stands for.

Optima that are closer to each other than their sums are to their integrals change places on finer knots; by the
integrals they do not. An integral is that of the cubic spline through the knots, where the objective is of first order:
second differences of knots say too little of torques.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from pipeline.methods.global_planner.optimum import Optimum
from pipeline.problem.problem import Problem
from pipeline.program.spline.curve import Curve, objective


def in_order(problem: Problem, optima: Sequence[Optimum]) -> list[tuple[Optimum, str]]:
    """The optima, ordered by their sums, best first by their integrals; with what is to be said of those that moved."""
    if len(optima) < 2 or problem.objective.second_order or problem.task.arm.base.count:
        return [(optimum, "") for optimum in optima]
    integrals = [objective(problem, Curve.through(problem, problem.times, optimum.q)) for optimum in optima]
    order = np.argsort(integrals, kind="stable")
    words = "ranked by its continuous integral, {:.5g}; by its sum on these knots, {:.5g}, it would be number {}"
    return [
        (optima[k], words.format(integrals[k], optima[k].cost, k + 1) if k != rank else "")
        for rank, k in enumerate(order)
    ]
