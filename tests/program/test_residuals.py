"""What is left of IPOPT's conditions: nothing at an optimum, much where it was stopped."""

from __future__ import annotations

import pytest
from pydrake.solvers import MathematicalProgram

from pipeline.program import ipopt
from pipeline.program.residuals import Conditions


def test_a_bound_a_row_and_a_curve_by_hand() -> None:
    """min x^2 + (y - 3)^2, x + y = 2, y <= 2, x <= 5: at (0, 2); without steps, at (1, 1), the gradient is left."""
    program = MathematicalProgram()
    x = program.NewContinuousVariables(2, "x")
    program.AddQuadraticCost(x[0] ** 2 + (x[1] - 3) ** 2)
    program.AddLinearConstraint(x[0] + x[1] == 2)
    program.AddBoundingBoxConstraint([-5, -5], [5, 2], x)
    program.AddConstraint(x[0] ** 2 <= 4)
    solved = ipopt.solve(program, [0.5, 1.0])
    assert solved.x == pytest.approx([0, 2], abs=1e-6)
    conditions = Conditions(program)
    violation, optimality = conditions.residuals(solved.result)
    assert violation < 1e-8
    assert optimality < 1e-6
    stopped = ipopt.solve(program, [1.0, 0.5], max_iterations=0)
    assert conditions.residuals(stopped.result)[0] == pytest.approx(0.5, abs=1e-2)
    assert conditions.residuals(stopped.result)[1] > 0.1
