"""The closed-loop correction of the tracking error, of the methods that integrate velocities, and when it diverges."""

from __future__ import annotations

from pipeline.config.methods import LsvOptions, PmkeOptions
from pipeline.problem.problem import Problem


def diverges(method: str, problem: Problem, options: LsvOptions | PmkeOptions) -> str | None:
    """Why the gain of a method of this name is too large; None: it is not.

    To first order a step dt leaves (1 - gain dt) times the error that it began with, no less from gain dt = 2 on.
    """
    duration = problem.reference.duration
    dt = duration / max(1, round(duration / options.dt))
    if options.gain * dt < 2:
        return None
    return (
        f"method.{method}.gain = {options.gain:g} 1/s diverges: every step of {dt:.4g} s multiplies the tracking error "
        f"by {1 - options.gain * dt:.4g}; it must be below 2 / dt = {2 / dt:.4g} 1/s"
    )
