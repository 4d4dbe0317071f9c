"""The interpolation-based Global Kinematic Planner (Global paper Section 3): many coarse starts, each optimum refined.

The population of `candidates.py` is ranked by cost, the best distinct motions are optimised on a coarse grid, the
distinct optima are carried to the fine grid by cubic interpolation, halving the step each time.
"""

from __future__ import annotations

from itertools import pairwise
from typing import Any

import numpy as np
from scipy.interpolate import CubicSpline

from pipeline.arrays import Array
from pipeline.candidates import distinct, kinetic_energy_integrals, population
from pipeline.config import GlobalOptions
from pipeline.problem import Problem, Progress, Solution, Status, Trajectory, no_progress
from pipeline.transcription import Transcription

TRACKING = 1e-8  # [m] what an optimum must keep at every knot


def solve(
    problem: Problem, options: GlobalOptions = GlobalOptions(), seed: int = 1, progress: Progress = no_progress
) -> list[Solution]:
    """All distinct optima found, best first; a single failed Solution if there is none."""
    grids = refinement(problem.times, options.coarse_steps)
    rng = np.random.default_rng(seed)
    revolute = problem.task.arm.description.revolute

    coarse = grids[0]
    motions = population(problem, coarse, options.candidates, rng)
    if not len(motions):
        standing = np.tile(problem.q_init, (len(problem.times), 1))
        message = "no candidate could follow the path to its end: it leaves the reach of the arm"
        return [Solution("global", Trajectory(problem.times, standing), Status.INFEASIBLE, message)]
    chosen = distinct(
        motions, kinetic_energy_integrals(problem, coarse, motions), options.starts, options.same_path, revolute
    )
    starts = []
    for number, index in enumerate(chosen):
        starts.append(_optimise(problem, coarse, motions[index], options))
        progress(number + 1, len(chosen), min(start.cost for start in starts))

    solved = [start for start in starts if start.converged] or starts
    costs = np.array([start.cost for start in solved])
    basins = distinct(np.array([start.q for start in solved]), costs, len(solved), options.same_path, revolute)
    log: dict[str, Any] = {
        "candidates": len(motions),
        "starts": len(starts),
        "converged_starts": sum(start.converged for start in starts),
        "grids": [len(grid) - 1 for grid in grids],
        "start_solves": [start.statistics for start in starts],
    }
    refined = [_refine(problem, grids, solved[index], options) for index in basins]
    final = distinct(
        np.array([r.q for r in refined]), np.array([r.cost for r in refined]), len(refined), options.same_path, revolute
    )
    return [_report(problem, refined[index], rank + 1, log) for rank, index in enumerate(final)]


def refinement(times: Array, coarse_steps: int) -> list[Array]:
    """Grids from coarse to fine: about coarse_steps intervals, doubled until the wanted knots `times` are reached."""
    intervals = len(times) - 1
    sizes = [intervals]
    while sizes[0] > coarse_steps:
        sizes.insert(0, (sizes[0] + 1) // 2)
    place = np.arange(intervals + 1)
    return [np.interp(np.linspace(0, intervals, size + 1), place, times) for size in sizes]


class _Optimum:
    """One local optimum on one grid, with the statistics of the solves that led to it."""

    def __init__(self, q: Array, cost: float, converged: bool, status: str, statistics: list[dict[str, Any]]) -> None:
        self.q, self.cost, self.converged, self.status, self.statistics = q, cost, converged, status, statistics


def _optimise(problem: Problem, times: Array, guess: Array, options: GlobalOptions) -> _Optimum:
    q, outcome, iterations = Transcription(problem, times, guess).solve(
        tolerance=options.tolerance, max_iterations=options.max_iterations
    )
    cost = float(kinetic_energy_integrals(problem, times, q[None])[0])
    entry = {
        "intervals": len(times) - 1,
        "iterations": iterations,
        "wall_time_s": outcome.wall_time,
        "status": outcome.status,
        "cost": cost,
    }
    return _Optimum(q, cost, outcome.converged, outcome.status, [entry])


def _refine(problem: Problem, grids: list[Array], start: _Optimum, options: GlobalOptions) -> _Optimum:
    optimum, statistics = start, list(start.statistics)
    for coarse, fine in pairwise(grids):
        optimum = _optimise(problem, fine, CubicSpline(coarse, optimum.q)(fine), options)
        statistics += optimum.statistics
    return _Optimum(optimum.q, optimum.cost, optimum.converged, optimum.status, statistics)


def _report(problem: Problem, optimum: _Optimum, rank: int, log: dict[str, Any]) -> Solution:
    trajectory = Trajectory(problem.times, optimum.q)
    statistics = {**(log if rank == 1 else {}), "solves": optimum.statistics}
    if optimum.converged:
        return Solution(
            "global", trajectory, Status.SOLVED, optimum=rank, tracking_tolerance=TRACKING, statistics=statistics
        )
    gap = np.abs(problem.task.value(optimum.q) - problem.reference.position(problem.times)).max()
    message = f"{optimum.status}; the path is missed by up to {gap:.1e} m"
    status = Status.INFEASIBLE if gap > 1e-6 else Status.NOT_CONVERGED
    return Solution(
        "global", trajectory, status, message, optimum=rank, tracking_tolerance=TRACKING, statistics=statistics
    )
