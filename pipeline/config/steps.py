"""How many steps a run would take where a step [s] or a rate [Hz] meets the duration: bounded, before any begins."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

from pipeline.common.errors import ConfigError

MOST_STEPS = 100_000  # every one is evaluated, drawn and recorded
MOST_SAMPLES = 1_000_000  # every one is simulated, no more
MOST_EDGES = 10_000_000  # of a roadmap: each takes some dozens of bytes
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


def refuse_endless_roadmap(config: Any) -> None:
    """Raise ConfigError where the roadmap of method.global has too many edges, or too many and long paths."""
    nodes, layers = config.method.of("global").nodes, config.method.of("global").layers
    for factors, size, most, why in (
        ("nodes x nodes x layers", nodes**2 * layers, MOST_EDGES, "edges, which fit into memory"),
        ("nodes x layers x layers", nodes * layers**2, MOST_PLACES, "places on its paths, which are compared"),
    ):
        if size > most:
            raise ConfigError(
                f"method.global.nodes = {nodes}, method.global.layers = {layers}: {factors} is {size:.3g}; at most "
                f"{most:.0e} {why}"
            )
