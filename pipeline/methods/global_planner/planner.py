"""The interpolation-based Global Kinematic Planner (Global paper Section 3): many coarse starts, every optimum refined.

Motions come from a roadmap over the self-motion manifolds (`search/roadmap.py`), or from a ranked population as in the
paper (`search/population.py`). They are optimised on a coarse grid, and each distinct optimum is carried to the wanted
knots by cubic splines, halving the step. What is listed are the optima found from so many starts, not all there are.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np
from scipy.interpolate import CubicSpline

from pipeline.common.arrays import Array
from pipeline.config.methods import GlobalOptions
from pipeline.methods.global_planner import reasons
from pipeline.methods.global_planner.apart import AGAIN, FEW, LOST, apart, blamed, keeps_own, without_own
from pipeline.methods.global_planner.basins import Basins, basins, ceiling, nearest
from pipeline.methods.global_planner.batch import JUMPS, Batch
from pipeline.methods.global_planner.grids import coarsest, finer, on_knots, refinement, served
from pipeline.methods.global_planner.optimum import Optimum, go_on, optimise_start, refine
from pipeline.methods.global_planner.ranking import in_order
from pipeline.methods.global_planner.smooth import exactly, freer, nothing, rough, smooth, splined, unserved
from pipeline.methods.global_planner.starts import Known, Starts
from pipeline.methods.global_planner.timed import timed
from pipeline.methods.global_planner.tube import loosened
from pipeline.methods.method import ALONG_LOOPS, WITH_TIMING, Context, Method
from pipeline.problem.limits import LIMIT_KINDS
from pipeline.problem.problem import Problem
from pipeline.problem.resolution import MOST
from pipeline.problem.solution import Solution, Status, Trajectory
from pipeline.program.feasibility import Relaxed, least_violation

TRACKING = 1e-8  # [m] what an optimum must keep at every knot
ELASTIC_STARTS = 3  # from how many motions IPOPT seeks a motion, and the least violation, when Newton found none
FEWER = 12  # starts on a finer grid after none succeeded on the coarse one
STEPS = 25  # intervals of the coarsest grid: 12 miss optima
STEPS_ALONE = 12  # where each start costs a solve of its own
DEAREST = 3.5  # times the best: dearer optima are not refined, nor does it count that they are new
MOST_SOLVED = 30_000  # intervals of all starts on the coarsest grid: on a longer one there are fewer
HOPELESS = 0.1  # relative violation on a coarse grid from which on finer ones are not tried


def solve(problem: Problem, options: GlobalOptions, context: Context, known: Known | None = None) -> list[Solution]:
    """The distinct optima found from these starts, best first; `known`: from these motions alone."""
    if not splined(problem, options):
        if problem.reference.exact:
            return by_differences(problem, options, context, known)
        return loosened(problem, by_differences(exactly(problem), options, context), options, context)
    first = (freer if problem.free_timing else rough)(problem)
    found = by_differences(first, options, context, known)
    if not found[0].found and first.constrained and not problem.free_timing and LOST not in found[0].statistics:
        again = by_differences(freer(problem), options, context, known)
        found = max(found, again, key=lambda motions: motions[0].found)
    if found[0].found:  # on the knots that the path needs
        problem = replace(problem, times=found[0].trajectory.time)
    if problem.free_timing:
        return timed(problem, found, options, context) if found[0].found else found
    return smooth(problem, found, options, context)


def by_differences(
    problem: Problem, options: GlobalOptions, context: Context, known: Known | None = None
) -> list[Solution]:
    """The same on the knots alone, as the papers have it.

    Of the arm itself only the starts keep clear; of the optima those that come too near to it are solved again. Where
    none of them is left, all is.
    """
    return _searched(problem, without_own(problem) if keeps_own(problem) else problem, options, context, known)


def _searched(
    given: Problem, problem: Problem, options: GlobalOptions, context: Context, known: Known | None
) -> list[Solution]:
    """The optima of `problem` from starts of the given one, then solved as that; where all are lost, of that alone."""
    posed, afterwards = given, given is not problem
    why = Batch.without(problem, options)
    times, too_coarse = on_knots(problem, options.refine_to)
    if too_coarse:
        return [nothing(problem, Status.NOT_CONVERGED, too_coarse, {})]
    asked = len(problem.times) - 1
    given, problem = replace(given, times=times), replace(problem, times=times)
    shape = coarsest(problem, options.coarse_steps, STEPS if why is None else STEPS_ALONE)
    grids = refinement(times, shape, shape if options.coarse_steps is None else 2)
    context.phase("drawing starts")
    drawn = Starts(given, grids[0], options, np.random.default_rng(context.seed), known)
    motions, log = drawn.first, drawn.log
    if not len(motions):
        why_none = log.get("barred") or reasons.no_start(problem, log.get("drawn", 0))
        return [nothing(problem, Status.INFEASIBLE, why_none, log)]

    batch = Batch(problem, options) if why is None else None
    context.phase(f"solving them on {len(grids[0]) - 1} intervals")
    log["solver"] = f"ipopt ({why})" if batch is None else batch.words
    while True:
        starts = _optimise_starts(problem, grids[0], options, motions, batch, context)
        if any(start.converged for start in starts):
            break
        if grids[0] is drawn.grid and (barred := reasons.no_place(problem, grids[0])):
            return [nothing(problem, Status.INFEASIBLE, barred, log)]
        relaxed = _relaxed(problem, grids[0], motions)
        if relaxed is not None and relaxed.feasible:
            starts += context.workers.map(optimise_start, (problem, grids[0], options), [relaxed.q])
            if starts[-1].converged:
                break
        elif relaxed is not None and (relaxed.worst.relative > HOPELESS or len(grids) == 1):
            return [nothing(problem, Status.INFEASIBLE, reasons.no_feasible(len(motions), relaxed), log)]
        if len(grids) == 1:
            break
        # A coarse grid can be infeasible where a finer one is not: its finite differences are other numbers.
        motions, grids = CubicSpline(grids[0], motions[:FEWER], axis=1)(grids[1]), grids[1:]
    if batch is None or not batch.cheap:  # a start costs a solve of its own: one lot of them must do
        coarse = basins(problem, grids[0], starts, options.same_path)
    else:
        starts, coarse = _draw_on(problem, options, drawn, grids[0], starts, batch, context)
    log["starts"] = [
        {"converged": start.converged, "cost": start.cost, "status": start.status, "solves": start.solves}
        for start in starts
    ]
    log["barren_starts"] = coarse.barren
    context.phase("refining and confirming")
    before, refined = (problem, grids), list[Optimum]()
    most = FEW if keeps_own(problem) else len(coarse.optima)
    while len(refined) < min(most, len(coarse.optima)) and not any(map(_good, refined)):
        lot = coarse.optima[len(refined) : min(most, len(refined) + served(before[0]))]
        problem, grids, fine_ones = _to_the_end(*before, options, lot, batch, context)
        refined += fine_ones
    log["grids"] = [len(grid) - 1 for grid in grids]
    log["optima_left_coarse"] = left = len(coarse.optima) - len(refined)
    found = [(fine, members) for fine, members in zip(refined, coarse.members, strict=False) if _good(fine)]
    if options.refine_to is not None:  # the grid is that of the best: others may need a finer one, or jump on any
        best = min((fine.cost for fine, _ in found), default=np.inf)
        sent = [pair for pair in found if pair[0].cost == best or finer(problem, MOST, [pair[0].q]) is None]
        log["optima_off_path"], found = len(found) - len(sent), sent
    lost = 0
    if afterwards and found:
        problem, near = replace(given, times=problem.times), [fine for fine, _ in found]
        clear = apart(problem, near, options, context)
        found = [(fine, members) for fine, (_, members) in zip(clear, found, strict=True) if _good(fine)]
        log[LOST] = lost = len(near) - len(found)
        if not found:
            context.phase("keeping the arm off itself")
            options = replace(options, max_iterations=min(options.max_iterations, AGAIN))
            return blamed(problem, near, _searched(posed, posed, options, context, known))
    log["jumping_optima"] = coarse.jumping + sum(fine.converged and not fine.continuous for fine in refined)
    if not found:
        why_not = reasons.no_optimum(problem, grids[0], starts, refined, coarse.jumping)
        return [nothing(problem, Status.NOT_CONVERGED, why_not, log)]
    members = {id(fine): count for fine, count in found}
    ranked = in_order(problem, basins(problem, problem.times, [fine for fine, _ in found], options.same_path).optima)
    words = reasons.counted(len(ranked), len(starts), coarse.barren, left, lost)
    solutions = []
    for rank, (fine, moved) in enumerate(ranked):
        said = reasons.on_how_many(problem, asked, options, [fine.q]) if rank == 0 else ""
        own = {"starts_in_basin": members[id(fine)], **(log if rank == 0 else {})}
        solution = as_solution(problem, fine, options)
        solutions.append(
            replace(
                solution,
                message="; ".join(filter(None, (said, moved))),
                optimum=rank + 1,
                evidence=(words if rank == 0 else "") + solution.evidence,
                statistics={**own, **solution.statistics},
            )
        )
    return solutions


def as_solution(problem: Problem, optimum: Optimum, options: GlobalOptions) -> Solution:
    """An optimum on the knots of the problem as an answer of the planner."""
    return Solution(
        "global",
        Trajectory(problem.times, optimum.q),
        Status.SOLVED,
        tracking_tolerance=TRACKING,
        limits_kept=LIMIT_KINDS,
        clear_between=options.refine_to is not None,
        knots_only=options.refine_to is None,
        evidence=optimum.evidence,
        statistics={"solves": optimum.solves},
    )


def finish(
    problem: Problem, times: Array, motions: Array, options: GlobalOptions, context: Context
) -> tuple[Array, list[Optimum]]:
    """The distinct optima, best first, to which motions (S, N + 1, n) on the knots `times` lead, and the knots that
    they are on: the problem's, or those that its path needs. Motions that are lost on the way are left out. Of the arm
    itself they are kept clear as `by_differences` does.
    """
    if not keeps_own(problem):
        return _finished(problem, times, motions, options, context)
    knots, good = _finished(without_own(problem), times, motions, options, context)
    if good:
        given = replace(problem, times=knots)
        good = [optimum for optimum in apart(given, good, options, context) if _good(optimum)]
        if not good:
            return _finished(problem, times, motions, options, context)
    return knots, basins(problem, knots, good, options.same_path).optima


def _finished(
    problem: Problem, times: Array, motions: Array, options: GlobalOptions, context: Context
) -> tuple[Array, list[Optimum]]:
    knots, too_coarse = on_knots(problem, options.refine_to)
    if too_coarse:
        return knots, []
    problem = replace(problem, times=knots)
    batch = Batch(problem, options) if Batch.without(problem, options) is None else None
    grids = [times, *(grid for grid in refinement(knots, len(times)) if len(grid) > len(times))]
    starts = _optimise_starts(problem, times, options, motions, batch, context)
    chosen = basins(problem, times, starts, options.same_path).optima
    problem, _, refined = _to_the_end(problem, grids, options, chosen, batch, context)
    good = [optimum for optimum in refined if _good(optimum)]
    return problem.times, basins(problem, problem.times, good, options.same_path).optima


def refuses(problem: Problem, options: GlobalOptions) -> str | None:
    """Starts by dynamic programming serve only what that method serves; differences know no rest."""
    if why := unserved(problem, options):
        return why
    if "dynamic_programming" not in options.generators:
        return None
    why, words = ALONG_LOOPS.why_not(rough(problem)), ", ".join(options.generators)
    said = f"method.global.starts = {words}: dynamic_programming: {why}; starts = roadmap serves every problem"
    return why and said


global_planner = Method("global", "Planner's optimum", "#2F855A", GlobalOptions, WITH_TIMING, solve, refuses)


def _good(optimum: Optimum) -> bool:
    return optimum.converged and optimum.continuous


def _cheapest(optima: list[Optimum]) -> list[Array]:
    """The motion of the best, if there is one."""
    good = [optimum for optimum in optima if _good(optimum)]
    return [min(good, key=lambda optimum: optimum.cost).q] if good else []


def _draw_on(
    problem: Problem,
    options: GlobalOptions,
    drawn: Starts,
    grid: Array,
    starts: list[Optimum],
    batch: Batch,
    context: Context,
) -> tuple[list[Optimum], Basins]:
    """Twice as many starts and again, until the last half of them brought nothing new or the budget is spent."""
    budget = min(options.budget, max(len(starts), MOST_SOLVED // (len(grid) - 1)))
    while True:
        motions = drawn.further(max(0, min(len(starts), budget - len(starts))), grid)
        if len(motions):
            dear = ceiling(min(start.cost for start in starts if start.converged), DEAREST)
            fresh, done = batch.coarse(grid, motions, dear), _teller(context, len(motions), starts)
            for count, start in enumerate(fresh, 1):
                done(count, start)
            starts = starts + fresh
        found = basins(problem, grid, starts, options.same_path, jumps=JUMPS, dearest=DEAREST)
        if not len(motions) or len(starts) >= budget or 2 * found.barren >= len(starts):
            return starts, found


def _teller(context: Context, count: int, before: Sequence[Optimum] = ()) -> Callable[[int, Optimum], None]:
    """What tells of each of `count` starts that come after those `before`."""
    best = min((start.cost for start in before if start.converged), default=np.inf)

    def done(number: int, optimum: Optimum) -> None:
        nonlocal best
        best = min(best, optimum.cost) if optimum.converged else best
        context.progress(len(before) + number, len(before) + count, best)

    return done


def _optimise_starts(
    problem: Problem, grid: Array, options: GlobalOptions, motions: Array, batch: Batch | None, context: Context
) -> list[Optimum]:
    done = _teller(context, len(motions))
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
    chosen = basins(problem, grid, firsts, options.same_path).optima
    served = batch.further(grid, chosen)
    left = [first for first, optimum in zip(chosen, served, strict=True) if optimum is None]
    others = iter(context.workers.map(go_on, (problem, grid, options), left, done))
    further = [next(others) if optimum is None else optimum for optimum in served]
    for count, optimum in enumerate(filter(None, served), len(left) + 1):
        done(count, optimum)
    return [further[nearest(problem, first, chosen)] if first.converged else first for first in firsts]


def _refine_all(
    problem: Problem,
    grids: list[Array],
    options: GlobalOptions,
    optima: list[Optimum],
    batch: Batch | None,
    context: Context,
) -> list[Optimum]:
    """Every optimum on the last grid: in one batch, and those that it does not finish one by one."""
    refined = [None] * len(optima) if batch is None else batch.refine(grids, optima)
    left = [before for before, optimum in zip(optima, refined, strict=True) if optimum is None]
    others = iter(context.workers.map(refine, (problem, grids, options), left))
    return [next(others) if optimum is None else optimum for optimum in refined]


def _to_the_end(
    problem: Problem,
    grids: list[Array],
    options: GlobalOptions,
    optima: list[Optimum],
    batch: Batch | None,
    context: Context,
) -> tuple[Problem, list[Array], list[Optimum]]:
    """Every optimum on the last grid, and on finer ones while the best leaves its path between knots; the problem is
    then the one on these.
    """
    refined = _refine_all(problem, grids, options, optima, batch, context)
    while (parted := finer(problem, options.refine_to, _cheapest(refined))) is not None:
        problem, grids = replace(problem, times=parted), [*grids, parted]
        again = [fine for fine in refined if _good(fine)]
        batch = batch and Batch(problem, options)
        newer = iter(_refine_all(problem, grids[-2:], options, again, batch, context))
        refined = [next(newer) if _good(fine) else fine for fine in refined]
    return problem, grids, refined


def _relaxed(problem: Problem, times: Array, motions: Array) -> Relaxed | None:
    if not problem.constrained:
        return None
    return least_violation(problem, times, list(motions[:ELASTIC_STARTS]))
