"""Hold what dynamic programming or a bound's cells found on a coarse grid beside the planner's optima (r = 1).

There paths are compared: whose motion it is, is a question of paths and not of costs. Where theirs was better the
planner has gone on from it before (`continued.py`), and that is said; what it does not list stays theirs.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import asdict, dataclass
from typing import Any, ClassVar

from pipeline.config.methods import GlobalOptions
from pipeline.methods.global_planner.continued import ON_GRIDS, cost, finished, of_same_path
from pipeline.methods.method import Context
from pipeline.methods.registry import METHODS
from pipeline.problem.problem import Problem
from pipeline.problem.solution import Solution
from pipeline.studies.study import Motions, Result


@dataclass(frozen=True)
class Comparison:
    """What became of the best motion of one method that works on a grid of so many intervals.

    best, finished: the objective of the planner's best and of that motion, in continuous time. same_as: which of the
    planner's optima it is, 0 if it is none of them. gone_on: whether the planner has its best from this method.
    """

    method: str
    intervals: int
    best: float
    finished: float
    same_as: int
    gone_on: bool

    @property
    def sentence(self) -> str:
        """For people."""
        said = f"its best motion on {self.intervals} intervals, finished by the planner, "
        if not self.same_as:
            costs = f"it costs {self.finished:.5g} in continuous time, the planner's best {self.best:.5g}"
            return f"{said}is none of the planner's: {costs}"
        which = "best" if self.same_as == 1 else f"optimum {self.same_as}"
        more = "; the planner's own starts had led to dearer ones only, and it has gone on from this one" * self.gone_on
        return f"{said}is the planner's {which}, {self.finished:.5g} in continuous time{more}"


@dataclass(frozen=True)
class Estimate(Result):
    """comparisons: one for each method on a grid."""

    name: ClassVar[str] = "estimate"
    comparisons: tuple[Comparison, ...]

    def section(self) -> list[str]:
        title = "## What other searches found, beside the planner (an estimate; only a bound excludes more)"
        return [title, "", *(f"- {METHODS[one.method].title}: {one.sentence}." for one in self.comparisons)]

    def facts(self) -> Mapping[str, Any]:
        return {
            one.method: {key: value for key, value in asdict(one).items() if key != "method"}
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
            made.append(compare(motions.problem, planned, on_grid[0], options, Context(workers=motions.workers)))
    return Estimate(tuple(made)) if made else None


def compare(
    problem: Problem, planned: list[Solution], other: Solution, options: GlobalOptions, context: Context
) -> Comparison:
    """Of the planner's solutions, best first, and the best one of another method."""
    same, moved = of_same_path(problem, other, planned, options.same_path), other
    if same is None:  # an optimum moves with its knots: on the same ones it may be the same
        moved = next(iter(finished(problem, planned, [other], options, context)), other)
        same = of_same_path(problem, moved, planned, options.same_path)
    return Comparison(
        other.method,
        other.statistics.get("intervals", len(other.trajectory.time) - 1),
        cost(problem, planned[0]),
        cost(problem, moved if same is None else same),
        0 if same is None else same.optimum,
        same is not None and same.statistics.get("continued_from") == other.method,
    )
