"""Drake's IPOPT has the last word: it is started where Newton's method ended, on the program that it would have solved.

Newton's iterates end on the central path with the barrier at 1e-10. IPOPT takes over there: its first multipliers mu /
s are then the optimal ones, nothing is pushed away from its bounds, and it stops after 0 to 2 iterations. It must not
scale the objective, or those multipliers are not the optimal ones any more.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from pipeline.common.arrays import Array
from pipeline.problem.problem import Problem
from pipeline.program.residuals import residuals
from pipeline.program.transcription import transcribe

HANDOVER = {
    "mu_init": 1e-10,
    "bound_mult_init_method": "mu-based",
    "bound_push": 1e-14,
    "bound_frac": 1e-14,
    "slack_bound_push": 1e-14,
    "slack_bound_frac": 1e-14,
    "nlp_scaling_method": "none",
    "constr_mult_init_max": 1e8,  # else the first multipliers of long rows are put to zero
    "acceptable_iter": 3,  # where rounding keeps IPOPT from its last digits, at an optimum it cannot gain any
}


@dataclass(frozen=True)
class Confirmation:
    """q (N + 1, n): as IPOPT leaves it; by how much it moved any joint [rad]; its verdict, what that took, and what is
    left of its conditions (`residuals.py`).
    """

    q: Array
    converged: bool
    status: str
    iterations: int
    wall_time: float
    moved: float
    violation: float
    optimality: float


def confirm(
    problem: Problem, times: Array, q: Array, *, tolerance: float, max_iterations: int, keep_off: float = 0.0
) -> Confirmation:
    """IPOPT's own answer from q (N + 1, n); keep_off [m]: as in `transcribe`."""
    program = transcribe(problem, times, q, keep_off=keep_off)
    final, outcome, iterations = program.solve(tolerance=tolerance, max_iterations=max_iterations, extra=HANDOVER)
    moved, left = float(np.abs(final - q).max()), residuals(program.drake, outcome.result)
    return Confirmation(final, outcome.converged, outcome.status, iterations, outcome.wall_time, moved, *left)
