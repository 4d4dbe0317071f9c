"""Hold what dynamic programming or a bound's cells found on a coarse grid beside the planner's optima (r = 1).

Their motions are finished by the planner's own way, grid by grid, on its knots. There paths are compared: whose motion
it is, is a question of paths and not of costs. What the planner does not list stays theirs.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import asdict, dataclass, replace
from typing import Any, ClassVar

import numpy as np
import pandas as pd

from pipeline.common.arrays import Array
from pipeline.config.methods import GlobalOptions
from pipeline.methods.global_planner.optimum import Optimum
from pipeline.methods.global_planner.planner import finish
from pipeline.methods.method import Context
from pipeline.methods.registry import METHODS
from pipeline.problem.costs import objective_values
from pipeline.problem.problem import Problem
from pipeline.problem.solution import Solution, Status, Trajectory
from pipeline.search.selection import path_distance
from pipeline.studies.study import Motions, Result

ON_GRIDS = ("dynamic_programming", "lower_bound")
CHEAPER = 1e-6  # relative: costs that differ by less are the same


@dataclass(frozen=True)
class Comparison:
    """What became of the motions of one method on its own grid of so many intervals.

    best: the planner's best cost on its `knots` intervals. same_as: the number of the planner's optimum that the
    method's first motion is there, 0 if it is none of them. finished: the cost of that motion, NaN if it was lost on
    the way. better: of its motions that the planner does not list and that cost less than its best, the cheapest.
    """

    method: str
    intervals: int
    knots: int
    best: float
    finished: float
    same_as: int
    better: float = float("nan")
    motion: Trajectory | None = None

    @property
    def sentence(self) -> str:
        """For people."""
        said = f"its best motion on {self.intervals} intervals, finished by the planner on {self.knots}, "
        if np.isnan(self.finished):
            said = f"its best motion on {self.intervals} intervals was lost on the way to {self.knots}"
        elif self.same_as:
            which = "best" if self.same_as == 1 else f"optimum {self.same_as}"
            said += f"is the planner's {which}, {self.finished:.5g}"
        else:
            said += f"is none of the planner's: it costs {self.finished:.5g}, the planner's best {self.best:.5g}"
        if self.motion is None:
            return f"{said}; nothing cheaper than the planner's best came of its motions"
        return (
            f"{said}; a better motion than the planner's best ({self.best:.5g}) came of its motions: "
            f"{self.better:.5g}, see better_than_planner_{self.method}.csv"
        )


@dataclass(frozen=True)
class Estimate(Result):
    """comparisons: one for each method on a grid."""

    name: ClassVar[str] = "estimate"
    comparisons: tuple[Comparison, ...]

    def tables(self) -> Mapping[str, pd.DataFrame]:
        return {
            f"better_than_planner_{one.method}": Solution(one.method, one.motion, Status.SOLVED).to_frame()
            for one in self.comparisons
            if one.motion is not None
        }

    def section(self) -> list[str]:
        title = "## What other searches found, beside the planner (an estimate; only a bound excludes more)"
        return [title, "", *(f"- {METHODS[one.method].title}: {one.sentence}." for one in self.comparisons)]

    def facts(self) -> Mapping[str, Any]:
        return {
            one.method: {key: value for key, value in asdict(one).items() if key not in ("method", "motion")}
            for one in self.comparisons
        }


def study(motions: Motions) -> Estimate | None:
    """Where the planner and one of the others were asked for and found a motion."""
    planned = [e.solution for e in motions.solved if e.method == "global"]
    options = motions.config.method.of("global")
    made = []
    for method in ON_GRIDS:
        on_grid = [e.solution for e in motions.solved if e.method == method]
        if planned and on_grid:
            made.append(compare(motions.problem, planned, on_grid, options, Context(workers=motions.workers)))
    return Estimate(tuple(made)) if made else None


def compare(
    problem: Problem,
    planned: list[Solution],
    on_grid: list[Solution],
    options: GlobalOptions,
    context: Context,
) -> Comparison:
    """Of the planner's solutions and another method's, best first and all on the same knots, which may be coarser."""
    times, knots = on_grid[0].trajectory.time, planned[0].trajectory.time
    problem, options = replace(problem, times=knots), replace(options, refine_to=None)
    optima = np.array([solution.trajectory.q for solution in planned])
    costs = objective_values(problem, knots, optima)
    first, all_finished = (
        finish(problem, times, np.array([s.trajectory.q for s in some]), options, context)[1]
        for some in (on_grid[:1], on_grid)
    )
    cheaper = [
        optimum
        for optimum in all_finished
        if optimum.cost < costs.min() * (1 - CHEAPER) and not _number(problem, optimum, optima, options.same_path)
    ]
    better = min(cheaper, key=lambda optimum: optimum.cost, default=None)
    return Comparison(
        on_grid[0].method,
        on_grid[0].statistics.get("intervals", len(times) - 1),
        len(knots) - 1,
        float(costs[0]),
        first[0].cost if first else float("nan"),
        _number(problem, first[0], optima, options.same_path) if first else 0,
        float("nan") if better is None else better.cost,
        None if better is None else Trajectory(knots, better.q),
    )


def _number(problem: Problem, optimum: Optimum, optima: Array, same: float) -> int:
    """Which of the planner's optima (K, N + 1, n) it is, from 1 on; 0: none."""
    revolute = problem.task.arm.description.revolute
    apart = [path_distance(optimum.q, q, revolute) for q in optima]
    nearest = int(np.argmin(apart))
    return nearest + 1 if apart[nearest] <= same else 0
