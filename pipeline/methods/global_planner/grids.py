"""On which knots the planner works: from coarse to fine, and finer where a motion leaves its path between them."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from pipeline.common.arrays import Array
from pipeline.problem.curve import whole
from pipeline.problem.problem import Problem
from pipeline.problem.resolution import MOST, divided, resolving, roughly, steps_needed
from pipeline.problem.solution import Trajectory

INNER = 8  # sub-intervals per knot interval at which a motion is held against its path


def refinement(times: Array, coarse_steps: int) -> list[Array]:
    """Grids from coarse to fine: at most coarse_steps intervals, doubled until the wanted knots `times` are reached."""
    intervals = len(times) - 1
    sizes = [intervals]
    while sizes[0] > coarse_steps:
        sizes.insert(0, max(2, sizes[0] // 2))
    place = np.arange(intervals + 1)
    return [np.interp(np.linspace(0, intervals, size + 1), place, times) for size in sizes]


def coarsest(problem: Problem, steps: int | None, usual: int) -> int:
    """Intervals of the coarsest grid, at most: `steps`, or where that is None the usual ones or as many as the shape of
    the path needs.
    """
    return roughly(problem, usual) if steps is None else steps


def on_knots(problem: Problem, most: int | None) -> tuple[Array, str]:
    """The knots (N + 1,) [s] of the problem, or as many parts of their intervals as its path needs; and why there are
    none, or nothing. None: its own are kept.
    """
    if most is None or (parts := resolving(problem, max(most, len(problem.times) - 1))) == 1:
        return problem.times, ""
    if parts is not None:
        return divided(problem.times, parts), ""
    enough = resolving(problem, MOST)
    needed = f"{enough * (len(problem.times) - 1)} intervals" if enough else f"more than {MOST} intervals"
    return problem.times, (
        f"the path needs {needed} for path.tolerance = {problem.reference.tolerance:g} m between its knots, more than "
        f"method.global.refine_to = {most}: raise that, or path.tolerance; null keeps timing.steps"
    )


def finer(problem: Problem, most: int | None, motions: Sequence[Array]) -> Array | None:
    """The knots with every interval parted so that the motions (N + 1, n) would keep path.tolerance between them; None
    where they do, or where no more than `most` intervals make a difference. None for `most`: as many as there are.
    """
    count = len(problem.times) - 1
    allowed = (problem.reference.tolerance, problem.reference.orientation_tolerance)
    wanted = 1
    for q in motions:
        for which, error in enumerate(off_path(problem, q)):
            if error > allowed[which]:
                needed = steps_needed(problem, problem.times, error, which)
                wanted = max(wanted, 1 if needed is None else -(-needed // count))
    parts = min(wanted, (most or 0) // count)
    return divided(problem.times, parts) if parts > 1 else None


def off_path(problem: Problem, q: Array) -> tuple[float, float]:
    """How far the exported curve through the knots q (N + 1, n) is from its path, at most: [m] and [rad]."""
    moments = divided(problem.times, INNER)
    rows = len(problem.task.axes)
    error = problem.task.error(
        whole(problem, Trajectory(problem.times, q))(moments), problem.reference.position(moments)
    )
    parts = (np.linalg.norm(part, axis=1).max(initial=0.0) for part in (error[:, :rows], error[:, rows:]))
    distance, angle = map(float, parts)
    return distance, angle
