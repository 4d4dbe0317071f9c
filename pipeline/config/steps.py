"""How many steps a run would take where a step [s] or a rate [Hz] meets the duration: bounded, before any begins."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

from pipeline.common.errors import ConfigError

MOST_STEPS = 100_000  # every one is evaluated, drawn and recorded
MOST_SAMPLES = 1_000_000  # every one is simulated, no more
MOST_EDGES = 10_000_000  # of a roadmap, or links of a bound's cells: each takes some dozens of bytes
MOST_STEPS_OF_DP = 1_000_000_000  # from node to node: as many take half a minute
MOST_INTERVALS = 20_000  # of a motion that is planned: as many take a minute and 0.2 GB
USUAL, MOST_KNOTS = 25, 100_000  # intervals of a coarsest grid; of all starts on it together: each takes 10 kB and more
MOST_PLACES = 1_000_000  # on the paths through every node: as many take ten seconds
SHORTEST, LONGEST = 1e-6, 1e9  # [s] of a motion
STEPS = ("dt", "prediction_step", "update_interval")


def refuse_endless(config: Any, duration: float, of: str = "timing.duration = ") -> None:
    """Raise ConfigError for the first of them that is too many in a motion of `duration` [s] under `config`, the
    RunConfig, or for a duration that is none; `of` says whose it is.
    """
    if not SHORTEST <= duration <= LONGEST:
        raise ConfigError(f"{of}{duration:g} s: a motion takes {SHORTEST:g} to {LONGEST:g} s")
    for key, value, count, most in _counts(config, duration):
        if count > most:
            raise ConfigError(
                f"{key} = {value:g}: {count:.3g} steps in {of}{duration:g} s; at most {most}, each of which is "
                "evaluated and written"
            )


def _counts(config: Any, duration: float) -> Iterator[tuple[str, float, float, int]]:
    """Key, value, number of steps and its bound."""
    for method in config.methods:
        options = config.method.of(method)
        for name in STEPS:
            step = getattr(options, name, None)
            if step is not None:
                yield f"method.{method}.{name}", step, duration / step, MOST_STEPS
    if config.export.method != "none":
        yield "export.rate", config.export.rate, config.export.rate * duration, MOST_STEPS
    if config.closed_loop.run:
        yield "closed_loop.sampling", config.closed_loop.sampling, config.closed_loop.sampling * duration, MOST_SAMPLES


def refuse_endless_search(config: Any) -> None:
    """Raise ConfigError where a search that is asked for has more to compare than memory and patience hold."""
    for method in config.methods:
        for size, most, key, factors, what in _pairs(config, method):
            if size > most:
                raise ConfigError(
                    f"{key}: {factors} is {size:.3g}; at most {most:.0e} {what}, which fit into memory and are done "
                    "in a minute"
                )


def _pairs(config: Any, method: str) -> Iterator[tuple[float, float, str, str, str]]:
    """Of a search its size and the bound of it, the keys with their values, how the size is made of them, of what."""
    options, steps = config.method.of(method), config.timing.steps
    planner = getattr(options, "planner", options)
    if method in ("global", "pareto", "segments"):
        yield steps, MOST_INTERVALS, f"timing.steps = {steps}", "their number", "intervals of planned motions"
        starts, coarse = planner.optimised, planner.coarse_steps or USUAL
        keys = f"method.global.optimised = {starts}, method.global.coarse_steps = {planner.coarse_steps or 'null'}"
        yield starts * min(coarse, steps), MOST_KNOTS, keys, "optimised x coarse_steps", "knots at once"
        nodes, layers = planner.nodes, planner.layers
        keys = f"method.global.nodes = {nodes}, method.global.layers = {layers}"
        yield nodes**2 * layers, MOST_EDGES, keys, "nodes x nodes x layers", "edges"
        yield nodes * layers**2, MOST_PLACES, keys, "nodes x layers x layers", "places on paths"
    if method == "lower_bound":
        cells, intervals = options.cells, min(options.intervals or steps, steps)
        keys = f"method.lower_bound.cells = {cells}, method.lower_bound.intervals = {intervals}"
        yield cells**2 * intervals, MOST_EDGES, keys, "cells x cells x intervals", "pairs of cells"
    if method == "dynamic_programming" or "dynamic_programming" in getattr(planner, "generators", ()):
        options = config.method.of("dynamic_programming")
        nodes, intervals = options.nodes, min(options.intervals or steps, steps)
        key = "method.dynamic_programming."
        keys = f"{key}nodes = {nodes}, {key}intervals = {intervals}"
        yield nodes**2 * intervals, MOST_STEPS_OF_DP, keys, "nodes x nodes x intervals", "steps"
