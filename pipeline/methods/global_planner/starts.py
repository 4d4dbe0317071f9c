"""Motions to start from, by the generators that `method.global.starts` names: a first lot of each, and further ones.

A first lot is chosen: cheap motions that are far apart. Further lots are random, so that what they bring tells how much
there is left to find.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from scipy.interpolate import CubicSpline

from pipeline.common.arrays import Array
from pipeline.config.methods import GlobalOptions
from pipeline.methods.global_planner.reasons import no_place
from pipeline.problem.problem import Problem
from pipeline.search import bellman
from pipeline.search.configurations import starting_points
from pipeline.search.population import population, ranking
from pipeline.search.roadmap import Roadmap
from pipeline.search.selection import diverse

Further = Callable[[int], Array]  # about so many more motions
Known = Callable[[Array], Array]  # motions (K, N + 1, n) on any knots (N + 1,)


@dataclass
class Starts:
    """`first` (K, N + 1, n) on the knots `grid`, best first by generator, or those that are
    `known`; `log`: how they came about.
    """

    problem: Problem
    grid: Array
    options: GlobalOptions
    rng: np.random.Generator
    known: Known | None = None
    log: dict[str, Any] = field(default_factory=dict)

    def __post_init__(self) -> None:
        if self.known is not None:
            self.first = self.known(self.grid)
            self._further: list[Further] = [self.none]
            return
        lots = [GENERATORS[name](self) for name in self.options.generators]
        self.first = np.concatenate([first for first, _ in lots])
        self._further = [further for _, further in lots]

    def further(self, count: int, grid: Array) -> Array:
        """At most `count` more on the knots `grid`, of every generator the same number; none where none has more."""
        share = -(-count // len(self._further))
        more = np.concatenate([further(share) for further in self._further])[:count]
        return more if grid is self.grid or not len(more) else np.asarray(CubicSpline(self.grid, more, axis=1)(grid))

    def none(self, _: int = 0) -> Array:
        """No motions, on this grid."""
        return np.empty((0, len(self.grid), self.problem.task.arm.n))


def _roadmap(starts: Starts) -> tuple[Array, Further]:
    """Of nothing within the limits or clear of obstacles what comes nearest is the solver's to say."""
    problem, options = starts.problem, starts.options
    roadmap = Roadmap(problem, starts.grid, starts.rng, nodes=options.nodes, layers=options.layers)
    paths = roadmap.cheapest(options.optimised)
    starts.log["roadmap_paths"] = len(paths)
    if len(paths):
        return paths, roadmap.random
    if barred := no_place(problem, starts.grid):
        starts.log["barred"] = barred
        return starts.none(), starts.none
    return _instead(starts)


def _instead(starts: Starts) -> tuple[Array, Further]:
    asked = "population" in starts.options.generators
    return (starts.none(), starts.none) if asked else _population(starts)


def _population(starts: Starts) -> tuple[Array, Further]:
    problem, grid, options, rng = starts.problem, starts.grid, starts.options, starts.rng
    configurations = starting_points(problem, options.configurations, rng, options.draw)
    count = options.candidates or (len(grid) * problem.task.arm.n) ** 2
    motions = population(problem, grid, configurations, count, rng)
    starts.log |= {"configurations": len(configurations), "drawn": count, "candidates": len(motions)}
    if not len(motions):
        return starts.none(), starts.none
    costs = ranking(problem, grid, motions, options.limit_weight)
    chosen = diverse(motions, costs, options.optimised, options.same_path, problem.task.arm.description.revolute)

    def further(more: int) -> Array:
        return population(problem, grid, rng.permutation(configurations), more, rng, plain=False)

    return motions[chosen], further


def _dynamic_programming(starts: Starts) -> tuple[Array, Further]:
    """One for each valley that the grid shows: there are no others."""
    paths = bellman.starts(starts.problem, starts.grid)
    starts.log["dynamic_programming_paths"] = len(paths)
    return paths.reshape(-1, *starts.none().shape[1:]), starts.none


GENERATORS: dict[str, Callable[[Starts], tuple[Array, Further]]] = {
    "roadmap": _roadmap,
    "population": _population,
    "dynamic_programming": _dynamic_programming,
}
