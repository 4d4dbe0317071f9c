"""Solids that are fixed to the end effector: a tool, or what a gripper holds."""

from __future__ import annotations

import xml.etree.ElementTree as ET
from collections.abc import Sequence
from dataclasses import replace

from pipeline.robot.description import Description
from pipeline.robot.shapes import Shape


def with_tool(description: Description, shapes: Sequence[Shape]) -> Description:
    """The description with a massless link that has these shapes, in the frame of the end effector's link."""
    robot = ET.fromstring(description.xml)
    taken, name = {element.get("name", "") for element in robot}, "tool"
    while name in taken or f"{name}_mount" in taken:
        name += "_"
    ET.SubElement(robot, "link", name=name)
    joint = ET.SubElement(robot, "joint", name=f"{name}_mount", type="fixed")
    ET.SubElement(joint, "parent", link=description.end_effector)
    ET.SubElement(joint, "child", link=name)
    return replace(
        description,
        xml=ET.tostring(robot, encoding="unicode"),
        links=(*description.links, name),
        collision=(*description.collision, *(replace(shape, name=name, frame=name) for shape in shapes)),
        tool=name,
    )
