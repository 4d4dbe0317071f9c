"""Dynamic programming on a grid of the self-motion manifold (r = 1): the cheapest paths through its nodes, finished.

Every knot's manifold is sampled evenly in arc length (all loops: `self_motion.py`), and Bellman's recursion runs over
all pairs of nodes of neighbouring knots (`bellman.py`). The sum is the kinetic-energy integral by backward differences
(PMKE paper eq. (4), Global paper eq. (5); other terms of first order: `grid.py`). Every path of the grid keeps the task
at its knots and is feasible for the transcription on the same knots: the cost bounds that program's optimum from above.
Its excess, the grid error, is of second order in the node spacing and can only be estimated here: cheaper motions may
pass between the nodes (a bound: `lower_bound.py`). A path from node to node is no motion yet: the planner's local
solves make one of it on the knots of the problem, and what they lose on the way is not listed.
"""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np

from pipeline.common.arrays import Array
from pipeline.config.methods import DynamicProgrammingOptions, GlobalOptions
from pipeline.methods.global_planner.planner import TRACKING, finish
from pipeline.methods.method import ALONG_LOOPS, Context, Method
from pipeline.problem.costs import objective_values
from pipeline.problem.limits import LIMIT_KINDS
from pipeline.problem.problem import Problem
from pipeline.problem.solution import Solution, Status, Trajectory
from pipeline.program.transcription import transcribe
from pipeline.search.bellman import distinct_paths, paths
from pipeline.search.grid import Grid, make_grid


def solve(problem: Problem, options: DynamicProgrammingOptions, context: Context) -> list[Solution]:
    """The distinct optima to which the grid's paths lead, best first; in the statistics of the first the least cost on
    the grid and an estimate of its error.

    Torque and power limits are not part of a first-order grid: with them its cost is that of a relaxed problem.
    """
    times = _intervals(problem, options.intervals)
    grid = make_grid(problem, times, options.nodes, options.velocity_slack)
    motions, costs = paths(grid, problem.boundary)
    kept = distinct_paths(problem, motions, costs, options.same_path)
    if not kept:
        message = "no path through the grid keeps the limits; more nodes or fewer intervals make it finer than them"
        return [_nothing(problem, Status.INFEASIBLE, message, {})]
    cost = float(costs[kept[0]])
    log: dict[str, Any] = {"cost": cost, "intervals": len(times) - 1, "paths": len(kept), "spacing_rad": grid.spacing}
    log |= {"loops": [len(layer.loops) for layer in grid.layers], **_errors(problem, grid, motions[kept[0]], cost)}
    knots, optima = finish(problem, times, motions[kept], GlobalOptions(), context)
    if not optima:
        message = f"none of the grid's {len(kept)} paths leads to a motion on the problem's knots"
        return [_nothing(problem, Status.NOT_CONVERGED, message, log)]
    context.progress(1, 1, optima[0].cost)
    return [
        Solution(
            "dynamic_programming",
            Trajectory(knots, optimum.q),
            Status.SOLVED,
            optimum=rank + 1,
            tracking_tolerance=TRACKING,
            limits_kept=LIMIT_KINDS,
            clear_between=True,
            evidence=optimum.evidence,
            statistics={**(log if rank == 0 else {}), "solves": optimum.solves},
        )
        for rank, optimum in enumerate(optima)
    ]


dynamic_programming = Method(
    "dynamic_programming", "Dynamic programming", "#5A6472", DynamicProgrammingOptions, ALONG_LOOPS, solve
)


def _nothing(problem: Problem, status: Status, message: str, log: dict[str, Any]) -> Solution:
    standing = Trajectory(problem.times, np.tile(problem.q_init, (len(problem.times), 1)))
    return Solution("dynamic_programming", standing, status, message, statistics=log, found=False)


def _errors(problem: Problem, grid: Grid, motion: Array, cost: float) -> dict[str, float]:
    """Grid errors of the best motion (N + 1, n) and its cost [J s], estimates both.

    grid_error: by how much that cost is too high, for what is known: the larger of what it falls by when the motion is
    solved on its knots with joints that need not be at nodes, and of what it fell by from half the nodes to all. The
    latter alone says nothing where both grids have the same best path.
    interval_error: what is left to change with the intervals, of first order (backward differences), signed.
    """

    def best(of: Grid) -> float:
        return float(paths(of, problem.boundary)[1].min(initial=np.inf))

    coarse = grid.thin_intervals()
    coarse_cost = best(coarse)
    drop, coarse_drop = best(grid.thin_nodes()) - cost, best(coarse.thin_nodes()) - coarse_cost
    interval_error = (coarse_cost - coarse_drop / 3) - (cost - drop / 3)
    free = np.full(problem.task.arm.n, np.inf)
    bounds = replace(problem.bounds, torque=free, power=free)
    relaxed = replace(problem, times=grid.times, limits=bounds, bounds_of_integrals={})
    q, outcome, _ = transcribe(relaxed, grid.times, motion).solve()
    excess = cost - float(objective_values(relaxed, grid.times, q[None])[0]) if outcome.converged else 0.0
    return {"grid_error": max(drop, excess), "interval_error": interval_error}


def _intervals(problem: Problem, intervals: int | None) -> Array:
    own = len(problem.times) - 1
    return np.interp(np.linspace(0, own, min(intervals or own, own) + 1), np.arange(own + 1), problem.times)
