"""Pareto fronts of two integrals by the epsilon-constraint method (Global paper Section 4.3), or by weighting.

The extremes are the optima of the global planner for each objective alone. Then, in k equal steps of each interval, one
integral is minimised with the other bounded, in both directions (eqs (21), (22); (21) bounds the torques, (22) the
energy). Every point starts from all optima known so far and then from its neighbours on both sides, until no point
improves, so that a front that jumps between classes of paths is followed.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from scipy.cluster.hierarchy import fcluster, linkage
from scipy.spatial.distance import squareform

from pipeline.common.arrays import Array
from pipeline.config.methods import ParetoOptions
from pipeline.methods import duration_front, tolerance_front
from pipeline.methods.global_planner.grids import finer
from pipeline.methods.global_planner.optimum import stays_on_path
from pipeline.methods.global_planner.planner import TRACKING, global_planner
from pipeline.methods.method import ON_KNOTS, WITH_TIMING, Context, Method
from pipeline.problem.costs import integrals
from pipeline.problem.limits import LIMIT_KINDS
from pipeline.problem.objective import Objective
from pipeline.problem.problem import Problem
from pipeline.problem.solution import Solution, Status, Trajectory
from pipeline.program.ipopt import STOPPED
from pipeline.program.transcription import transcribe
from pipeline.search.selection import path_distance

SAME_CLASS = 0.6  # [rad] neighbouring points of one class of paths differ by less at every knot


VANISHING = "base_rotation"  # can be zero along a whole path, where redundancy is left for it


LITTLE = 1e-4  # of the other integral in its extreme


IMPROVED = 1e-7  # relative: a smaller gain is none


@dataclass(frozen=True)
class Point:
    """One program of the front: minimise `weights`, the integral `bounded` at most `bound`; its best motion so far."""

    direction: str  # minimise:<integral>, or weights
    weights: tuple[float, float]
    bounded: str | None
    bound: float
    q: Array | None = None
    values: tuple[float, float] = (np.inf, np.inf)
    converged: bool = False
    status: str = "not solved"

    @property
    def final(self) -> bool:
        """Whether it would come out the same again: no clock has stopped its solve."""
        return self.status != STOPPED

    @property
    def cost(self) -> float:
        return self.weights[0] * self.values[0] + self.weights[1] * self.values[1]


def solve(problem: Problem, options: ParetoOptions, context: Context) -> list[Solution]:
    """The front's motions, from one extreme to the other, on the planner's knots or finer ones where one of them would
    leave its path. The first's statistics hold `front`, a row per point.
    """
    if duration_front.DURATION in options.objectives:
        return duration_front.solve(problem, options, context)
    if tolerance_front.TOLERANCE in options.objectives:
        return tolerance_front.solve(problem, options, context)
    options = _by_differences(options)
    while True:
        solutions = _front(problem, options, context)
        time = solutions[0].trajectory.time
        motions = [solution.trajectory.q for solution in solutions if solution.status is Status.SOLVED]
        times = finer(replace(problem, times=time), options.planner.refine_to, motions)
        if times is None:
            return solutions
        problem = replace(problem, times=times)


def _by_differences(options: ParetoOptions) -> ParetoOptions:
    """The points of a front are by differences, and so are the planner's motions unless a spline is asked for."""
    planner = options.planner
    return replace(options, planner=replace(planner, transcription=planner.transcription or "differences"))


