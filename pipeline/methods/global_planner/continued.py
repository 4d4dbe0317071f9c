"""Where another method's motion is better than the planner's best, the planner goes on from it and lists what it finds.

Whose a motion is, is a question of paths and not of costs: one that the planner lists already stays as it is, and one
of another path, as cheap as it may be, is never taken for it. Costs are compared as the planner ranks its optima, by
the continuous integral.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from scipy.interpolate import CubicSpline

from pipeline.common.arrays import Array
from pipeline.config.methods import GlobalOptions
from pipeline.methods.global_planner.planner import as_solution, finish
from pipeline.methods.global_planner.smooth import smooth, splined
from pipeline.methods.method import Context
from pipeline.problem.problem import Problem
from pipeline.problem.solution import Solution, Status
from pipeline.program.spline.curve import Curve, objective
from pipeline.search.selection import path_distance

ON_GRIDS = ("dynamic_programming", "lower_bound")  # what they find is a motion of the same knots, or of coarser ones
CHEAPER = 1e-6  # relative: costs that differ by less are the same
NEAR = 0.05  # relative: on the knots of the planner a motion of other knots may come to less by so much


def continued(
    problem: Problem, solutions: Sequence[Solution], options: GlobalOptions, context: Context
) -> list[Solution]:
    """The solutions of one run's methods, with the better motions that the planner has found from those of `ON_GRIDS`
    as the planner's first.
    """
    planned = [solution for solution in solutions if solution.method == "global"]
    if not planned:
        return list(solutions)
    for method in ON_GRIDS:
        others = [s for s in solutions if s.method == method and s.found and s.status is Status.SOLVED]
        planned = _with_better(problem, planned, others, options, context)
    rest = [solution for solution in solutions if solution.method != "global"]
    before = next(k for k, solution in enumerate(solutions) if solution.method == "global")
    return rest[:before] + planned + rest[before:]


def of_same_path(problem: Problem, motion: Solution, planned: Sequence[Solution], same: float) -> Solution | None:
    """The planner's optimum that has the path of the `motion`, at the planner's knots."""
    revolute = problem.task.arm.description.revolute
    apart = [path_distance(_at(motion, own.trajectory.time), own.trajectory.q, revolute) for own in planned]
    nearest = int(np.argmin(apart)) if apart else 0
    return planned[nearest] if apart and apart[nearest] <= same else None


def cost(problem: Problem, motion: Solution) -> float:
    """Its objective, integrated along the curve through its knots."""
    own = motion.trajectory
    return objective(problem, Curve.through(problem, own.time, own.q, own.ends))


def finished(
    problem: Problem, planned: Sequence[Solution], others: Sequence[Solution], options: GlobalOptions, context: Context
) -> list[Solution]:
    """What becomes of motions of another method, all on the same knots, by the planner's local solves on its own, or on
    finer ones: distinct optima, best first; without those that are lost on the way.
    """
    if planned:
        problem = replace(problem, times=planned[0].trajectory.time)
    times = min(others[0].trajectory.time, problem.times, key=len)
    motions: Array = np.array([_at(other, times) for other in others])
    knots, optima = finish(problem, times, motions, options, context)
    found = [as_solution(replace(problem, times=knots), optimum, options) for optimum in optima]
    if found and splined(problem, options):
        found = [s for s in smooth(replace(problem, times=knots), found, options, context) if s.found]
    return found


def _with_better(
    problem: Problem, planned: list[Solution], others: list[Solution], options: GlobalOptions, context: Context
) -> list[Solution]:
    own = [solution for solution in planned if solution.found]
    best = min((cost(problem, solution) for solution in own), default=np.inf)

    def new(solution: Solution) -> bool:
        return of_same_path(problem, solution, own, options.same_path) is None

    def costs_less(solution: Solution, by: float) -> bool:
        return not own or cost(problem, solution) < best - by * abs(best)

    promising = [other for other in others if costs_less(other, -NEAR) and new(other)]
    if not promising:
        return planned
    found = finished(problem, own, promising, options, context)
    better = [solution for solution in found if costs_less(solution, CHEAPER) and new(solution)]
    if not better:
        return planned
    better.sort(key=lambda solution: cost(problem, solution))
    led = f"optimum {len(better) + 1} at best" if own else "no motion"
    said = f"gone on from what {promising[0].method} found; the planner's own starts led to {led}"
    listed = [
        replace(
            solution,
            message=said if rank == 0 else "",
            statistics={**solution.statistics, "continued_from": promising[0].method, "starts_in_basin": 0},
        )
        for rank, solution in enumerate(better)
    ]
    return [replace(solution, optimum=rank + 1) for rank, solution in enumerate([*listed, *own])]


def _at(motion: Solution, knots: Array) -> Array:
    own = motion.trajectory
    return own.q if np.array_equal(own.time, knots) else np.asarray(CubicSpline(own.time, own.q)(knots))
