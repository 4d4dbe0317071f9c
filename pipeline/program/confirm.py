"""Drake's IPOPT has the last word: it is started where Newton's method ended, on the program that it would have solved.

Newton's iterates end on the central path with the barrier at 1e-10. IPOPT takes over there: its first multipliers mu /
s are then the optimal ones, nothing is pushed away from its bounds, and it stops after 0 to 2 iterations. It must not
scale the objective, or those multipliers are not the optimal ones any more.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from pipeline.common.arrays import Array
from pipeline.problem.problem import Problem
from pipeline.program.ipopt import Outcome
from pipeline.program.plain import Plain
from pipeline.program.program import Lifted
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
# A tenth of the time on plain programs, whose rows are alike; lifted ones take up to six times as long with it.
PLAIN_HANDOVER = {**HANDOVER, "spral_order": "matching", "spral_scaling": "matching"}
AT_ONCE = 2  # iterations on the plain program
SOON = 40  # on the lifted one: where it has not stopped by then it began too far off, and does not get there


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


class Confirm:
    """IPOPT's answers from optima of one problem on one grid: where positions tell all, on the plain program, once
    made; where IPOPT does not stop there at once, as elsewhere on a lifted one.
    """

    def __init__(self, problem: Problem, times: Array, tolerance: float, max_iterations: int) -> None:
        self.problem, self.times, self.max_iterations = problem, times, max_iterations
        self.tolerance = tolerance
        self._plain: Plain | None = None
        self._serves = Plain.serves(problem)

    def __call__(self, q: Array, cost: float, keep_off: float = 0.0) -> Confirmation:
        """From q (N + 1, n), of that cost; keep_off [m]: as in `transcribe`."""
        if self._serves:
            if self._plain is None or not self._plain.closes(q):
                self._plain = Plain(self.problem, self.times, q)
            at_once: dict[str, Any] = {"max_iterations": AT_ONCE, "extra": PLAIN_HANDOVER}
            told = _told(self._plain, q, self._plain.solve(q, cost, tolerance=self.tolerance, **at_once))
            if told.converged:
                return told
        program = transcribe(self.problem, self.times, q, keep_off=keep_off)
        options: dict[str, Any] = {"max_iterations": min(self.max_iterations, SOON), "extra": HANDOVER}
        return _told(program, q, program.solve(tolerance=self.tolerance, **options))


def _told(program: Lifted, q: Array, answer: tuple[Array, Outcome, int]) -> Confirmation:
    final, outcome, iterations = answer
    moved = float(np.abs(final - q).max())
    left = program.residuals(outcome)
    return Confirmation(final, outcome.converged, outcome.status, iterations, outcome.wall_time, moved, *left)
