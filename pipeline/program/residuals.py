"""What is left of the optimality conditions where IPOPT stopped, from its multipliers but by code of our own.

    largest violation of a constraint g or bound,    largest entry of df/dx - sum (dg/dx)' lambda

(Nocedal and Wright 2006, eq. (12.34)); multipliers as Drake has them, the change of the optimal cost by a bound.
"""

from __future__ import annotations

import numpy as np
from pydrake.autodiffutils import ExtractGradient, ExtractValue, InitializeAutoDiff
from pydrake.solvers import LinearConstraint, MathematicalProgram, MathematicalProgramResult, QuadraticCost

from pipeline.common.arrays import Array


def residuals(program: MathematicalProgram, result: MathematicalProgramResult) -> tuple[float, float]:
    """Violation and optimality, in the program's own units: its objective is 1 at its guess."""
    x = result.GetSolution(program.decision_variables())
    gradient, violation = np.zeros(len(x)), 0.0
    for binding in program.GetAllCosts():
        part, at = program.FindDecisionVariableIndices(binding.variables()), binding.evaluator()
        own = at.Q() @ x[part] + at.b() if isinstance(at, QuadraticCost) else _differentiated(at, x[part])[1][0]
        np.add.at(gradient, part, own)
    for binding in program.GetAllConstraints():
        part, at = program.FindDecisionVariableIndices(binding.variables()), binding.evaluator()
        if isinstance(at, LinearConstraint):  # bounds among them
            rows = at.get_sparse_A()
            value, jacobian = rows @ x[part], rows
        else:
            value, jacobian = _differentiated(at, x[part])
        beyond = np.maximum(at.lower_bound() - value, value - at.upper_bound())
        violation = max(violation, float(beyond.max(initial=0.0)))
        np.add.at(gradient, part, -(jacobian.T @ result.GetDualSolution(binding)))
    return violation, float(np.abs(gradient).max())


def _differentiated(evaluator: object, x: Array) -> tuple[Array, Array]:
    """Values (rows,) and their Jacobian (rows, len(x))."""
    found = evaluator.Eval(InitializeAutoDiff(x))  # type: ignore[attr-defined]
    return ExtractValue(found).ravel(), ExtractGradient(found)
