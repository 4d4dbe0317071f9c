"""The front of a path's tolerance against cost: the cheapest motion on the path, and in tubes about it.

Tolerances are shares of path.tolerance, in equal ratios down to a hundredth of it, and so are those of the orientation.
A point starts from the best optima on the path and, where it does not gain by its room, from the tube before it.
"""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np

from pipeline.common.arrays import Array
from pipeline.config.methods import GlobalOptions, ParetoOptions
from pipeline.methods.global_planner.optimum import confirmed
from pipeline.methods.global_planner.planner import global_planner
from pipeline.methods.global_planner.smooth import Smooth, exactly, refine
from pipeline.methods.method import Context
from pipeline.problem.limits import LIMIT_KINDS
from pipeline.problem.problem import Problem
from pipeline.problem.solution import Solution, Status, Trajectory

TOLERANCE = "path_tolerance"
RANGE = 100  # the largest tolerance over the smallest
ATTEMPTS = 2  # optima on the path from which a point starts


def refuses(problem: Problem, options: ParetoOptions) -> str | None:
    """The path need not be kept exactly, and its timing is given."""
    words = f"method.pareto.objectives = [{', '.join(options.objectives)}]"
    if problem.reference.exact:
        return f"{words}: its points leave the path by up to path.tolerance; set path.exact=false"
    if problem.free_timing:
        return f"{words}: its points all have the timing that is given, not one that is found"
    if options.planner.transcription == "differences":
        return f"{words}: its motions are smooth curves; method.global.transcription = differences has none"
    return global_planner.why_not(_of(problem, options), options.planner)


def solve(problem: Problem, options: ParetoOptions, context: Context) -> list[Solution]:
    """The front's motions, the one on the path first. The first's statistics hold `front`, a row per point."""
    asked = _of(problem, options)
    shares = np.geomspace(1 / RANGE, 1.0, options.steps)
    kept = global_planner(exactly(_within(asked, float(shares[0]))), _splined(options.planner), context)
    if kept[0].status is not Status.SOLVED:
        return [replace(kept[0], method="pareto", message=f"no motion on the path was found: {kept[0].message}")]
    asked = replace(asked, times=kept[0].trajectory.time)
    begun = [solution.trajectory.q for solution in kept[:ATTEMPTS]]
    items = [(share, motion) for share in shares.tolist() for motion in begun]
    answers = context.workers.map(_point, (asked, options.planner), items)
    points = [min(answers[i : i + len(begun)], key=_rank) for i in range(0, len(answers), len(begun))]
    points = descending((asked, options.planner), shares, points, float(kept[0].statistics["cost"]))
    name = next(one for one in options.objectives if one != TOLERANCE)
    first = kept[0]
    on_path = exactly(_within(asked, float(shares[0]))).reference
    rows = [_row(1, TOLERANCE, "", np.inf, "success", True)]
    solutions = [replace(first, method="pareto", optimum=1, reference=on_path, statistics={})]
    for rank, (point, share) in enumerate(zip(points, shares.tolist(), strict=True), 2):
        reference, last = _within(asked, share).reference, rank == len(points) + 1
        rows.append(_row(rank, name, TOLERANCE, reference.tolerance, point.status, point.converged, last))
        if point.converged:
            path = Trajectory(point.curve.times, point.curve.q, point.curve.ends)
            told = confirmed(point.solves)
            kinds = {"limits_kept": LIMIT_KINDS, "evidence": told, "reference": reference}
            solutions.append(Solution("pareto", path, Status.SOLVED, optimum=rank, **kinds))  # type: ignore[arg-type]
    solutions[0].statistics.update({"front": rows, "objectives": list(options.objectives)})
    return solutions


def descending(
    context: tuple[Problem, GlobalOptions], shares: Array, points: list[Smooth], on_path: float
) -> list[Smooth]:
    """The points, none dearer than one before it, whose tube lies within its own: else it is sought again from there,
    and if that is of no use it is none. on_path: the cost of the motion on the path.
    """
    narrower, least, found = None, on_path, list[Smooth]()
    for share, point in zip(shares.tolist(), points, strict=True):
        if narrower is not None and not (point.converged and point.cost <= least):
            point = min(point, _point(context, (share, narrower.curve.q)), key=_rank)
        if point.converged and point.cost > least:
            point = replace(point, converged=False, status="dearer than in a narrower tube")
        if point.converged:
            narrower, least = point, point.cost
        found.append(point)
    return found


def _row(
    rank: int, name: str, bounded: str, bound: float, status: str, good: bool, extreme: bool = True
) -> dict[str, Any]:
    return {
        "point": rank,
        "direction": f"minimise:{name}",
        "bounded": bounded,
        "bound": bound,
        "solver_status": status,
        "path_class": int(good),
        "extreme": extreme,
    }


def _of(problem: Problem, options: ParetoOptions) -> Problem:
    """The problem with the other objective."""
    weights: dict[str, float] = {name: 1.0 for name in options.objectives if name != TOLERANCE}
    return replace(problem, objective=replace(problem.objective, weights=weights))


def _within(problem: Problem, share: float) -> Problem:
    """The problem with so much of its tolerances."""
    return replace(problem, reference=problem.reference.within(share))


def _splined(options: GlobalOptions) -> GlobalOptions:
    return replace(options, transcription="spline")


def _point(context: tuple[Problem, GlobalOptions], item: tuple[float, Array]) -> Smooth:
    """The cheapest motion near another one, in a tube of so much of the tolerances."""
    problem, options = context
    share, motion = item
    return refine((_within(problem, share), options), motion)


def _rank(point: Smooth) -> tuple[bool, float]:
    return not point.converged, point.cost
