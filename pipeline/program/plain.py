"""The program in positions alone, velocities being their differences: to confirm an optimum, not to search for one.

From scratch it is hopeless for IPOPT's limited-memory Hessian, which is conditioned like N^2. At an optimum no Hessian
is asked for: IPOPT finds the multipliers, sees that its conditions hold, and stops.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any
from weakref import proxy

import numpy as np

from pipeline.common.arrays import Array
from pipeline.problem.problem import Problem
from pipeline.problem.turns import full_turns
from pipeline.program.ipopt import Outcome
from pipeline.program.program import POSITIONS_PER_BINDING, Block, Lifted, blocks
from pipeline.program.scaling import POSITION_SCALE, lifted
from pipeline.program.terms import ends, limits, tracking


@dataclass(frozen=True)
class Motion:
    """Positions q (N + 1, n) [rad]."""

    q: Array


class Plain(Lifted):
    """Unknowns y_0 .. y_N, and the objective divided by `cost`, its value at the guess q (N + 1, n)."""

    def __init__(self, problem: Problem, times: Array, q: Array) -> None:
        super().__init__(problem, times, q)
        self.guess, self.cost = Motion(q), 1.0
        for term in (ends.bound, tracking.follow, limits.positions, velocities):
            term(proxy(self))

    @staticmethod
    def serves(problem: Problem) -> bool:
        """Whether nothing but velocities counts, and nothing but positions is limited."""
        bounds = problem.bounds
        return not (
            len(lifted(problem))
            or problem.task.arm.base.count
            or problem.objective.secondary is not None
            or problem.bounds_of_integrals
            or problem.keeps_clear
            or np.isfinite(bounds.velocity).any()
        )

    def closes(self, q: Array) -> bool:
        """Whether a motion q (N + 1, n) winds as often as the guess does; only then it is one of this program's."""
        return not self.closed or np.array_equal(
            full_turns(self.problem, q[0], q[-1]), full_turns(self.problem, self.guess.q[0], self.guess.q[-1])
        )

    def solve(self, q: Array, cost: float, **options: Any) -> tuple[Array, Outcome, int]:
        """From q (N + 1, n), of that cost: positions (N + 1, n) [rad], IPOPT's outcome, its iterations."""
        self.cost = cost or 1.0
        outcome, iterations = self.run(guess=POSITION_SCALE * q.ravel(), **options)
        return outcome.x.reshape(q.shape) / POSITION_SCALE, outcome, iterations


def velocities(program: Plain) -> None:
    """The sum of 1/2 qd_i' G(q_i) qd_i dt_i with qd_i = (q_i - q_(i-1)) / dt_i, some intervals at a time."""
    for block in blocks(0, program.intervals, POSITIONS_PER_BINDING):
        program.add_cost(_sum(program, block), program.y[block[0] : block[-1] + 2].ravel())


def _sum(program: Plain, block: Block) -> Callable[[Array], tuple[float, Array]]:
    dt, rate = program.dt[block, None], program.lagrangian.quadratic_gradient

    def cost(y: Array) -> tuple[float, Array]:
        q, weight = y.reshape(-1, program.n) / POSITION_SCALE, program.dt[block] / program.cost
        value, by_q, by_qd = rate(q[1:], np.diff(q, axis=0) / dt)
        pull, by_position = by_qd * weight[:, None] / dt, np.zeros_like(q)
        by_position[1:] += by_q * weight[:, None] + pull
        by_position[:-1] -= pull
        return float(value @ weight), by_position.ravel() / POSITION_SCALE

    return cost
