"""What is left of the optimality conditions where IPOPT stopped, from its multipliers but by code of our own.

    largest violation of a constraint g or bound,    largest entry of df/dx - sum (dg/dx)' lambda

(Nocedal and Wright 2006, eq. (12.34)); multipliers as Drake has them, the change of the optimal cost by a bound.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
from pydrake.autodiffutils import ExtractGradient, ExtractValue, InitializeAutoDiff
from pydrake.solvers import LinearConstraint, MathematicalProgram, MathematicalProgramResult, QuadraticCost

from pipeline.common.arrays import Array
from pipeline.program.differentiable import DifferentiableConstraint, DifferentiableCost

NONE: Mapping[Any, DifferentiableCost | DifferentiableConstraint] = {}


def residuals(
    program: MathematicalProgram,
    result: MathematicalProgramResult,
    functions: Mapping[Any, DifferentiableCost | DifferentiableConstraint] = NONE,
) -> tuple[float, float]:
    """Violation and optimality, in the program's own units: its objective is 1 at its guess.

    functions: what evaluators call in Python; asked directly, it remembers the point.
    """

    def differentiated(evaluator: Any, x: Array) -> tuple[Array, Array]:
        """Values (rows,) and their Jacobian (rows, len(x))."""
        if evaluator in functions:
            value, jacobian = functions[evaluator].at(x)
            return np.atleast_1d(value), np.atleast_2d(jacobian)
        found = evaluator.Eval(InitializeAutoDiff(x))
        return ExtractValue(found).ravel(), ExtractGradient(found)

    x = result.get_x_val()
    gradient, violation = np.zeros(len(x)), 0.0
    for binding in program.GetAllCosts():
        part, at = program.FindDecisionVariableIndices(binding.variables()), binding.evaluator()
        own = at.Q() @ x[part] + at.b() if isinstance(at, QuadraticCost) else differentiated(at, x[part])[1][0]
        gradient[part] += own
    for binding in program.GetAllConstraints():
        part, at = program.FindDecisionVariableIndices(binding.variables()), binding.evaluator()
        if isinstance(at, LinearConstraint):  # bounds among them
            rows = at.get_sparse_A()
            value, jacobian = rows @ x[part], rows
        else:
            value, jacobian = differentiated(at, x[part])
        beyond = np.maximum(at.lower_bound() - value, value - at.upper_bound())
        violation = max(violation, float(beyond.max(initial=0.0)))
        gradient[part] -= jacobian.T @ result.GetDualSolution(binding)
    return violation, float(np.abs(gradient).max())
