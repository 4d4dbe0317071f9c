"""The body that a moving base carries, and the description with the base's own coordinates before the joints."""

from __future__ import annotations

import xml.etree.ElementTree as ET
from dataclasses import dataclass, replace

import numpy as np

from pipeline.robot.description import Description

AXIS = {"x": "1 0 0", "y": "0 1 0", "z": "0 0 1", "yaw": "0 0 1", "pitch": "0 1 0", "roll": "1 0 0"}


@dataclass(frozen=True)
class Spacecraft:
    """The body that the root link is bolted to, beside that link's own mass.

    mass [kg], inertia (3, 3) about its centre of mass com (3,) [m], all in the frame of the root link.
    momentum (6,): linear [N s], then angular [N m s] about the place where the root link starts, of the whole system in
    the world.
    """

    mass: float = 0.0
    inertia: tuple[tuple[float, ...], ...] = ((0.0,) * 3,) * 3
    com: tuple[float, ...] = (0.0, 0.0, 0.0)
    momentum: tuple[float, ...] = (0.0,) * 6


def on_moving_base(description: Description, spacecraft: Spacecraft, names: tuple[str, ...]) -> Description:
    """The description with a massless chain of joints before its root link, and the spacecraft bolted to that link.

    names: of the coordinates that the chain gives the base, in order, out of x, y, z [m], yaw, pitch, roll [rad].
    """
    robot = ET.fromstring(description.xml)
    taken = {element.get("name", "") for element in robot}
    prefix = "base"
    while any(name.startswith(f"{prefix}_") for name in taken):
        prefix += "_"
    if spacecraft.mass > 0:
        body = ET.SubElement(robot, "link", name=f"{prefix}_spacecraft")
        inertial = ET.SubElement(body, "inertial")
        ET.SubElement(inertial, "origin", xyz=_text(spacecraft.com))
        ET.SubElement(inertial, "mass", value=repr(float(spacecraft.mass)))
        (xx, xy, xz), (_, yy, yz), (_, _, zz) = spacecraft.inertia
        moments = {"ixx": xx, "iyy": yy, "izz": zz, "ixy": xy, "ixz": xz, "iyz": yz}
        ET.SubElement(inertial, "inertia", {key: repr(float(value)) for key, value in moments.items()})
        _joint(robot, f"{prefix}_bolted", "fixed", description.base, f"{prefix}_spacecraft")
    root = parent = f"{prefix}_start"
    ET.SubElement(robot, "link", name=root)
    for name in names:
        child = description.base if name == names[-1] else f"{prefix}_link_{name}"
        if name != names[-1]:
            ET.SubElement(robot, "link", name=child)
        joint = _joint(robot, f"{prefix}_{name}", "prismatic" if len(name) == 1 else "continuous", parent, child)
        ET.SubElement(joint, "axis", xyz=AXIS[name])
        parent = child
    free = np.full(len(names), np.inf)
    return replace(
        description,
        xml=ET.tostring(robot, encoding="unicode"),
        joints=(*(f"{prefix}_{name}" for name in names), *description.joints),
        revolute=np.concatenate([[len(name) > 1 for name in names], description.revolute]),
        lower=np.concatenate([-free, description.lower]),
        upper=np.concatenate([free, description.upper]),
        velocity=np.concatenate([free, description.velocity]),
        effort=np.concatenate([free, description.effort]),
        base_coordinates=len(names),
        root=root,
    )


def _joint(robot: ET.Element, name: str, kind: str, parent: str, child: str) -> ET.Element:
    joint = ET.SubElement(robot, "joint", name=name, type=kind)
    ET.SubElement(joint, "parent", link=parent)
    ET.SubElement(joint, "child", link=child)
    return joint


def _text(values: tuple[float, ...]) -> str:
    return " ".join(repr(float(value)) for value in values)
