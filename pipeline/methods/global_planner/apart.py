"""The arm and itself, in the planner: optima that come too near to it are solved again with rows that keep them off.

Few optima do, and the rows cost what a start costs: so they come in where they are needed.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from pipeline.common.arrays import Array
from pipeline.config.methods import GlobalOptions
from pipeline.evaluation.certified import Closest, lacking, near
from pipeline.evaluation.clearance import Clearance
from pipeline.methods.global_planner.batch import Batch
from pipeline.methods.global_planner.optimum import Optimum, cleared, stays_on_path
from pipeline.methods.global_planner.reasons import too_near
from pipeline.methods.method import Context
from pipeline.problem.curve import whole
from pipeline.problem.problem import Problem
from pipeline.problem.solution import Solution, Trajectory
from pipeline.program.spline.curve import Curve

AGAIN = 100  # iterations of an optimum that is solved again: those that need more do not end well
FEW = 4  # optima on the coarse grid that are refined with these rows: seconds each
LOST = "optima_too_near_to_the_arm"  # in the statistics: it is not the limits that leave none


def keeps_own(problem: Problem) -> bool:
    """Whether motions have to keep the arm clear of itself."""
    return problem.own is not None and problem.own.kept


def without_own(problem: Problem) -> Problem:
    """The problem whose motions need not."""
    return problem if problem.own is None else replace(problem, own=replace(problem.own, kept=False))


def apart(problem: Problem, optima: list[Optimum], options: GlobalOptions, context: Context) -> list[Optimum]:
    """The optima, those that come too near to the arm itself solved again: not converged where that fails.

    Where Newton fails IPOPT takes seconds and seldom does better: it is asked for those alone that promise to be better
    than the best one that is clear.
    """
    only = replace(problem, obstacles=None)
    clearance = Clearance(problem.task.arm, None, problem.own)
    short = [k for k, one in enumerate(optima) if lacking(only, clearance, Trajectory(problem.times, one.q)) > 0]
    best = min((one.cost for k, one in enumerate(optima) if k not in short), default=np.inf)
    again = iter(context.workers.map(solved_again, (problem, problem.times, options, best), [optima[k] for k in short]))
    return [next(again) if k in short else optimum for k, optimum in enumerate(optima)]


def blamed(problem: Problem, near: list[Optimum], found: list[Solution]) -> list[Solution]:
    """What was found where every start keeps off the arm itself, after all optima, `near` it, were lost."""
    if found[0].found:
        return found
    log = {**found[0].statistics, LOST: len(near)}
    return [replace(found[0], message=too_near(problem, len(near), nearest(problem, near)), statistics=log)]


def nearest(problem: Problem, optima: list[Optimum]) -> Closest:
    """Where one of the optima comes nearest to the arm itself."""
    clearance, found = Clearance(problem.task.arm, None, problem.own), Closest()
    for one in optima:
        trajectory = Trajectory(problem.times, one.q)
        own = near(replace(problem, obstacles=None), clearance, whole(problem, trajectory), problem.times).own
        found = min(found, own, key=lambda each: each.distance)
    return found


def short(problem: Problem, curve: Curve) -> float:
    """By how much [m] a spline falls short of a margin that it has to keep, as the evaluation certifies it."""
    if not problem.keeps_clear:
        return 0.0
    clearance = Clearance(problem.task.arm, problem.obstacles, problem.own)
    return lacking(problem, clearance, Trajectory(curve.times, curve.q, curve.ends))


def solved_again(context: tuple[Problem, Array, GlobalOptions, float], optimum: Optimum) -> Optimum:
    """One of them, from where it is; what remains too near counts as lost. `best`: what it costs to be clear."""
    problem, times, options, best = context
    options = replace(options, max_iterations=min(options.max_iterations, AGAIN))
    found: Optimum | None = None
    if Batch.without(problem, options) is None:
        found = Batch(problem, options).finish_near(times, optimum)
        if found is None and optimum.cost >= best:
            return replace(optimum, converged=False)
    if found is None:
        found = cleared(problem, times, options, optimum)
    clearance = Clearance(problem.task.arm, problem.obstacles, problem.own)
    kept = found.converged and lacking(problem, clearance, Trajectory(times, found.q)) <= 0
    return replace(found, converged=kept, continuous=stays_on_path(problem, times, found.q))
