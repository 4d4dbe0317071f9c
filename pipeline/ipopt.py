"""Solve a MathematicalProgram with Drake's IPOPT: options, status and statistics in one place."""

from __future__ import annotations

import logging
import time
from dataclasses import dataclass
from typing import Any

from pydrake.solvers import IpoptSolver, MathematicalProgram, SolverOptions

from pipeline.arrays import Array

# Drake warns on the console about solves that end early; the status says it, and every caller reports the status.
logging.getLogger("drake").setLevel(logging.ERROR)

# IPOPT's return codes (IpReturnCodes.h), as sentences for the summary.
STATUS = {
    0: "optimal",
    1: "optimal to the acceptable tolerance only",
    2: "locally infeasible",
    3: "search direction became too small",
    4: "iterates diverge",
    5: "stopped by the user",
    6: "feasible point found",
    -1: "iteration limit reached",
    -2: "restoration failed",
    -3: "error in the step computation",
    -4: "time limit reached",
    -10: "too few degrees of freedom",
    -11: "invalid problem",
    -12: "invalid option",
    -13: "not a number in a function or derivative",
    -100: "unrecoverable exception",
}


@dataclass(frozen=True)
class Outcome:
    """x: the final decision vector. converged: IPOPT's own conditions hold to its tolerance."""

    x: Array
    converged: bool
    status: str
    wall_time: float


def solve(
    program: MathematicalProgram,
    guess: Array,
    *,
    tolerance: float = 1e-8,
    max_iterations: int = 200,
    max_time: float = 60.0,
    extra: dict[str, Any] | None = None,
) -> Outcome:
    """Run IPOPT from `guess`; never raises for a solver failure.

    The SPRAL settings halve the time of a whole solve on these banded problems (the defaults order and scale for much
    larger ones); bounds are not relaxed, so that a reported motion meets its limits to the digit.
    """
    options = SolverOptions()
    solver = IpoptSolver()
    settings: dict[str, Any] = {
        "tol": tolerance,
        "max_iter": max_iterations,
        "max_wall_time": max_time,
        "limited_memory_max_history": 8,
        "bound_relax_factor": 0.0,
        "spral_order": "metis",
        "spral_scaling": "none",
        "spral_nemin": 8,
        **(extra or {}),
    }
    for key, value in settings.items():
        options.SetOption(solver.solver_id(), key, value)
    start = time.perf_counter()
    result = solver.Solve(program, guess, options)
    wall_time = time.perf_counter() - start
    code = int(result.get_solver_details().status)
    return Outcome(
        result.GetSolution(program.decision_variables()), code == 0, STATUS.get(code, f"IPOPT code {code}"), wall_time
    )
