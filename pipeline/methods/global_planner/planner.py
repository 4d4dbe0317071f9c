"""The interpolation-based Global Kinematic Planner (Global paper Section 3): many coarse starts, every optimum refined.

Motions come from a roadmap over the self-motion manifolds (`search/roadmap.py`), or from a ranked population as in the
paper (`search/population.py`). They are optimised on a coarse grid, and each distinct optimum is carried to the wanted
knots by cubic splines, halving the step. What is listed are the optima found from so many starts, not all there are.
"""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
from scipy.interpolate import CubicSpline

from pipeline.common.arrays import Array
from pipeline.config.methods import GlobalOptions
from pipeline.methods import dynamic_programming
from pipeline.methods.global_planner.batch import Batch
from pipeline.methods.global_planner.grids import coarsest, finer, on_knots, refinement
from pipeline.methods.global_planner.optimum import Optimum, go_on, optimise_start, refine
from pipeline.methods.global_planner.reasons import no_feasible, no_optimum, no_start
from pipeline.methods.global_planner.smooth import rough, smooth, splined, unserved
from pipeline.methods.method import ANY, Context, Method
from pipeline.model.kinematics import wrap
from pipeline.problem.limits import LIMIT_KINDS
from pipeline.problem.problem import Problem
from pipeline.problem.resolution import MOST
from pipeline.problem.solution import Solution, Status, Trajectory
from pipeline.program.feasibility import Relaxed, least_violation
from pipeline.search.configurations import starting_points
from pipeline.search.population import population, ranking
from pipeline.search.roadmap import Roadmap
from pipeline.search.selection import distinct, diverse

STARTS = {
    "roadmap": ("roadmap",),
    "population": ("population",),
    "dynamic_programming": ("dynamic_programming",),
    "both": ("population", "dynamic_programming"),
}


TRACKING = 1e-8  # [m] what an optimum must keep at every knot


ELASTIC_STARTS = 3  # from how many motions IPOPT seeks a motion, and the least violation, when Newton found none


FEWER = 12  # starts on a finer grid after none succeeded on the coarse one


STEPS = 25  # intervals of the coarsest grid: 12 miss optima


STEPS_ALONE = 12  # where each start costs a solve of its own


HOPELESS = 0.1  # relative violation on a coarse grid from which on finer ones are not tried


def solve(problem: Problem, options: GlobalOptions, context: Context) -> list[Solution]:
    """The distinct optima found from these starts, best first."""
    if not splined(problem, options):
        return by_differences(problem, options, context)
    found = by_differences(rough(problem), options, context)
    if found[0].found:  # on the knots that the path needs
        problem = replace(problem, times=found[0].trajectory.time)
    return smooth(problem, found, options, context)


def by_differences(problem: Problem, options: GlobalOptions, context: Context) -> list[Solution]:
    """The same on the knots alone, as the papers have it."""
    why = Batch.without(problem, options)
    times, too_coarse = on_knots(problem, options.refine_to)
    if too_coarse:
        return [_nothing(problem, Status.NOT_CONVERGED, too_coarse, {})]
    asked, problem = len(problem.times) - 1, replace(problem, times=times)
    grids = refinement(times, coarsest(problem, options.coarse_steps, STEPS if why is None else STEPS_ALONE))
    motions, log = _starts(problem, grids[0], options, np.random.default_rng(context.seed))
    if not len(motions):
        return [_nothing(problem, Status.INFEASIBLE, no_start(problem, log.get("drawn", 0)), log)]

    batch = Batch(problem, options) if why is None else None
    log["solver"] = f"ipopt ({why})" if batch is None else batch.words
    while True:
        starts = _optimise_starts(problem, grids[0], options, motions, batch, context)
        if any(start.converged for start in starts):
            break
        relaxed = _relaxed(problem, grids[0], motions)
        if relaxed is not None and relaxed.feasible:
            starts += context.workers.map(optimise_start, (problem, grids[0], options), [relaxed.q])
            if starts[-1].converged:
                break
        elif relaxed is not None and (relaxed.worst.relative > HOPELESS or len(grids) == 1):
            return [_nothing(problem, Status.INFEASIBLE, no_feasible(len(motions), relaxed), log)]
        if len(grids) == 1:
            break
        # A coarse grid can be infeasible where a finer one is not: its finite differences are other numbers.
        motions, grids = CubicSpline(grids[0], motions[:FEWER], axis=1)(grids[1]), grids[1:]
    log["starts"] = [
        {"converged": start.converged, "cost": start.cost, "status": start.status, "solves": start.solves}
        for start in starts
    ]
    basins = [starts[index] for index in _basins(problem, starts, options)]
    problem, grids, refined = _to_the_end(problem, grids, options, basins, batch, context)
    log["grids"] = [len(grid) - 1 for grid in grids]
    found = [(fine, coarse) for fine, coarse in zip(refined, basins, strict=True) if _good(fine)]
    log["jumping_optima"] = sum(fine.converged and not fine.continuous for fine in refined)
    if not found:
        return [_nothing(problem, Status.NOT_CONVERGED, no_optimum(problem, grids[0], starts, refined), log)]
    ranked = [found[index] for index in _distinct([fine for fine, _ in found], options, problem)]
    solutions = []
    for rank, (fine, coarse) in enumerate(ranked):
        members = {"starts_in_basin": _members(problem, coarse, starts, options), "solves": fine.solves}
        solutions.append(
            Solution(
                "global",
                Trajectory(problem.times, fine.q),
                Status.SOLVED,
                _said(problem, asked, options, [fine.q for fine, _ in found]) if rank == 0 else "",
                optimum=rank + 1,
                tracking_tolerance=TRACKING,
                limits_kept=LIMIT_KINDS,
                knots_only=options.refine_to is None,
                statistics={**(log if rank == 0 else {}), **members},
            )
        )
    return solutions


