"""The front of motion time against cost: the cheapest motion under the cheapest law, from the shortest time on.

With the law free a motion in more time costs less, so that its time is the only bound that a point needs.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from pipeline.config.methods import GlobalOptions, ParetoOptions
from pipeline.methods.global_planner.optimum import confirmed
from pipeline.methods.global_planner.planner import global_planner
from pipeline.methods.global_planner.smooth import Searches, promised
from pipeline.methods.global_planner.timed import Record, cheapest, recorded
from pipeline.methods.method import Context
from pipeline.path.reference import Reference
from pipeline.problem.limits import LIMIT_KINDS
from pipeline.problem.problem import Problem
from pipeline.problem.solution import Solution, Status, Trajectory
from pipeline.program.spline.curve import Curve

DURATION = "duration"


def refuses(problem: Problem, options: ParetoOptions) -> str | None:
    """The law must be free, and the front goes up to a time that is given."""
    if not problem.free_law or problem.free_duration:
        return (
            f"method.pareto.objectives = [{', '.join(options.objectives)}]: its points have laws of their own, from "
            "the shortest time to timing.duration; set timing=optimal and a timing.duration in s"
        )
    return global_planner.why_not(_of(problem, options), options.planner)


def solve(problem: Problem, options: ParetoOptions, context: Context) -> list[Solution]:
    """The front's motions, the slowest first. The first's statistics hold `front`, a row per point."""
    asked, longest = _of(problem, options), problem.reference.duration
    fastest = global_planner(replace(asked, free_duration=True), options.planner, context)[0]
    if fastest.status is not Status.SOLVED or fastest.reference is None:
        return [replace(fastest, method="pareto", message=f"the shortest time was not found: {fastest.message}")]
    shortest = fastest.reference.duration
    if shortest >= longest:
        why = f"timing.duration = {longest:g} s is less than the shortest feasible duration found, {shortest:.4g} s"
        return [replace(fastest, method="pareto", status=Status.INFEASIBLE, message=why, reference=None, found=False)]
    durations = np.geomspace(shortest, longest, options.steps + 1)[1:]
    begun = fastest.trajectory
    records = context.workers.map(_point, (asked, options.planner, fastest.reference, begun), durations.tolist())
    references = [record.reference(asked) for record in records]
    points = [(fastest.trajectory, fastest.reference, True, "success", fastest.evidence)]
    for record, own in zip(records, references, strict=True):
        curve = record.curve
        path = Trajectory(curve.times, curve.q, curve.ends)
        points.append((path, own, record.converged, record.status, confirmed(record.solves)))
    points.reverse()
    rows, solutions = [], []
    times = [*durations[::-1].tolist(), shortest]
    name = next(one for one in options.objectives if one != DURATION)
    for rank, ((path, own, good, status, evidence), time) in enumerate(zip(points, times, strict=True), 1):
        last, first = rank == len(points), rank == 1
        rows.append(
            {
                "point": rank,
                "direction": f"minimise:{DURATION if last else name}",
                "bounded": "" if last else DURATION,
                "bound": np.inf if last else time,
                "solver_status": status,
                "path_class": int(good),
                "extreme": first or last,
            }
        )
        if good:
            solutions.append(
                Solution(
                    "pareto",
                    path,
                    Status.SOLVED,
                    optimum=rank,
                    tracking_tolerance=promised(problem),
                    limits_kept=LIMIT_KINDS,
                    evidence=evidence,
                    reference=own,
                )
            )
    solutions[0].statistics.update({"front": rows, "objectives": list(options.objectives)})
    return solutions


def _of(problem: Problem, options: ParetoOptions) -> Problem:
    """The problem with the other objective."""
    weights: dict[str, float] = {name: 1.0 for name in options.objectives if name != DURATION}
    return replace(problem, objective=replace(problem.objective, weights=weights))


def _point(context: tuple[Problem, GlobalOptions, Reference, Trajectory], duration: float) -> Record:
    """The cheapest motion in so much time [s], from the fastest one slowed down to it."""
    problem, options, reference, path = context
    by = duration / reference.duration
    begun = replace(problem, reference=reference, times=path.time).slowed(by)
    ends = None if path.ends is None else path.ends / by
    return recorded(cheapest(begun, Curve.through(begun, begun.times, path.q, ends), Searches(options)))
