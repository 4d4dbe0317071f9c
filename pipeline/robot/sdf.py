"""An SDF model as the URDF that says the same: Drake reads the one, `urdf.py` checks and reduces the other.

Every joint keeps its name, and every link its own frame: where that is not the joint's frame, a massless link between
them carries the difference. Pictures and meshes are dropped.
"""

from __future__ import annotations

import logging
import xml.etree.ElementTree as ET
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np
from pydrake.math import RollPitchYaw
from pydrake.multibody.parsing import Parser
from pydrake.multibody.plant import MultibodyPlant
from pydrake.multibody.tree import PrismaticJoint, RevoluteJoint, WeldJoint

from pipeline.common.errors import RobotError


def to_urdf(file: Path) -> ET.Element:
    """The <robot> element of the first model of `file`; raises RobotError in one line."""
    plant = MultibodyPlant(0.0)
    parser = Parser(plant)
    parser.SetAutoRenaming(True)
    try:
        with _quiet():
            model = parser.AddModels(str(file))[0]
    except (RuntimeError, IndexError) as error:
        reason = " ".join(str(error).split()) or "it holds no model"
        raise RobotError(f"robot.urdf = {file}: {reason}") from None
    plant.Finalize()
    robot = ET.Element("robot", name=plant.GetModelInstanceName(model))
    links, mimicking = _stated(file)
    bodies = [plant.get_body(index) for index in plant.GetBodyIndices(model)]
    for body in bodies:
        robot.append(_link(body, links.get(body.name())))
    joined: set[str] = set()
    for index in plant.GetJointIndices(model):
        joint = plant.get_joint(index)
        parent, child = joint.parent_body(), joint.child_body()
        if parent.index() == plant.world_body().index():
            if isinstance(joint, WeldJoint):
                continue  # the root's place is ours to give (robot.base_position)
            if joint.name() == child.name() or joint.type_name() == "quaternion_floating":
                continue  # Drake's own free joint of a model that stands nowhere
            if not any(link.get("name") == "world" for link in robot.findall("link")):
                robot.insert(0, ET.Element("link", name="world"))
        joined.add(child.name())
        element = _add_joint(robot, joint)
        if joint.name() in mimicking:
            ET.SubElement(element, "mimic")  # which this plant ignores: for urdf.py to refuse, or to hold
    return robot


@contextmanager
def _quiet() -> Iterator[None]:
    """What Drake warns of is either refused here, in one line, or does not matter."""
    log = logging.getLogger("drake")
    before = log.level
    log.setLevel(logging.CRITICAL)
    try:
        yield
    finally:
        log.setLevel(before)


def _stated(file: Path) -> tuple[dict[str, ET.Element], set[str]]:
    """The links as written, of which Drake silently replaces what no body can have, and the joints that mimic others."""
    try:
        root = ET.parse(file).getroot()
    except ET.ParseError as error:
        raise RobotError(f"robot.urdf = {file}: not well-formed XML ({error})") from None
    links = {link.get("name", ""): link for link in root.iter("link")}
    return links, {joint.get("name", "") for joint in root.iter("joint") if joint.find("axis/mimic") is not None}


def _link(body: Any, stated: ET.Element | None) -> ET.Element:
    """The link with the mass that the file gives it: none if it gives none, where SDF's own default is 1 kg."""
    link = ET.Element("link", name=body.name())
    if stated is not None and stated.find("inertial") is None:
        return link
    mass = float(body.default_mass())
    written = None if stated is None else stated.findtext("inertial/mass")
    if written is not None and float(written) < 0:
        mass = float(written)  # for urdf.py to refuse by name
    center = body.default_com()
    about = body.default_spatial_inertia().Shift(center).CalcRotationalInertia().CopyToFullMatrix3()
    inertial = ET.SubElement(link, "inertial")
    ET.SubElement(inertial, "origin", xyz=_text(center), rpy="0 0 0")
    ET.SubElement(inertial, "mass", value=repr(mass))
    entries = {"ixx": (0, 0), "iyy": (1, 1), "izz": (2, 2), "ixy": (0, 1), "ixz": (0, 2), "iyz": (1, 2)}
    values = {key: repr(float(about[place])) for key, place in entries.items()}
    inertia = None if stated is None else stated.find("inertial/inertia")
    if inertia is not None:
        matrix = {key: float(inertia.findtext(key, "0")) for key in entries}
        full = np.array([[matrix["i" + "".join(sorted(a + b))] for b in "xyz"] for a in "xyz"])
        moments = np.linalg.eigvalsh(full)
        if moments[0] < 0 or moments[0] + moments[1] < moments[2] * (1 - 1e-6):
            values = {key: repr(value) for key, value in matrix.items()}  # for urdf.py to refuse by name
    ET.SubElement(inertial, "inertia", values)
    return link


def _add_joint(robot: ET.Element, joint: Any) -> ET.Element:
    kinds = {RevoluteJoint: "revolute", PrismaticJoint: "prismatic", WeldJoint: "fixed"}
    kind = next((word for cls, word in kinds.items() if isinstance(joint, cls)), joint.type_name())
    name, child = joint.name(), joint.child_body().name()
    before = joint.frame_on_parent().GetFixedPoseInBodyFrame()
    after = joint.frame_on_child().GetFixedPoseInBodyFrame().inverse()
    if isinstance(joint, WeldJoint):
        before, after = before @ joint.X_FM() @ after, None
    elif after.IsNearlyIdentity(1e-12):
        after = None
    between = child if after is None else f"{child} (frame of {name})"
    element = _joint(robot, name, kind, joint.parent_body().name(), between, before)
    if kind in ("revolute", "prismatic"):
        axis = joint.revolute_axis() if kind == "revolute" else joint.translation_axis()
        ET.SubElement(element, "axis", xyz=_text(axis))
        low, high = float(joint.position_lower_limits()[0]), float(joint.position_upper_limits()[0])
        bounds = {"lower": low, "upper": high, "velocity": float(joint.velocity_upper_limits()[0])}
        bounds["effort"] = _effort(joint)
        if kind == "revolute" and not (np.isfinite(low) or np.isfinite(high)):
            element.set("type", "continuous")
        ET.SubElement(element, "limit", {key: repr(v) for key, v in bounds.items() if np.isfinite(v)})
    if after is not None:
        robot.append(ET.Element("link", name=between))
        _joint(robot, f"{name}__frame", "fixed", between, child, after)
    return element


def _effort(joint: Any) -> float:
    plant = joint.GetParentPlant()
    for index in plant.GetJointActuatorIndices():
        actuator = plant.get_joint_actuator(index)
        if actuator.joint().index() == joint.index():
            return float(actuator.effort_limit())
    return np.inf


def _joint(robot: ET.Element, name: str, kind: str, parent: str, child: str, pose: Any) -> ET.Element:
    element = ET.SubElement(robot, "joint", name=name, type=kind)
    ET.SubElement(element, "parent", link=parent)
    ET.SubElement(element, "child", link=child)
    angles = RollPitchYaw(pose.rotation()).vector()
    ET.SubElement(element, "origin", xyz=_text(pose.translation()), rpy=_text(angles))
    return element


def _text(values: Any) -> str:
    return " ".join(repr(float(value)) for value in values)
