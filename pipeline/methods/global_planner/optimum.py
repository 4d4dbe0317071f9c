"""One local optimum: from a motion on the coarsest grid to the wanted knots, grid by grid."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
from scipy.interpolate import CubicSpline

from pipeline.common.arrays import Array
from pipeline.config.methods import GlobalOptions
from pipeline.evaluation.certified import FINE, lacking
from pipeline.evaluation.clearance import Clearance
from pipeline.problem.costs import objective_values
from pipeline.problem.integrals import of_order
from pipeline.problem.lagrangian import Lagrangian
from pipeline.problem.objective import Objective
from pipeline.problem.problem import Problem
from pipeline.problem.solution import Trajectory
from pipeline.program.feasibility import violations
from pipeline.program.ipopt import STOPPED
from pipeline.program.transcription import transcribe

# What a coarse grid's optimum needs to be told apart and refined; only the last grid's is reported.
ROUGH_TOLERANCE = 1e-4


ROUGH_ITERATIONS = 120  # starts that succeed take 10 to 100


ROUGH = {"constr_viol_tol": 1e-5, "acceptable_tol": 1e-4, "acceptable_constr_viol_tol": 1e-5}


ROOM = 1e-3  # relative, to a torque limit that may be left out


CLEARANCE_ROUNDS = 5


STRAYED = 1.5  # times the guess's cost, from where on a solve has left it


STAYS = 0.01  # of the path's length, that a motion may leave it between its knots


@dataclass(frozen=True)
class Optimum:
    """One local optimum on one grid, with the statistics of the solves that led to it."""

    q: Array  # (N + 1, n)
    cost: float
    converged: bool
    status: str
    continuous: bool = True  # False: between its knots the motion leaves the path, it jumps from branch to branch
    solves: list[dict[str, Any]] = field(default_factory=list)

    @property
    def evidence(self) -> str:
        """What IPOPT says of it, on its last grid."""
        return confirmed(self.solves)

    @property
    def final(self) -> bool:
        """Whether it would come out the same again: no clock has stopped a solve that led to it."""
        return all(solve.get("status") != STOPPED for solve in self.solves)


def confirmed(solves: list[dict[str, Any]]) -> str:
    """What IPOPT says of the last solve of which its optimality is known; nothing where it is of none."""
    told = next((solve for solve in reversed(solves) if "optimality" in solve), None)
    if told is None:
        return ""
    return (
        f"confirmed by IPOPT: constraints to {told['violation']:.0e}, optimality to {told['optimality']:.0e}, "
        f"{told['iterations']} iteration{'' if told['iterations'] == 1 else 's'}"
    )


def first_order(problem: Problem) -> Problem:
    """The problem that is solved first: without torques, and with little energy where torques alone would count.

    From a wild motion the torque program fails often; and where even that energy program is infeasible, so is it.
    """
    if not problem.objective.second_order and not _limits_torque(problem):
        return problem
    quadratic = Lagrangian(problem.task, problem.objective).is_quadratic
    only = replace(problem.objective, weights=of_order(problem.objective.weights, 1))
    return replace(_without_torque_limits(problem), objective=only if quadratic else Objective())


def optimise_start(context: tuple[Problem, Array, GlobalOptions], guess: Array) -> Optimum:
    """One start on the coarse grid, its first-order problem first."""
    problem, times, options = context
    return go_on(context, optimise(first_order(problem), times, guess, options))


def go_on(context: tuple[Problem, Array, GlobalOptions], first: Optimum) -> Optimum:
    """From the first-order problem's optimum to that of the problem itself, where it is another."""
    problem, times, options = context
    served = not problem.objective.second_order and keeps_torque_limits(problem, times, first.q)
    if not first.converged or served:
        return first
    return goes_on(problem, times, first, optimise(problem, times, first.q, options))


def goes_on(problem: Problem, times: Array, first: Optimum, optimum: Optimum) -> Optimum:
    """The optimum of the problem that was found from the first-order one's; or that, where it has strayed and a finer
    grid is still to come.
    """
    if len(times) < len(problem.times) and has_strayed(problem, times, first.q, optimum):
        cost = float(objective_values(problem, times, first.q[None])[0])
        optimum = replace(first, cost=cost, solves=optimum.solves)
    return replace(optimum, solves=first.solves + optimum.solves)


def has_strayed(problem: Problem, times: Array, guess: Array, optimum: Optimum) -> bool:
    """Whether a solve ended far above a guess that keeps every limit: its first steps led into a motion with jumps,
    which coarse differences make an optimum of its own. A finer grid then starts from the guess. Accelerations must
    count for it.
    """
    if not problem.objective.second_order:
        return False
    if optimum.converged and optimum.cost <= STRAYED * float(objective_values(problem, times, guess[None])[0]):
        return False
    return not problem.constrained or all(v.relative <= ROOM for v in violations(problem, times, guess))


def _limits_torque(problem: Problem) -> bool:
    return bool(np.isfinite(problem.bounds.torque).any() or np.isfinite(problem.bounds.power).any())


def _without_torque_limits(problem: Problem) -> Problem:
    free = np.full(problem.task.arm.n, np.inf)
    return replace(problem, limits=replace(problem.bounds, torque=free, power=free))


