"""The methods of a run, one after the other; the planner goes on from better motions than its own."""

from __future__ import annotations

import time

from pipeline.config.run import RunConfig
from pipeline.methods.global_planner.continued import continued
from pipeline.methods.method import Context
from pipeline.methods.registry import METHODS
from pipeline.problem.problem import Problem
from pipeline.problem.solution import Solution


def solve(problem: Problem, config: RunConfig, context: Context) -> tuple[list[Solution], dict[str, float]]:
    """The solutions of the methods asked for, in order, and the wall time [s] of each method."""
    solutions: list[Solution] = []
    seconds: dict[str, float] = {}
    for name in config.methods:
        context.phase(METHODS[name].title)
        begin = time.perf_counter()
        solutions += METHODS[name](problem, config.method.of(name), context)
        seconds[name] = time.perf_counter() - begin
    return continued(problem, solutions, config.method.of("global"), context), seconds
