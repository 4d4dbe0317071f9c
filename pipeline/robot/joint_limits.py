"""Limits of joints from a file of ROS 2, joint_limits.yaml (MoveIt, ros2_control): what a URDF has no place for.

joint_limits:
  joint1:
    has_acceleration_limits: true
    max_acceleration: 15.0

A bound holds where its `has_..._limits` is true; other keys of a joint, and joints that the arm does not have, are
nothing to us.
"""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
import yaml

from pipeline.common.arrays import Array
from pipeline.common.errors import RobotError
from pipeline.robot.limits import STILL

# Of each key of `problem.limits.Limits`: the key of the file, and the switch that says whether it holds.
KEYS = {
    "lower": ("min_position", "has_position_limits"),
    "upper": ("max_position", "has_position_limits"),
    "velocity": ("max_velocity", "has_velocity_limits"),
    "acceleration": ("max_acceleration", "has_acceleration_limits"),
    "jerk": ("max_jerk", "has_jerk_limits"),
    "torque": ("max_effort", "has_effort_limits"),
}


def read(file: Path, joints: Sequence[str], named: str = "limits.file") -> dict[str, Array]:
    """The bounds (n,) of `joints` that the file states, by the keys of KEYS; nan where it states none. Raises
    RobotError, one line. named: the key of the configuration that names the file.
    """
    where = f"{named} = {file}"
    stated = _load(file, where)
    if not set(joints) & set(stated):
        raise RobotError(
            f"{where}: states limits of {', '.join(map(str, stated)) or 'no joint'}; the arm has {', '.join(joints)}"
        )
    found = {key: np.full(len(joints), np.nan) for key in KEYS}
    for i, joint in enumerate(joints):
        rows = stated.get(joint, {})
        if not isinstance(rows, dict):
            raise RobotError(f"{where}: {joint}: a table of keys such as max_acceleration is needed")
        for key, (name, switch) in KEYS.items():
            if rows.get(switch) is True:
                found[key][i] = _number(where, joint, name, rows.get(name))
    return {key: values for key, values in found.items() if np.isfinite(values).any()}


def _load(file: Path, where: str) -> dict[Any, Any]:
    try:
        held = yaml.safe_load(file.read_text(encoding="utf-8"))
    except (OSError, UnicodeDecodeError) as error:
        raise RobotError(f"{where}: {getattr(error, 'strerror', None) or 'not UTF-8 text'}") from None
    except yaml.YAMLError as error:
        raise RobotError(f"{where}: {' '.join(str(error).split())}") from None
    stated = held.get("joint_limits") if isinstance(held, dict) else None
    if not isinstance(stated, dict):
        raise RobotError(f"{where}: no table joint_limits, as joint_limits.yaml of ROS 2 has it")
    return stated


def _number(where: str, joint: str, name: str, value: Any) -> float:
    numeric = isinstance(value, int | float) and not isinstance(value, bool) and np.isfinite(value)
    if not numeric or (not name.endswith("position") and value < STILL):
        needed = "a number" if name.endswith("position") else f"one of at least {STILL:g}"
        said = "is missing" if value is None else f"= {value}"
        raise RobotError(f"{where}: {name} of {joint} {said}; {needed} is needed")
    return float(value)
