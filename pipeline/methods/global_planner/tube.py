"""Optima by differences of a path that need not be kept exactly: from those on it, by IPOPT.

A curve through knots within the tolerances may leave them in between. The tolerances at the knots are then made
smaller, and the motion is solved again.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from pipeline.common.arrays import Array
from pipeline.config.methods import GlobalOptions
from pipeline.methods.global_planner.grids import off_path
from pipeline.methods.global_planner.optimum import Optimum, optimise
from pipeline.methods.global_planner.reasons import counted
from pipeline.methods.global_planner.smooth import nothing
from pipeline.methods.method import Context
from pipeline.problem.limits import LIMIT_KINDS
from pipeline.problem.problem import Problem
from pipeline.problem.solution import Solution, Status, Trajectory
from pipeline.search.selection import distinct

ROUNDS = 4
ROOM = 1e-3  # relative, on what is made smaller


def loosened(problem: Problem, found: list[Solution], options: GlobalOptions, context: Context) -> list[Solution]:
    """The distinct optima to which those on the path, `found`, lead, best first; or one solution that says why not."""
    motions, log = [solution.trajectory.q for solution in found if solution.found], found[0].statistics
    if not motions:
        return found
    problem = replace(problem, times=found[0].trajectory.time)
    optima = context.workers.map(_loosen, (problem, options), motions)
    good = [optimum for optimum in optima if optimum.converged]
    if not good:
        words = "; ".join(sorted({optimum.status for optimum in optima}))
        why = f"none of {len(optima)} optima on the path leads to one within its tolerances ({words})"
        return [nothing(problem, Status.NOT_CONVERGED, why, log)]
    every, revolute = np.array([optimum.q for optimum in good]), problem.task.arm.description.revolute
    ranked = distinct(every, np.array([one.cost for one in good]), len(good), options.same_path, revolute)
    words = counted(len(ranked), len(log.get("starts", motions)), log.get("barren_starts", 0))
    return [
        Solution(
            "global",
            Trajectory(problem.times, good[index].q),
            Status.SOLVED,
            found[0].message if rank == 0 else "",
            optimum=rank + 1,
            limits_kept=LIMIT_KINDS,
            evidence=(words if rank == 0 else "") + good[index].evidence,
            statistics={**(log if rank == 0 else {}), "tube_solves": good[index].solves},
        )
        for rank, index in enumerate(ranked)
    ]


def _loosen(context: tuple[Problem, GlobalOptions], motion: Array) -> Optimum:
    problem, options = context
    asked = np.array(problem.reference.tolerances)
    allowed, solves = asked, []
    for _ in range(ROUNDS):
        tolerance, orientation = map(float, allowed)
        reference = replace(problem.reference, tolerance=tolerance, orientation_tolerance=orientation)
        optimum = optimise(replace(problem, reference=reference), problem.times, motion, options)
        solves += optimum.solves
        beyond = off_path(problem, optimum.q).max(axis=1) / asked
        if not optimum.converged or beyond.max() <= 1:
            break
        allowed = np.where(beyond > 1, allowed / (np.maximum(beyond, 1.0) * (1 + ROOM)), allowed)
    return replace(optimum, solves=solves)
