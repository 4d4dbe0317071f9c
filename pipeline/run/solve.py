"""The methods of one run: the problem that they are asked, refused before anything is solved, and their solutions."""

from __future__ import annotations

import time

from pipeline.build.problem import prepare
from pipeline.common.errors import ConfigError
from pipeline.config.run import RunConfig
from pipeline.methods.method import Context
from pipeline.methods.registry import METHODS
from pipeline.problem.problem import Problem
from pipeline.problem.solution import Solution


def state(config: RunConfig) -> Problem:
    """The problem of a configuration; raises InputError, one line, if it or a method asked for does not serve."""
    problem = prepare(config)
    for name in config.methods:
        why = METHODS[name].why_not(problem, config.method.of(name))
        if why:
            served = [m.name for m in METHODS.values() if not m.why_not(problem, config.method.of(m.name))]
            raise ConfigError(f"{why}; methods that serve this problem: {', '.join(served)}")
    return problem


def solve(problem: Problem, config: RunConfig, context: Context) -> tuple[list[Solution], dict[str, float]]:
    """The solutions of the methods asked for, in order, and the wall time [s] of each method."""
    solutions: list[Solution] = []
    seconds: dict[str, float] = {}
    for name in config.methods:
        begin = time.perf_counter()
        solutions += METHODS[name](problem, config.method.of(name), context)
        seconds[name] = time.perf_counter() - begin
    return solutions, seconds