def _front(problem: Problem, options: ParetoOptions, context: Context) -> list[Solution]:
    first, second = options.objectives
    known: list[Array] = []
    found: dict[str, Point] = {}
    for own in sorted((first, second), key=lambda name: name == VANISHING):
        other = second if own == first else first
        objective = Objective({own: 1.0})
        if own == VANISHING and other in found:
            objective = _kept_unique(own, other, found[other], options)
        optima = global_planner(replace(problem, objective=objective), options.planner, context)
        if optima[0].status is not Status.SOLVED:
            message = f"the extreme of {own} was not found: {optima[0].message or optima[0].status.value}"
            return [replace(optima[0], method="pareto", message=message)]
        if len(optima[0].trajectory.time) > len(problem.times):  # all points on the same knots
            return _front(replace(problem, times=optima[0].trajectory.time), options, context)
        known += [optimum.trajectory.q for optimum in optima]
        weights = (1.0, 0.0) if own == first else (0.0, 1.0)
        q = optima[0].trajectory.q
        found[own] = Point(f"minimise:{own}", weights, None, np.inf, q, _values(problem, options, q), True, "success")
    extremes = [found[first], found[second]]
    best = np.array([extremes[0].values[0], extremes[1].values[1]])
    worst = np.array([extremes[1].values[0], extremes[0].values[1]])
    if not np.all(worst - best > IMPROVED * np.abs(best)):
        return _report(problem, extremes, options)  # one motion is best in both: there is nothing to trade
    between = replace(problem, objective=_weighted(options, 1 / (worst - best)))
    compromises = global_planner(between, replace(options.planner, refine_to=None), context)
    known += [solution.trajectory.q for solution in compromises if solution.status is Status.SOLVED]

    points = _points(options, best, worst)
    points = _try(problem, options, points, [(i, q) for i in range(len(points)) for q in known], context)
    for _ in range(options.rounds):
        pairs = _neighbours(points)
        improved = _try(problem, options, points, pairs, context)
        gained = any(
            new.cost < old.cost * (1 - IMPROVED) or new.converged > old.converged
            for new, old in zip(improved, points, strict=True)
        )
        points = improved
        if not gained:
            break
    return _report(problem, [extremes[0], *points, extremes[1]], options)


def refuses(problem: Problem, options: ParetoOptions) -> str | None:
    """Two integrals make a front, and the planner must serve each of them."""
    if len(options.objectives) != 2:
        return f"method.pareto.objectives = [{', '.join(options.objectives)}]: a front is one of two integrals"
    if duration_front.DURATION in options.objectives:
        if tolerance_front.TOLERANCE in options.objectives:
            return "method.pareto.objectives = [duration, path_tolerance]: one of them goes with an integral"
        return duration_front.refuses(problem, options)
    if tolerance_front.TOLERANCE in options.objectives:
        return tolerance_front.refuses(problem, options)
    if why := ON_KNOTS.why_not(problem):
        return why
    each = (replace(problem, objective=Objective({name: 1.0})) for name in options.objectives)
    return next((why for own in each if (why := global_planner.why_not(own, _by_differences(options).planner))), None)


pareto = Method("pareto", "Pareto point", "#2F855A", ParetoOptions, WITH_TIMING, solve, refuses)


def _points(options: ParetoOptions, best: Array, worst: Array) -> list[Point]:
    """The programs between the extremes; the last step of each direction is the extreme itself."""
    first, second = options.objectives
    fraction = np.arange(1, options.steps) / options.steps
    if options.method == "weighting":
        scale = 1 / (worst - best)
        return [
            Point("weights", ((1 - f) * scale[0], f * scale[1]), None, np.inf)
            for f in np.arange(1, 2 * options.steps - 1) / (2 * options.steps - 1)
        ]
    down = [
        Point(f"minimise:{first}", (1.0, 0.0), second, float(best[1] + f * (worst[1] - best[1])))
        for f in fraction[::-1]
    ]
    up = [Point(f"minimise:{second}", (0.0, 1.0), first, float(best[0] + f * (worst[0] - best[0]))) for f in fraction]
    return down + up


def _neighbours(points: Sequence[Point]) -> list[tuple[int, Array]]:
    """Each point with the motions of the points before and after it, by the value of the first integral."""
    solved = sorted((i for i, point in enumerate(points) if point.converged), key=lambda i: points[i].values[0])
    pairs = []
    for rank, i in enumerate(solved):
        pairs += [(i, points[solved[other]].q) for other in (rank - 1, rank + 1) if 0 <= other < len(solved)]
    open_points = [i for i, point in enumerate(points) if not point.converged]
    pairs += [(i, points[j].q) for i in open_points for j in solved]
    return [(i, q) for i, q in pairs if q is not None]


