"""The problem of a run, prepared once: the check before a run keeps what it has built for the run that follows."""

from __future__ import annotations

from pipeline.artifacts import motion_files
from pipeline.build.problem import prepare
from pipeline.common.errors import ConfigError
from pipeline.config.run import RunConfig
from pipeline.methods.registry import METHODS
from pipeline.problem.problem import Problem
from pipeline.studies import control

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
    for name in config.methods:
        why = METHODS[name].why_not(problem, config.method.of(name))
        if why and METHODS[name].serves.why_not(problem) is None:  # its own options are at fault
            raise ConfigError(why)
        if why:
            served = [m.name for m in METHODS.values() if not m.why_not(problem, config.method.of(m.name))]
            raise ConfigError(f"{why}; methods that serve this problem: {', '.join(served)}")
    if config.control.run and (why := control.why_not(problem, config.method.pmke, config.control)):
        raise ConfigError(why)
    if why := motion_files.why_not(config.export.format, problem.task.arm.description.turning.tolist()):
        raise ConfigError(why)
    return problem
