"""Objective, limits and obstacles of a configuration."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from pipeline.build.collision import may_touch
from pipeline.build.robot import make_shape
from pipeline.common.arrays import Array
from pipeline.common.errors import ConfigError
from pipeline.config.goal import LimitsConfig, WeightedConfig
from pipeline.config.robot import CollisionConfig, ObstaclesConfig
from pipeline.config.run import RunConfig
from pipeline.model.arm import Arm
from pipeline.model.obstacles import Obstacles
from pipeline.problem.limits import Limits
from pipeline.problem.objective import Objective
from pipeline.problem.secondary import Secondary
from pipeline.robot import world
from pipeline.robot.joint_limits import read
from pipeline.robot.limits import UNLIMITED
from pipeline.robot.packages import find
from pipeline.robot.shapes import SLAB, Shape


def make_limits(limits: LimitsConfig, arm: Arm, own: str | None = None) -> Limits:
    """The description's limits as far as `kind` takes them, overridden by the file, and that by the values given.

    own: robot.limits, the file of the accelerations that hold where nothing else states any; None: none does.
    """
    stated = _stated(limits.file, "limits.file", arm)
    description, free = arm.description, np.full(arm.n, np.inf)
    accelerations = _stated(own, "robot.limits", arm).get("acceleration", free)
    accelerations = np.where(np.isnan(accelerations), np.inf, accelerations)
    joint, all_of_them = limits.kind != "none", limits.kind == "joint_torque_power"

    def bound(key: str, own: Array) -> Array:
        given = getattr(limits, key)
        if given is None:
            return np.where(np.isnan(stated[key]), own, stated[key]) if key in stated else own
        if isinstance(given, tuple) and len(given) != arm.n:
            raise ConfigError(f"limits.{key} has {len(given)} values, the arm has {arm.n} moving joints")
        values = np.broadcast_to(np.asarray(given, dtype=float), arm.n)
        return np.where(np.abs(values) < UNLIMITED, values, np.copysign(np.inf, values))

    return Limits(
        lower=bound("lower", description.lower if joint else -free),
        upper=bound("upper", description.upper if joint else free),
        velocity=bound("velocity", description.velocity if joint else free),
        torque=bound("torque", description.effort if all_of_them else free),
        power=bound("power", free),
        acceleration=bound("acceleration", accelerations),
        jerk=bound("jerk", free),
        attitude=_one(limits.attitude),
        tool_speed=_one(limits.tool_speed),
        tool_acceleration=_one(limits.tool_acceleration),
    )


def _one(bound: float | None) -> float:
    return np.inf if bound is None else bound


def _stated(file: str | None, key: str, arm: Arm) -> dict[str, Array]:
    return {} if file is None else read(find(file, key), arm.description.joints, key)


def make_objective(config: RunConfig, arm: Arm) -> Objective:
    """The objective; joints are centred in the ranges of the description, or those that `limits` gives."""
    own = config.objective
    if isinstance(own, WeightedConfig) and abs(sum(own.weights.values()) - 1.0) > 1e-9:
        names = " + ".join(f"objective.{name}" for name in own.weights)
        raise ConfigError(f"{names} = {sum(own.weights.values()):g}: the weights must add up to 1")
    if not any(own.weights.values()):
        raise ConfigError(f"objective = {own.kind}: all its weights are zero")
    if not own.criteria:
        return Objective(own.weights)
    ranges = make_limits(replace(config.limits, kind="joint"), arm)
    if "joint_centering" in own.criteria and not np.isfinite(ranges.upper - ranges.lower).any():
        raise ConfigError(
            f"objective.secondary = {own.secondary}: {arm.description.name} states no joint limits to centre its "
            "joints in; give limits.lower and limits.upper"
        )
    return Objective(own.weights, Secondary(own.criteria, own.k0, ranges.lower, ranges.upper))


def make_obstacles(obstacles: ObstaclesConfig, collision: CollisionConfig, arm: Arm) -> Obstacles | None:
    """The solids around the arm, None where there are none, and which of its links may touch which of them."""
    shapes = [make_shape(name, shape) for name, shape in obstacles.shapes.items()]
    if obstacles.file is not None:
        shapes += world.read(find(obstacles.file, "obstacles.file"))
    if obstacles.floor is not None:
        x, y, _ = arm.mounting.base_position
        shapes.append(Shape("floor", "half_space", SLAB, (x, y, obstacles.floor)))
    allowed = may_touch(collision, arm, shapes)
    if not shapes:
        return None
    if not arm.description.collision:
        raise ConfigError(f"obstacles: {arm.description.name} has no collision shapes; give them in robot.collision")
    return Obstacles(tuple(shapes), obstacles.margin, obstacles.influence, allowed)
