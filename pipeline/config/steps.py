"""How many steps a run would take where a step [s] or a rate [Hz] meets the duration: bounded, before any begins."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

from pipeline.common.errors import ConfigError

MOST_STEPS = 100_000  # every one is evaluated, drawn and recorded
MOST_SAMPLES = 1_000_000  # every one is simulated, no more
STEPS = ("dt", "prediction_step", "update_interval")


def refuse_endless(config: Any) -> None:
    """Raise ConfigError for the first of them that is too many in `config`, the RunConfig that is being made."""
    duration = config.timing.duration
    for key, value, count, most in _counts(config):
        if count > most:
            raise ConfigError(
                f"{key} = {value:g}: {count:.3g} steps in timing.duration = {duration:g} s; at most {most}, each of "
                "which is evaluated and written"
            )


def _counts(config: Any) -> Iterator[tuple[str, float, float, int]]:
    """Key, value, number of steps and its bound."""
    duration = config.timing.duration
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