def keeps_torque_limits(problem: Problem, times: Array, q: Array) -> bool:
    """Whether torque and power limits are kept with some room: an optimum without them is then one with them."""
    if not _limits_torque(problem):
        return True
    worst = [v.relative for v in violations(problem, times, q) if v.kind in ("torque", "power")]
    return all(relative < -ROOM for relative in worst)


def _optimise_lazily(
    problem: Problem, times: Array, guess: Array, options: GlobalOptions, keep_off: float = 0.0
) -> Optimum:
    """As `optimise`; but where torque limits alone bring torques in and the guess keeps them, it is tried without."""
    if (
        problem.objective.second_order
        or of_order(problem.bounds_of_integrals, 2)
        or not _limits_torque(problem)
        or not keeps_torque_limits(problem, times, guess)
    ):
        return optimise(problem, times, guess, options, keep_off)
    optimum = optimise(_without_torque_limits(problem), times, guess, options, keep_off)
    if not optimum.converged or keeps_torque_limits(problem, times, optimum.q):
        return optimum
    bound = optimise(problem, times, optimum.q, options, keep_off)
    return replace(bound, solves=optimum.solves + bound.solves)


def optimise(problem: Problem, times: Array, guess: Array, options: GlobalOptions, keep_off: float = 0.0) -> Optimum:
    program = transcribe(problem, times, guess, keep_off=keep_off)
    last = len(times) == len(problem.times)
    q, outcome, iterations = program.solve(
        tolerance=options.tolerance if last else max(options.tolerance, ROUGH_TOLERANCE),
        max_iterations=options.max_iterations if last else min(options.max_iterations, ROUGH_ITERATIONS),
        max_time=options.max_time,
        extra=None if last else ROUGH,
    )
    cost = float(objective_values(problem, times, q[None])[0])
    entry = {
        "intervals": len(times) - 1,
        "iterations": iterations,
        "wall_time_s": outcome.wall_time,
        "status": outcome.status,
        "cost": cost,
    }
    if last:
        entry["violation"], entry["optimality"] = program.residuals(outcome)
    return Optimum(q, cost, outcome.converged, outcome.status, solves=[entry])


def refine(context: tuple[Problem, list[Array], GlobalOptions], start: Optimum) -> Optimum:
    problem, grids, options = context
    optimum, solves = start, list(start.solves)
    on, failures = grids[0], 0
    for fine in grids[1:]:
        guess = CubicSpline(on, optimum.q)(fine)
        finer = _optimise_lazily(problem, fine, guess, options)
        solves += finer.solves
        lost = not finer.converged or has_strayed(problem, fine, guess, finer)
        if not lost or fine is grids[-1]:
            optimum, on, failures = finer, fine, 0
            continue
        failures += 1  # one grid may be unlucky; the next starts from the last that was not
        if failures > 1:
            return replace(finer, converged=False, solves=solves)
    optimum = replace(optimum, solves=solves)
    if problem.keeps_clear and optimum.converged:
        optimum = cleared(problem, grids[-1], options, optimum)
    return replace(optimum, continuous=stays_on_path(problem, grids[-1], optimum.q))


def cleared(problem: Problem, times: Array, options: GlobalOptions, optimum: Optimum) -> Optimum:
    """As `clear_between`, by IPOPT."""
    return clear_between(
        problem, times, optimum, lambda q, keep_off: _optimise_lazily(problem, times, q, options, keep_off)
    )[0]


def clear_between(
    problem: Problem, times: Array, optimum: Optimum, again: Callable[[Array, float], Optimum]
) -> tuple[Optimum, float]:
    """The optimum that keeps its clearance between the knots too: solved again, a little farther off at the knots.

    What it keeps is what the evaluation certifies of the curve that is exported. again(q, keep_off): the optimum near q
    that is by keep_off [m] farther off at the knots. Returns the last keep_off too.
    """
    clearance = Clearance(problem.task.arm, problem.obstacles, problem.own)
    keep_off, solves = 0.0, list(optimum.solves)
    for _ in range(CLEARANCE_ROUNDS):
        short = lacking(problem, clearance, Trajectory(times, optimum.q))
        if short <= 0 or not optimum.converged:
            break
        keep_off += short + FINE / 5
        optimum = again(optimum.q, keep_off)
        solves += optimum.solves
    return replace(optimum, solves=solves), keep_off


def stays_on_path(problem: Problem, times: Array, q: Array, share: float = STAYS) -> bool:
    """Whether the cubic spline through the knots follows the path between them, to a share of its length.

    A finite-difference program also has optima that jump to another branch of the manifold within one interval.
    """
    return strays(problem, times, q) <= share * problem.reference.geometry.length


def strays(problem: Problem, times: Array, q: Array) -> float:
    """How far [m] the cubic spline through the knots is from its path halfway between them, at most."""
    middle = (times[1:] + times[:-1]) / 2
    gap = problem.task.error(CubicSpline(times, q)(middle), problem.reference.position(middle))
    return float(np.linalg.norm(gap[:, : len(problem.task.axes)], axis=1).max())