def _try(
    problem: Problem,
    options: ParetoOptions,
    points: list[Point],
    pairs: list[tuple[int, Array]],
    context: Context,
) -> list[Point]:
    """Solve point i from motion q for all pairs (i, q); keep the better motion of each."""
    best = list(points)

    def done(count: int, found: Point) -> None:
        context.progress(count, len(pairs), found.cost)

    items = [(replace(points[i], q=None, values=(np.inf, np.inf)), q) for i, q in pairs]
    for (i, _), found in zip(pairs, context.workers.map(_solve_point, (problem, options), items, done), strict=True):
        better = found.converged and (not best[i].converged or found.cost < best[i].cost * (1 - 1e-12))
        if better or best[i].q is None:
            best[i] = found
    return best


def _solve_point(shared: tuple[Problem, ParetoOptions], item: tuple[Point, Array]) -> Point:
    (problem, options), (point, guess) = shared, item
    bounds = {} if point.bounded is None else {point.bounded: point.bound}
    objective = _objective(options, point.weights)
    stated = replace(problem, objective=objective, bounds_of_integrals=bounds)
    q, outcome, _ = transcribe(stated, problem.times, guess).solve(
        tolerance=options.tolerance, max_iterations=options.max_iterations, max_time=options.max_time
    )
    converged = outcome.converged and stays_on_path(problem, problem.times, q)
    return replace(point, q=q, values=_values(problem, options, q), converged=converged, status=outcome.status)


def _values(problem: Problem, options: ParetoOptions, q: Array) -> tuple[float, float]:
    costs = integrals(problem, problem.times, q)
    first, second = (costs.integrals[name] for name in options.objectives)
    return first, second


def _kept_unique(own: str, other: str, extreme: Point, options: ParetoOptions) -> Objective:
    """`own` with a little of the other integral: many motions can bring it to zero, and of those one is wanted.

    extreme: the other's optimum, at which both integrals set the scale.
    """
    values: dict[str, float] = dict(zip(options.objectives, extreme.values, strict=True))
    return Objective({own: 1.0, other: LITTLE * values[own] / values[other]})


def _objective(options: ParetoOptions, weights: tuple[float, float]) -> Objective:
    return Objective(dict(zip(options.objectives, weights, strict=True)))


def _weighted(options: ParetoOptions, weights: Array) -> Objective:
    return Objective(dict(zip(options.objectives, (weights / weights.sum()).tolist(), strict=True)))


def _report(problem: Problem, points: Sequence[Point], options: ParetoOptions) -> list[Solution]:
    order = sorted(range(len(points)), key=lambda i: (not points[i].converged, points[i].values))
    solved = [i for i in order if points[i].converged]
    classes = _classes(problem, [q for i in solved if (q := points[i].q) is not None])
    rows: list[dict[str, Any]] = []
    solutions = []
    for rank, i in enumerate(order):
        point = points[i]
        row = {
            "point": rank + 1,
            "direction": point.direction,
            "bounded": point.bounded or "",
            "bound": point.bound,
            "solver_status": point.status,
            "path_class": classes[rank] if point.converged else 0,
            "extreme": point.bounded is None and point.direction != "weights",
        }
        rows.append(row)
        if point.converged and point.q is not None:
            solutions.append(
                Solution(
                    "pareto",
                    Trajectory(problem.times, point.q),
                    Status.SOLVED,
                    optimum=rank + 1,
                    tracking_tolerance=TRACKING,
                    limits_kept=LIMIT_KINDS,
                    knots_only=options.planner.refine_to is None,
                )
            )
    solutions[0].statistics.update({"front": rows, "objectives": list(options.objectives)})
    return solutions


def _classes(problem: Problem, motions: Sequence[Array]) -> list[int]:
    """Classes of paths (1, 2, ... in the order of the front): motions linked by steps smaller than SAME_CLASS."""
    if len(motions) < 2:
        return [1] * len(motions)
    revolute = problem.task.arm.description.revolute
    distance = np.array([[path_distance(a, b, revolute) for b in motions] for a in motions])
    label = fcluster(linkage(squareform(distance, checks=False), "single"), SAME_CLASS, "distance")
    number = {name: rank + 1 for rank, name in enumerate(dict.fromkeys(label.tolist()))}
    return [number[name] for name in label.tolist()]
