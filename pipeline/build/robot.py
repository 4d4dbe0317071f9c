"""The arm of a configuration: description, shapes, what it stands on and carries, where it starts."""

from __future__ import annotations

import difflib
from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any

import numpy as np
from scipy.spatial.transform import Rotation

from pipeline.build.regular import require_regular
from pipeline.common.arrays import Array
from pipeline.common.errors import ConfigError, RobotError
from pipeline.config.robot import BoxConfig, CapsuleConfig, CylinderConfig, RobotConfig, SphereConfig
from pipeline.model.arm import Arm
from pipeline.robot import urdf
from pipeline.robot.description import Description
from pipeline.robot.mounting import Mounting
from pipeline.robot.packages import find
from pipeline.robot.shapes import Shape, capsule
from pipeline.robot.tool import with_tool

GRAVITY = {"none": (0.0, 0.0, 0.0), "earth": (0.0, 0.0, -9.80665)}  # [m/s^2]


def load(robot: RobotConfig, gravity: str | Sequence[float] = "none") -> Arm:
    """The arm of a configuration; raises RobotError or ConfigError, one line."""
    description = urdf.read(
        find(robot.urdf),
        robot.end_effector,
        robot.base,
        robot.locked,
        repair_inertia=robot.repair_inertia,
        unlimited=robot.unlimited,
    )
    if robot.collision != "file":
        shapes = _link_shapes(robot.collision, description)
        description = replace(description, collision=shapes)
    if robot.tool:
        description = with_tool(description, [make_shape("tool", shape) for shape in robot.tool])
    if isinstance(robot.armature, tuple) and len(robot.armature) != len(description.joints):
        raise ConfigError(
            f"robot.armature has {len(robot.armature)} values, the arm has {len(description.joints)} moving joints"
        )
    mounting = Mounting(
        offset=robot.offset,
        offset_rpy=robot.offset_rpy,
        base_position=robot.base_position,
        base_rpy=robot.base_rpy,
        gravity=GRAVITY[gravity] if isinstance(gravity, str) else tuple(gravity),
        payload=robot.payload,
        armature=robot.armature,
    )
    arm = Arm(description, mounting)
    require_regular(arm)
    return arm


def initial(robot: RobotConfig, arm: Arm) -> Array:
    """robot.q_init, or the middle of the joints' ranges; zero where a joint has none."""
    if robot.q_init is None:
        low, high = arm.description.lower, arm.description.upper
        ranged = np.isfinite(high - low)
        return np.where(ranged, np.where(ranged, low + high, 0.0) / 2, 0.0)
    if len(robot.q_init) != arm.n:
        names = ", ".join(arm.description.joints)
        raise RobotError(f"robot.q_init has {len(robot.q_init)} values, the arm has {arm.n} moving joints ({names})")
    return np.array(robot.q_init)


def make_shape(name: str, shape: Any, frame: str | None = None) -> Shape:
    if isinstance(shape, CapsuleConfig):
        return capsule(name, np.array(shape.start), np.array(shape.end), shape.radius, frame)
    center = tuple(shape.center)
    if isinstance(shape, SphereConfig):
        return Shape(name, "sphere", (shape.radius,), center, frame=frame)
    turn = tuple(Rotation.from_euler("xyz", shape.rpy).as_rotvec().tolist())
    if isinstance(shape, BoxConfig):
        return Shape(name, "box", tuple(shape.size), center, turn, frame)
    if isinstance(shape, CylinderConfig):
        return Shape(name, "cylinder", (shape.radius, shape.length), center, turn, frame)
    return Shape(name, "mesh", tuple(shape.scale), center, turn, frame, str(find(shape.file, "file of a mesh")))


def _link_shapes(table: Mapping[str, Sequence[Any]], description: Description) -> tuple[Shape, ...]:
    """The shapes that the configuration gives the links, in place of those of the description."""
    links = description.links
    for link in table:
        if link not in links:
            close = difflib.get_close_matches(link, links, n=3, cutoff=0.4) or list(links)[:12]
            raise ConfigError(f"robot.collision.{link}: no such link; did you mean {', '.join(close)}?")
    return tuple(make_shape(link, shape, link) for link, shapes in table.items() for shape in shapes)
