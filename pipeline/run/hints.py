"""Numbers that can be meant, and that look as if something else was: said in a line, and taken as they are."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from pipeline.config.path import WaypointsConfig
from pipeline.config.run import RunConfig
from pipeline.problem.problem import Problem

TURN = 2 * np.pi
MOVED = 1e-3  # [rad or m] of a joint: less is the rounding of a file


def hints(config: RunConfig, problem: Problem) -> list[str]:
    """A line for each."""
    return [*_degrees(config, problem), *_moved(config, problem)]


def _degrees(config: RunConfig, problem: Problem) -> list[str]:
    """Angles beyond a full turn in keys that are in rad."""
    turning = problem.task.arm.description.turning
    start = [value for value, turns in zip(config.robot.q_init or (), turning, strict=False) if turns]
    keys: dict[str, Sequence[float]] = {
        "robot.q_init": start,
        "robot.offset_rpy": config.robot.offset_rpy,
        "robot.base_rpy": config.robot.base_rpy,
        "path.turn": getattr(config.path, "turn", ()) or (),
    }
    return [
        f"{key} holds {worst:g}, more than a full turn; it is in rad, and {worst:g} deg are {np.deg2rad(worst):.4g}"
        for key, values in keys.items()
        if (worst := max(values, key=abs, default=0.0)) and abs(worst) > TURN
    ]


def _moved(config: RunConfig, problem: Problem) -> list[str]:
    """A start that is given and does not stand where the path begins."""
    given = config.robot.q_init
    if given is None or not isinstance(config.path, WaypointsConfig) or len(given) != len(problem.q_init):
        return []
    apart = np.abs(problem.q_init - np.array(given))
    joint = int(apart.argmax())
    if apart[joint] <= MOVED:
        return []
    description = problem.task.arm.description
    return [
        f"robot.q_init is moved to the first point of {config.path.file}, {description.joints[joint]} by "
        f"{apart[joint]:.3g} {'rad' if description.revolute[joint] else 'm'}; path.relative=true takes the points from "
        "where the tool stands"
    ]
