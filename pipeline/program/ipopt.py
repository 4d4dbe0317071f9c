"""Solve a MathematicalProgram with Drake's IPOPT: options, status and statistics in one place."""

from __future__ import annotations

import logging
import time
from dataclasses import dataclass
from typing import Any

from pydrake.solvers import IpoptSolver, MathematicalProgram, MathematicalProgramResult, SolverOptions

from pipeline.common.arrays import Array

# Drake warns on the console about solves that end early; the status says it, and every caller reports the status.
logging.getLogger("drake").setLevel(logging.ERROR)


STOPPED = "stopped at max_time"  # by the clock: another machine, or another day, would have come farther
CONVERGED = ("success", "stop at acceptable point")


@dataclass(frozen=True)
class Outcome:
    """x: the final decision vector. converged: IPOPT's conditions hold, to its tolerance or at worst 1e-6 (status).
    result: Drake's, with the multipliers.
    """

    x: Array
    converged: bool
    status: str
    wall_time: float
    result: MathematicalProgramResult


def solve(
    program: MathematicalProgram,
    guess: Array,
    *,
    tolerance: float = 1e-8,
    max_iterations: int = 200,
    max_time: float | None = None,
    extra: dict[str, Any] | None = None,
) -> Outcome:
    """Run IPOPT from `guess`; never raises for a solver failure. No clock decides unless max_time [s] is given.

    The SPRAL settings halve the time of a whole solve on these banded problems (the defaults order and scale for much
    larger ones); bounds are not relaxed, so that a reported motion meets its limits to the digit.
    """
    options = SolverOptions()
    solver = IpoptSolver()
    settings: dict[str, Any] = {
        "tol": tolerance,
        "max_iter": max_iterations,
        "limited_memory_max_history": 8,
        "bound_relax_factor": 0.0,
        # A hopeless start turns to feasibility early, and is given up early.
        "expect_infeasible_problem": "yes",
        "constr_viol_tol": 1e-8,
        # Where many limits are active the last digits of optimality can be out of reach, never those of feasibility.
        "acceptable_tol": 1e-6,
        "acceptable_constr_viol_tol": 1e-8,
        "spral_order": "metis",
        "spral_scaling": "none",
        "spral_nemin": 8,
        **({} if max_time is None else {"max_wall_time": max_time}),
        **(extra or {}),
    }
    for key, value in settings.items():
        options.SetOption(solver.solver_id(), key, value)
    start = time.perf_counter()
    result = solver.Solve(program, guess, options)
    wall_time = time.perf_counter() - start
    details = result.get_solver_details()
    x: Array = result.get_x_val()
    status = details.ConvertStatusToString().lower()
    status = STOPPED if "time exceeded" in status else status
    return Outcome(x, status in CONVERGED, status, wall_time, result)