def finish(
    problem: Problem, times: Array, motions: Array, options: GlobalOptions, context: Context
) -> tuple[Array, list[Optimum]]:
    """The distinct optima, best first, to which motions (S, N + 1, n) on the knots `times` lead, and the knots that
    they are on: the problem's, or those that its path needs. Motions that are lost on the way are left out.
    """
    knots, too_coarse = on_knots(problem, options.refine_to)
    if too_coarse:
        return knots, []
    problem = replace(problem, times=knots)
    batch = Batch(problem, options) if Batch.without(problem, options) is None else None
    grids = [times, *(grid for grid in refinement(knots, len(times)) if len(grid) > len(times))]
    starts = _optimise_starts(problem, times, options, motions, batch, context)
    basins = [starts[index] for index in _basins(problem, starts, options)]
    problem, _, refined = _to_the_end(problem, grids, options, basins, batch, context)
    good = [optimum for optimum in refined if _good(optimum)]
    return problem.times, [good[index] for index in _distinct(good, options, problem)]


def refuses(problem: Problem, options: GlobalOptions) -> str | None:
    """Starts by dynamic programming serve only what that method serves; differences know no rest."""
    if why := unserved(problem, options):
        return why
    if "dynamic_programming" not in STARTS[options.starts]:
        return None
    why = dynamic_programming.dynamic_programming.why_not(rough(problem))
    return why and f"method.global.starts = {options.starts}: {why}; starts = roadmap serves every problem"


global_planner = Method("global", "Planner's optimum", "#2F855A", GlobalOptions, ANY, solve, refuses)


def _good(optimum: Optimum) -> bool:
    return optimum.converged and optimum.continuous


def _said(problem: Problem, asked: int, options: GlobalOptions, motions: list[Array]) -> str:
    """That the grid is not the one that was asked for, and not the one that would do."""
    count = len(problem.times) - 1
    said = f"on {count} intervals: the {asked} of timing.steps are too few for path.tolerance" * (count > asked)
    more = options.refine_to is not None and finer(problem, MOST, motions) is not None
    return "; ".join(filter(None, [said, f"method.global.refine_to = {options.refine_to} allows no more" * more]))


def _starts(
    problem: Problem, coarse: Array, options: GlobalOptions, rng: np.random.Generator
) -> tuple[Array, dict[str, Any]]:
    """The motions (K, N + 1, n) to optimise on the coarse grid, and how they came about."""
    parts: list[Array] = []
    log: dict[str, Any] = {}
    revolute = problem.task.arm.description.revolute
    wanted = STARTS[options.starts]
    if "roadmap" in wanted:
        paths = Roadmap(options.nodes, options.layers, options.optimised).starts(problem, coarse, rng)
        log["roadmap_paths"] = len(paths)
        parts.append(paths)
        if not len(paths):  # nothing within the limits or clear of obstacles: what comes nearest is the solver's to say
            wanted = ("population",)
    if "population" in wanted:
        configurations = starting_points(problem, options.configurations, rng, options.draw)
        count = options.candidates or (len(coarse) * problem.task.arm.n) ** 2
        motions = population(problem, coarse, configurations, count, rng)
        log |= {"configurations": len(configurations), "drawn": count, "candidates": len(motions)}
        if len(motions):
            costs = ranking(problem, coarse, motions, options.limit_weight)
            parts.append(motions[diverse(motions, costs, options.optimised, options.same_path, revolute)])
    if "dynamic_programming" in wanted:
        paths = dynamic_programming.starts(problem, coarse)
        log["dynamic_programming_paths"] = len(paths)
        parts.append(paths)
    empty = np.empty((0, len(coarse), problem.task.arm.n))
    return np.concatenate(parts) if parts else empty, log


