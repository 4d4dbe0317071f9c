"""On which knots the planner works: from coarse to fine, and finer where a motion leaves its path between them."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from pipeline.common.arrays import Array
from pipeline.problem.curve import whole
from pipeline.problem.problem import Problem
from pipeline.problem.resolution import (
    MOST,
    SAVES,
    divided,
    graded,
    parted,
    parts_needed,
    resolving,
    roughly,
    steps_needed,
    thinned,
)
from pipeline.problem.solution import Trajectory

INNER = 8  # sub-intervals per knot interval at which a motion is held against its path
SAVED = 0.8  # of a grid's intervals: a coarser one with more is left out
SERVED = 1500  # intervals on which one optimum alone would be refined
PIECE = 4096  # moments at a time


def refinement(times: Array, coarse_steps: int, least: int = 2) -> list[Array]:
    """Grids from coarse to fine: at most coarse_steps intervals, doubled until the wanted knots `times` are reached. At
    least so many, and more than coarse_steps where `least` leaves too little to save.
    """
    sizes = [len(times) - 1]
    while sizes[0] > coarse_steps and (half := max(least, sizes[0] // 2)) < SAVED * sizes[0]:
        sizes.insert(0, half)
    return [thinned(times, size) for size in sizes]


def served(problem: Problem) -> int:
    """How many optima are carried to the problem's knots: the cost of each grows with their number, and with how many
    iterations it takes.
    """
    return max(2, round((SERVED / (len(problem.times) - 1)) ** 2))


def coarsest(problem: Problem, steps: int | None, usual: int) -> int:
    """Intervals of the coarsest grid, at most: `steps`, or where that is None the usual ones or as many as the shape of
    the path needs.
    """
    return roughly(problem, usual) if steps is None else steps


def on_knots(problem: Problem, most: int | None) -> tuple[Array, str]:
    """The knots (N + 1,) [s] of the problem, or as many more as its path needs; and why there are none, or nothing.
    None: its own are kept.
    """
    if most is None:
        return problem.times, ""
    knots = resolving(problem, max(most, len(problem.times) - 1))
    if knots is not None:
        return knots, ""
    enough = resolving(problem, MOST)
    needed = f"more than {MOST} intervals" if enough is None else f"{len(enough) - 1} intervals"
    return problem.times, (
        f"the path needs {needed} for path.tolerance = {problem.reference.tolerance:g} m between its knots, more than "
        f"method.global.refine_to = {most}: raise that, or path.tolerance; null keeps timing.steps"
    )


def finer(problem: Problem, most: int | None, motions: Sequence[Array], ends: Array | None = None) -> Array | None:
    """The knots with intervals parted so that the motions (N + 1, n) would keep path.tolerance between them: all alike,
    or where that takes `SAVES` times as many, those alone where a motion does not. None where all do, or where no more
    than `most` intervals make a difference. None for `most`: as many as there are. ends: of motions that are splines.
    """
    count = len(problem.times) - 1
    wanted, local = 1, np.ones(count, int)
    for q in motions:
        off = off_path(problem, q, ends)
        for which, (errors, allowed) in enumerate(zip(off, problem.reference.tolerances, strict=True)):
            error = float(errors.max())
            if error > allowed:
                needed = steps_needed(problem, problem.times, error, which)
                wanted = max(wanted, 1 if needed is None else -(-needed // count))
                local = np.maximum(local, parts_needed(errors, allowed))
    parts = min(wanted, (most or 0) // count)
    if wanted > 1 and wanted * count > SAVES * int(local.sum()):
        knots = graded(parted(problem.times, local))
        if wanted * count > SAVES * (len(knots) - 1) and len(knots) - 1 <= (most or 0):
            return knots
    return divided(problem.times, parts) if parts > 1 else None


def off_path(problem: Problem, q: Array, ends: Array | None = None) -> Array:
    """How far the exported curve through the knots q (N + 1, n) is from its path in every interval, at most: (2, N),
    [m] and [rad].
    """
    moments = divided(problem.times, INNER)
    rows = len(problem.task.axes)
    curve, found = whole(problem, Trajectory(problem.times, q, ends)), []
    for first in range(0, len(moments), PIECE):
        part = moments[first : first + PIECE]
        error = problem.task.error(curve(part), problem.reference.position(part))
        found.append([np.linalg.norm(error[:, :rows], axis=1), np.linalg.norm(error[:, rows:], axis=1)])
    distances = np.concatenate(found, axis=1)
    inner = distances[:, :-1].reshape(2, -1, INNER).max(axis=2)
    return np.maximum(inner, distances[:, INNER::INNER])
