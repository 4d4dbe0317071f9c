"""The problem of a run, prepared once: the check before a run keeps what it has built for the run that follows."""

from __future__ import annotations

from pipeline.build.problem import prepare
from pipeline.common.errors import ConfigError
from pipeline.config.run import RunConfig
from pipeline.methods import calculus_of_variations, dynamic_programming
from pipeline.methods.pontryagin import boundary_value
from pipeline.problem.problem import Problem

_kept: list[tuple[RunConfig, Problem]] = []  # at most one, of a run that is about to begin in this process


def keep(config: RunConfig) -> None:
    """Raise InputError where `state` would, else keep what it made for the next call of it."""
    problem = state(config)
    _kept.append((config, problem))


def state(config: RunConfig) -> Problem:
    """The problem of a configuration, refused before anything is solved if a method asked for does not serve it.

    What was kept is used once: the files that a configuration names may have changed by the time of another run.
    """
    if _kept:
        asked, problem = _kept.pop()
        if asked == config:
            return problem
    problem = prepare(config)
    if problem.task.arm.base.count:
        _require_fixed_base(config)
    if "dynamic_programming" in config.methods or (
        "global" in config.methods and config.method.global_.starts != "population"
    ):
        dynamic_programming.check(problem)
    if "calculus_of_variations" in config.methods:
        calculus_of_variations.check(problem)
    if "pontryagin" in config.methods:
        boundary_value.check(problem)
    return problem


def _require_fixed_base(config: RunConfig) -> None:
    """Refuse what a base that moves, or that is held for its reaction, is not served by: the attitude is a state."""
    refused = {"dynamic_programming", "calculus_of_variations", "pontryagin"} & set(config.methods)
    if refused:
        raise ConfigError(
            f"methods: {', '.join(sorted(refused))} serve arms on a fixed base; of a floating or held base serve lsv, "
            "inertia_weighted, pmke, global and pareto"
        )
    if config.method.global_.starts != "population":
        raise ConfigError(f"method.global.starts = {config.method.global_.starts}: allowed on such a base: population")
    if config.closed_loop.run:
        raise ConfigError("closed_loop.run: the controller is one for arms on a fixed base")