def _optimise_starts(
    problem: Problem, grid: Array, options: GlobalOptions, motions: Array, batch: Batch | None, context: Context
) -> list[Optimum]:
    best = np.inf

    def done(count: int, optimum: Optimum) -> None:
        nonlocal best
        best = min(best, optimum.cost) if optimum.converged else best
        context.progress(count, len(motions), best)

    if batch is None:
        return context.workers.map(optimise_start, (problem, grid, options), list(motions), done)
    firsts = batch.coarse(grid, motions)
    if not any(first.converged for first in firsts):
        # IPOPT's restoration leaves motions that break limits for others farther away.
        return _optimise_starts(problem, grid, options, motions[:ELASTIC_STARTS], None, context)
    if batch.first is problem:
        for count, first in enumerate(firsts, 1):
            done(count, first)
        return firsts
    # Where starts have come to the same motion, one of them goes on for all.
    solved = [first for first in firsts if first.converged]
    chosen = [solved[index] for index in _distinct(solved, options, problem)]
    served = batch.further(grid, chosen)
    left = [first for first, optimum in zip(chosen, served, strict=True) if optimum is None]
    others = iter(context.workers.map(go_on, (problem, grid, options), left, done))
    further = [next(others) if optimum is None else optimum for optimum in served]
    for count, optimum in enumerate(filter(None, served), len(left) + 1):
        done(count, optimum)
    return [further[_nearest(problem, first, chosen)] if first.converged else first for first in firsts]


def _nearest(problem: Problem, optimum: Optimum, others: list[Optimum]) -> int:
    """Which of the others' motions is nearest."""
    apart = wrap(np.array([other.q for other in others]) - optimum.q, problem.task.arm.description.revolute)
    return int(np.abs(apart).max(axis=(1, 2)).argmin())


def _refine_all(
    problem: Problem,
    grids: list[Array],
    options: GlobalOptions,
    basins: list[Optimum],
    batch: Batch | None,
    context: Context,
) -> list[Optimum]:
    """Every basin on the last grid: in one batch, and those that it does not finish one by one."""
    refined = [None] * len(basins) if batch is None else batch.refine(grids, basins)
    left = [basin for basin, optimum in zip(basins, refined, strict=True) if optimum is None]
    others = iter(context.workers.map(refine, (problem, grids, options), left))
    return [next(others) if optimum is None else optimum for optimum in refined]


def _to_the_end(
    problem: Problem,
    grids: list[Array],
    options: GlobalOptions,
    basins: list[Optimum],
    batch: Batch | None,
    context: Context,
) -> tuple[Problem, list[Array], list[Optimum]]:
    """Every basin on the last grid, and on finer ones while a motion leaves its path between knots; the problem is then
    the one on these.
    """
    refined = _refine_all(problem, grids, options, basins, batch, context)
    while (parted := finer(problem, options.refine_to, [fine.q for fine in refined if _good(fine)])) is not None:
        problem, grids = replace(problem, times=parted), [*grids, parted]
        again = [fine for fine in refined if _good(fine)]
        batch = batch and Batch(problem, options)
        newer = iter(_refine_all(problem, grids[-2:], options, again, batch, context))
        refined = [next(newer) if _good(fine) else fine for fine in refined]
    return problem, grids, refined


def _basins(problem: Problem, starts: list[Optimum], options: GlobalOptions) -> list[int]:
    """Indices of the starts that stand for the distinct optima of the coarse grid, best first."""
    solved = [index for index, start in enumerate(starts) if start.converged]
    return [solved[index] for index in _distinct([starts[index] for index in solved], options, problem)]


def _distinct(optima: list[Optimum], options: GlobalOptions, problem: Problem) -> list[int]:
    if not optima:
        return []
    motions, costs = np.array([o.q for o in optima]), np.array([o.cost for o in optima])
    return distinct(motions, costs, len(optima), options.same_path, problem.task.arm.description.revolute)


def _members(problem: Problem, optimum: Optimum, starts: list[Optimum], options: GlobalOptions) -> int:
    """How many starts fell into the basin of one coarse optimum."""
    solved = [start.q - optimum.q for start in starts if start.converged]
    revolute = problem.task.arm.description.revolute
    return int((np.abs(wrap(np.array(solved), revolute)).max(axis=(1, 2)) <= options.same_path).sum())


def _nothing(problem: Problem, status: Status, message: str, log: dict[str, Any]) -> Solution:
    standing = np.tile(problem.q_init, (len(problem.times), 1))
    return Solution("global", Trajectory(problem.times, standing), status, message, statistics=log, found=False)


def _relaxed(problem: Problem, times: Array, motions: Array) -> Relaxed | None:
    if not problem.constrained:
        return None
    return least_violation(problem, times, list(motions[:ELASTIC_STARTS]))
