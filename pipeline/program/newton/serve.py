"""Which problems Newton's method serves, and its solver of one problem on one grid. The others are IPOPT's alone."""

from __future__ import annotations

import numpy as np

from pipeline.common.arrays import Array
from pipeline.model.clearance import Clearance
from pipeline.model.kernel.chain import Chain
from pipeline.problem.problem import Problem
from pipeline.program.newton.clear import Clear
from pipeline.program.newton.knots import Knots
from pipeline.program.newton.motion import Motions, Nothing
from pipeline.program.newton.newton import Newton

FEWEST = 4  # intervals: a shorter cycle does not fold


def why_not(problem: Problem) -> str | None:
    """What Newton's method does not serve in `problem`, for the log; None: it serves it whole.

    Served are the kinetic energy and the velocity norm of an arm on a base that stands, on positions and poses, with
    any boundary, within limits of positions and velocities.
    """
    objective, bounds = problem.objective, problem.bounds
    reasons = {
        "a base that moves or is held": problem.task.arm.base.count > 0,
        "torques or reactions in the objective": objective.second_order,
        "a secondary criterion": objective.secondary is not None,
        "no velocity in the objective": not objective.weight("kinetic_energy")
        and not objective.weight("velocity_norm"),
        "bounds on integrals": bool(problem.bounds_of_integrals),
        "torque or power limits": bool(np.isfinite(bounds.torque).any() or np.isfinite(bounds.power).any()),
        "so few intervals": len(problem.times) <= FEWEST,
    }
    return next((reason for reason, holds in reasons.items() if holds), None)


class Solver:
    """Newton's method for one problem that it serves, on any grid."""

    def __init__(self, problem: Problem) -> None:
        self.problem, self.chain = problem, Chain.of(problem.task.arm)
        obstacles = problem.obstacles
        self.clearance = None if obstacles is None else Clearance(problem.task.arm, obstacles)

    def on(self, times: Array, keep_off: float = 0.0) -> Newton:
        """For motions on the knots `times` (N + 1,), by keep_off [m] more than the margin off all obstacles."""
        problem, knots = self.problem, Knots(self.problem.boundary, times)
        x_ref = problem.reference.position(times)
        kept = Nothing() if self.clearance is None else Clear(self.clearance.rows(keep_off))
        return Newton(Motions(self.chain, problem.task, problem.objective, knots, x_ref, kept), problem.bounds)
