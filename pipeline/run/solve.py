"""The methods of a run, one after the other."""

from __future__ import annotations

import time
from collections.abc import Callable

from pipeline.common.workers import Workers
from pipeline.config.run import RunConfig
from pipeline.methods import calculus_of_variations, dynamic_programming, global_planner, lsv, pareto
from pipeline.methods.pmke import predictive
from pipeline.methods.pontryagin import boundary_value
from pipeline.methods.pontryagin.as_printed import as_printed
from pipeline.problem.problem import Problem
from pipeline.problem.solution import Progress, Solution


def solve(
    problem: Problem, config: RunConfig, workers: Workers, progress: Progress
) -> tuple[list[Solution], dict[str, float]]:
    """The solutions of all methods asked for, in order, and each method's wall time [s]."""
    options = config.method
    own = options.pontryagin
    methods: dict[str, Callable[[], list[Solution]]] = {
        "lsv": lambda: [lsv.solve(problem, options.lsv)],
        "inertia_weighted": lambda: [lsv.solve(problem, options.inertia_weighted, "inertia_weighted")],
        "pmke": lambda: [predictive.solve(problem, options.pmke)],
        "global": lambda: global_planner.solve(problem, options.global_, config.seed, workers, progress),
        "pareto": lambda: pareto.solve(problem, config.pareto, options.global_, config.seed, workers, progress),
        "dynamic_programming": lambda: dynamic_programming.solve(problem, options.dynamic_programming),
        "calculus_of_variations": lambda: calculus_of_variations.solve(problem, options.calculus_of_variations),
        "pontryagin": lambda: boundary_value.boundary_value(problem, own, config.seed, workers, progress),
        "pontryagin_as_printed": lambda: as_printed(problem, own),
    }
    asked = list(config.methods)
    if "pontryagin" in asked and own.formulation != "boundary_value":
        at = asked.index("pontryagin")
        asked[at : at + 1] = ["pontryagin_as_printed", "pontryagin"][: 1 if own.formulation == "as_printed" else 2]
    solutions, seconds = [], {}
    for method in asked:
        begin = time.perf_counter()
        found = methods[method]()
        seconds[found[0].method] = time.perf_counter() - begin
        solutions += found
    return solutions, seconds
