"""Which problems Newton's method serves, and its solver of one problem on one grid. The others are IPOPT's alone."""

from __future__ import annotations

import numpy as np

from pipeline.common.arrays import Array
from pipeline.model.clearance import Clearance
from pipeline.model.kernel.chain import Chain
from pipeline.problem.problem import Boundary, Problem
from pipeline.program.newton.clear import Clear
from pipeline.program.newton.forces import Forces
from pipeline.program.newton.knots import Knots
from pipeline.program.newton.momentum import LOOSE, Momentum, Ties
from pipeline.program.newton.motion import NOTHING, Motions, Terms
from pipeline.program.newton.newton import Newton

SERVED = ("kinetic_energy", "velocity_norm", "torque")
FEWEST = {False: 4, True: 6}  # knots, without and with torques: a shorter cycle does not fold


def why_not(problem: Problem) -> str | None:
    """What Newton's method does not serve in `problem`, for the log; None: it serves it whole.

    Served are the kinetic energy, the velocity norm and the torques of an arm on a base that stands, on positions and
    poses, with any boundary, within limits of positions, velocities, torques and powers, or clear of obstacles
    and of the arm itself.
    """
    objective = problem.objective
    reasons = {
        **_about_base(problem),
        "reactions in the objective": objective.second_order and not objective.weight("torque"),
        "a secondary criterion": objective.secondary is not None,
        "neither velocities nor torques in the objective": not any(map(objective.weight, SERVED)),
        "rest, or limits of accelerations or jerks": any(problem.rest) or problem.bounds.smooth,
        "a path that need not be kept exactly": not problem.reference.exact,
        "bounds on integrals": bool(problem.bounds_of_integrals),
        "clearances and torques at once": problem.keeps_clear and _torques(problem),
        "so few intervals": len(problem.times) <= FEWEST[_torques(problem)],
    }
    return next((reason for reason, holds in reasons.items() if holds), None)


def _about_base(problem: Problem) -> dict[str, bool]:
    """What is not served of an arm whose base has coordinates: its momentum from a given start is."""
    base, objective = problem.task.arm.base, problem.objective
    moves = base.count > 0
    return {
        "a base that is held": base.kind == "held",
        "a base that moves, from a start that is not fixed": moves and problem.boundary is not Boundary.FIXED,
        "a base that moves, and its rotation": moves and objective.weight("base_rotation") > 0,
        "a base that moves, and torques": moves and _torques(problem),
        "a base that moves, and limits of its attitude": moves and bool(np.isfinite(problem.bounds.attitude)),
        "a base that moves, and velocities without energy": moves and not objective.weight("kinetic_energy"),
    }


def _torques(problem: Problem) -> bool:
    """Whether torques count."""
    bounds = problem.bounds
    return problem.objective.second_order or bool(np.isfinite([bounds.torque, bounds.power]).any())


class Solver:
    """Newton's method for one problem that it serves, on any grid."""

    def __init__(self, problem: Problem) -> None:
        self.problem, self.chain = problem, Chain.of(problem.task.arm)
        own = problem.obstacles, problem.own
        self.clearance = Clearance(problem.task.arm, *own) if problem.keeps_clear else None

    def on(self, times: Array, keep_off: float = 0.0) -> Newton:
        """For motions on the knots `times` (N + 1,), by keep_off [m] more than the margin off everything."""
        problem, knots = self.problem, Knots(self.problem.boundary, times)
        x_ref = problem.reference.position(times)
        terms: Terms = NOTHING
        if self.clearance is not None:
            terms = Clear(self.clearance.rows(keep_off))
        elif _torques(problem):
            terms = Forces(self.chain, problem, knots)
        arm = problem.task.arm
        ties: Ties = LOOSE
        if arm.base.kind == "floating":
            ties = Momentum(arm, self.chain, knots)
        motions = Motions(self.chain, problem.task, problem.objective, knots, x_ref, terms, ties)
        return Newton(motions, problem.bounds)
