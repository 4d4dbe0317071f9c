"""A bound from below on the cost of every motion on the knots of a grid (r = 1), beside the best motion found there.

The motion is found as the planner finds one (a roadmap's starts and Newton's method); the bound is that of cells on the
self-motion loops (`cover.py`). Each round halves the cells that may hold something better, and motions through them are
starts again: where the bound shows room, it is searched. The best motion is finished by the planner on its own knots.

It is a numerical bound. It holds for the sum on the grid's knots, for motions along the loops that were found, in
which no turning joint steps by more than LONGEST_STEP, and if no cost differs from its quadratic between the places
where it is looked at by more than MARGIN times what it does there (tests measure that). Interval arithmetic in place of
the last condition would make it a proof; its rigour would need the loops' own enclosures too.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from pipeline.common.arrays import Array
from pipeline.config.methods import GlobalOptions, LowerBoundOptions
from pipeline.methods.global_planner.planner import finish
from pipeline.methods.method import ALONG_LOOPS, Context, Method
from pipeline.problem.problem import Problem
from pipeline.problem.solution import Solution, Status, Trajectory
from pipeline.program.newton import serve
from pipeline.search.cover import Cover
from pipeline.search.pairs import LONGEST_STEP
from pipeline.search.prices import prices
from pipeline.search.roadmap import Roadmap
from pipeline.search.selection import diverse

TRACKING = 1e-8  # [m] what the motion keeps at every knot
STARTS = 64
ROUNDS = 16
MOST_LINKS = 2_500_000  # between cells of neighbouring knots
OPEN_ROUNDS = 2  # of a cyclic problem, before its ends are brought together
SEARCHED = 16  # motions from the cells that are left, each round
APART = 0.05  # [rad] between those
SLACK = 1e-9  # relative: what is dropped costs so much more than the incumbent


@dataclass(frozen=True)
class Incumbent:
    """The best motion known on the knots."""

    q: Array
    cost: float


def solve(problem: Problem, options: LowerBoundOptions, context: Context) -> list[Solution]:
    """One solution: the best motion found on the grid, finished on the problem's knots; in its statistics `cost` and
    `bound` on the grid and their relative `gap`.
    """
    own = len(problem.times) - 1
    intervals = min(options.intervals or own, own)
    times = np.interp(np.linspace(0, own, intervals + 1), np.arange(own + 1), problem.times)
    here = replace(problem, times=times)
    starts = Roadmap(here, times, np.random.default_rng(context.seed)).cheapest(STARTS)
    first = _best(here, starts)
    if first is None:
        standing = np.tile(problem.q_init, (len(times), 1))
        message = f"no motion on {intervals} intervals was found from {len(starts)} starts to hold a bound against"
        return [Solution("lower_bound", Trajectory(times, standing), Status.NOT_CONVERGED, message, found=False)]
    best, bound, rounds = first, -np.inf, []
    for cover, best in _rounds(here, options.cells, first):
        bound = max(bound, cover.least_cost)
        rounds.append({"links": len(cover.graph.begin), "bound": cover.least_cost, "cost": best.cost})
        if bound >= best.cost * (1 - options.gap):
            break
    bound = min(bound, best.cost)
    gap = 1 - bound / best.cost
    log: dict[str, Any] = {"intervals": intervals, "cost": best.cost, "bound": bound, "gap": gap}
    log |= {"cost_from_roadmap": first.cost, "rounds": rounds}
    context.progress(1, 1, best.cost)
    knots, finished = finish(problem, times, best.q[None], GlobalOptions(), context)
    return [
        Solution(
            "lower_bound",
            Trajectory(knots, finished[0].q) if finished else Trajectory(times, best.q),
            Status.SOLVED,
            sentence(intervals, best.cost, gap, first.cost, problem.task.arm.description.unit()),
            tracking_tolerance=TRACKING,
            knots_only=not finished,
            limits_kept=("position", "velocity"),
            statistics=log,
        )
    ]


def sentence(intervals: int, cost: float, gap: float, from_roadmap: float, unit: str = "rad") -> str:
    """What a gap (relative) means, with its conditions; and whether the planner's starts led to the motion."""
    said = (
        f"on {intervals} intervals no motion with joint steps below {LONGEST_STEP:g} {unit} costs more than "
        f"{percent(gap)} less than this one does there, {cost:.5g}; numerical bound"
    )
    if cost < from_roadmap * (1 - SLACK):
        said += f"; found where the bound showed room, the planner's starts led to {from_roadmap:.5g}"
    return said


def percent(gap: float) -> str:
    """Two digits, rounded up."""
    value = max(100 * gap, 1e-3)
    unit = 10.0 ** (np.floor(np.log10(value)) - 1)
    return f"{np.ceil(value / unit - 1e-9) * unit:.3g} %"


def refuses(problem: Problem, options: LowerBoundOptions) -> str | None:
    """What Newton's method does not serve has no motion to hold a bound against; and cells know neither obstacles nor
    forces.
    """
    limits = problem.bounds
    forces = bool(np.isfinite(limits.torque).any() or np.isfinite(limits.power).any())
    why = "obstacles" if problem.obstacles is not None else "torque or power limits" if forces else None
    why = why or serve.why_not(problem)
    return why and f"the problem has {why}; supported are limits of positions and velocities, and no other conditions"


lower_bound = Method(
    "lower_bound",
    "Best under a bound",
    "#7A5C9E",
    LowerBoundOptions,
    ALONG_LOOPS,
    solve,
    refuses,
)


def _rounds(problem: Problem, cells: int, first: Incumbent) -> Iterator[tuple[Cover, Incumbent]]:
    """The cover after each round, with the best motion known by then."""
    best = first
    cover = Cover(problem, problem.times, cells)
    for number in range(ROUNDS):
        cover.price(prices(problem, problem.times, best.q))
        cover.bound(best.cost)
        if number:
            best = _searched(problem, cover, best)
        yield cover, best
        limit = best.cost * (1 + SLACK)
        closing = not cover.finished and number + 1 >= OPEN_ROUNDS and cover.close(limit, 3 * MOST_LINKS)
        if closing:
            continue
        if cover.expected(limit) > MOST_LINKS or not cover.left(limit):
            return
        cover.refine(limit)


def _searched(problem: Problem, cover: Cover, best: Incumbent) -> Incumbent:
    """The better of `best` and what starts lead to that run through the cells that are left."""
    motions, bounds = cover.motions(best.cost)
    if not len(motions):
        return best
    chosen = diverse(motions, bounds, SEARCHED, APART, problem.task.arm.description.revolute)
    found = _best(problem, motions[chosen])
    return found if found is not None and found.cost < best.cost * (1 - SLACK) else best


def _best(problem: Problem, starts: Array) -> Incumbent | None:
    """The cheapest motion that Newton's method makes of the starts (S, N + 1, n)."""
    if not len(starts):
        return None
    answer = serve.Solver(problem).on(problem.times).solve(starts)
    cost = np.where(answer.converged & (answer.residual <= TRACKING), answer.cost, np.inf)
    index = int(cost.argmin())
    return Incumbent(answer.q[index], float(cost[index])) if np.isfinite(cost[index]) else None
