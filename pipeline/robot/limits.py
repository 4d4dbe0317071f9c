"""Limits of joints as files state them: which numbers are none, and which nothing could keep."""

from __future__ import annotations

from collections.abc import Collection

import numpy as np

from pipeline.common.arrays import Array
from pipeline.common.errors import RobotError
from pipeline.robot.description import Description
from pipeline.robot.numbers import number, shown
from pipeline.robot.tree import Joint, Tree

UNLIMITED = 1e6  # [rad, m, rad/s, N m, ...]: from here on a number says that there is no limit; SDF writes 1e16
STILL = 1e-9  # [rad/s, N m, ...]: below it nothing moves, and solvers that divide by a bound do not live through it
ABSENT = {"lower": -np.inf, "upper": np.inf, "velocity": np.inf, "effort": np.inf}
OVERRIDE = {"velocity": "limits.velocity", "effort": "limits.torque"}


def bound(tree: Tree, joint: Joint, key: str) -> float:
    """One bound of a joint, infinite where there is none; a continuous joint has no position limits."""
    text = joint.limit.get(key)
    if text is None or (joint.kind == "continuous" and key in ("lower", "upper")):
        return ABSENT[key]
    value = number(text, f"robot.urdf = {tree.file}: joint '{joint.name}' has the {key} limit", infinite=True)
    if abs(value) < UNLIMITED:
        return value
    if key in ("lower", "upper") and np.sign(value) != np.sign(ABSENT[key]):
        side = "above" if key == "lower" else "below"
        raise tree.fail(f"joint '{joint.name}' has the {key} limit '{shown(text)}': no position is {side} it")
    return ABSENT[key]  # of a negative velocity or effort too: files bound it by -1e16 and 1e16


def bounds(tree: Tree, joints: list[Joint], key: str, unlimited: Collection[str] = ()) -> Array:
    """One bound of each joint (n,). unlimited: for which of velocity and effort next to nothing means no limit."""
    values = np.array([bound(tree, joint, key) for joint in joints])
    if key in unlimited:
        empty = values < STILL
        if empty.any():
            names = ", ".join(joint.name for joint, none in zip(joints, empty, strict=True) if none)
            tree.notes.append(
                f"robot.unlimited: the {key} limits of {names} are none or next to none in the file, taken as no limits"
            )
        values[empty] = np.inf
    return values


def require_room(description: Description, key: str, values: Array) -> None:
    """Refuse velocity or effort limits (n,) within which nothing could move: those of a file may be so."""
    stuck = np.flatnonzero(values < STILL)
    if stuck.size:
        names = ", ".join(description.joints[i] for i in stuck)
        stated = ", ".join(dict.fromkeys(f"{values[i]:g}" for i in stuck))
        raise RobotError(
            f"robot.urdf = {description.file}: the {key} limit of {names} is {stated}, so nothing could move; give "
            f"{OVERRIDE[key]} (one number, or one per joint), or robot.unlimited=[{key}] to take it as none stated"
        )


def require_held_within(description: Description) -> None:
    """Refuse a joint of robot.locked that stands outside the position limits of the file."""
    for held in description.held:
        if not held.lower - 1e-9 <= held.position <= held.upper + 1e-9:
            raise RobotError(
                f"robot.locked.{held.joint} = {held.position:g}: outside the limits of the joint, {held.lower:g} to "
                f"{held.upper:g}"
            )
