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

Functions = Mapping[Any, DifferentiableCost | DifferentiableConstraint]


class Conditions:
    """Those of one program. functions: what its evaluators call in Python; asked directly, they remember the point."""

    def __init__(self, program: MathematicalProgram, functions: Functions | None = None) -> None:
        self._functions, self._size = functions or {}, program.num_vars()
        bindings = [(one, program.FindDecisionVariableIndices(one.variables())) for one in program.GetAllCosts()]
        self._costs = [(one.evaluator(), part) for one, part in bindings]
        self._rows = [
            (one, one.evaluator(), program.FindDecisionVariableIndices(one.variables()))
            for one in program.GetAllConstraints()
        ]

    def residuals(self, result: MathematicalProgramResult) -> tuple[float, float]:
        """Violation and optimality, in the program's own units: its objective is 1 at its guess."""
        x = result.get_x_val()
        gradient, violation = np.zeros(self._size), 0.0
        for at, part in self._costs:
            quadratic = isinstance(at, QuadraticCost)
            gradient[part] += at.Q() @ x[part] + at.b() if quadratic else self._differentiated(at, x[part])[1][0]
        for binding, at, part in self._rows:
            if isinstance(at, LinearConstraint):  # bounds among them
                jacobian = at.get_sparse_A()
                value = jacobian @ x[part]
            else:
                value, jacobian = self._differentiated(at, x[part])
            beyond = np.maximum(at.lower_bound() - value, value - at.upper_bound())
            violation = max(violation, float(beyond.max(initial=0.0)))
            gradient[part] -= jacobian.T @ result.GetDualSolution(binding)
        return violation, float(np.abs(gradient).max())

    def _differentiated(self, evaluator: Any, x: Array) -> tuple[Array, Array]:
        """Values (rows,) and their Jacobian (rows, len(x))."""
        if evaluator in self._functions:
            value, jacobian = self._functions[evaluator].at(x)
            return np.atleast_1d(value), np.atleast_2d(jacobian)
        found = evaluator.Eval(InitializeAutoDiff(x))
        return ExtractValue(found).ravel(), ExtractGradient(found)
