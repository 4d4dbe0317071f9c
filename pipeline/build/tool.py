"""What the tool may do: a tube that is worth it, and limits of its pace, which a law that is given keeps or not."""

from __future__ import annotations

import numpy as np

from pipeline.common.errors import ConfigError
from pipeline.problem.problem import Problem

LEAST = 1e-6  # [m] and [rad]: a tube thinner than that is the path itself
FINE = 4000  # samples of a law
ROOM = 1.01  # on the duration that is named: the motion's spline swings a little about its path


def check_tool(problem: Problem) -> None:
    """Raise ConfigError, one line, for a tube or limits of the tool's pace that do not go with the rest."""
    reference, bounds = problem.reference, problem.bounds
    if not reference.exact:
        for key, tolerance in zip(("tolerance", "orientation_tolerance"), reference.tolerances, strict=True):
            if tolerance < LEAST:
                raise ConfigError(f"path.{key} = {tolerance:g}: with path.exact = false must be at least {LEAST:g}")
        if bounds.limits_tool:
            raise ConfigError(
                "limits.tool_speed, limits.tool_acceleration: they are kept by the law of the path, which a motion "
                "with path.exact = false need not follow to the point; set path.exact=true"
            )
    if not bounds.limits_tool:
        return
    if not reference.geometry.sample(np.linspace(0.0, reference.geometry.length, 9))[1].any():
        raise ConfigError("limits.tool_speed, limits.tool_acceleration: the tool turns on the spot, and goes nowhere")
    if not problem.free_timing:
        _check_pace(problem)


def _check_pace(problem: Problem) -> None:
    """A law that is given exceeds the limits or not; a duration in which it would keep them."""
    reference, bounds = problem.reference, problem.bounds
    speed, acceleration = reference.paces(np.linspace(0.0, reference.duration, FINE + 1))
    beyond = {
        "tool_speed": (speed, bounds.tool_speed, "m/s", speed / bounds.tool_speed),
        "tool_acceleration": (
            acceleration,
            bounds.tool_acceleration,
            "m/s^2",
            float(np.sqrt(acceleration / bounds.tool_acceleration)),
        ),
    }
    key, (reached, bound, unit, factor) = max(beyond.items(), key=lambda item: item[1][3])
    if factor > 1:
        needed = float(np.format_float_positional(ROOM * factor * reference.duration, 3, fractional=False, trim="-"))
        raise ConfigError(
            f"limits.{key} = {bound:g} {unit}: the path is run through at up to {reached:.3g} {unit} in "
            f"{reference.duration:.4g} s; {needed:.4g} s would do"
        )
