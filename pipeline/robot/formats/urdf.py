"""A URDF as a `Tree`. What moves nothing and is not touched (pictures, simulators' blocks) is dropped."""

from __future__ import annotations

import xml.etree.ElementTree as ET
from pathlib import Path

from pipeline.common.errors import RobotError
from pipeline.robot.markup import only
from pipeline.robot.numbers import Vector, number, numbers, shown
from pipeline.robot.shapes import link_shapes
from pipeline.robot.tree import MOMENTS, ZERO, Inertial, Joint, Link, Mimic, Tree


def read(root: ET.Element, file: Path, end_effector: str) -> Tree:
    """The robot of a <robot> element; raises RobotError, one line, naming link or joint, tag and text."""
    _refuse_xacro(root, file)
    tree = Tree(root.get("name") or file.stem, file)
    for link in root.findall("link"):
        name = link.get("name", "")
        solid = link.find("visual") is not None or link.find("collision") is not None
        tree.add_link(Link(name, _inertial(link, f"robot.urdf = {file}: link '{name}' has"), solid))
    for joint in root.findall("joint"):
        tree.add_joint(_joint(joint, f"robot.urdf = {file}: joint '{joint.get('name')}' has"))
    if tree.links:
        tree.shapes = link_shapes(root, f"robot.urdf = {file}", file.parent)
    tree.pictures = list(dict.fromkeys(m.get("filename", "") for m in root.iterfind("link/visual/geometry/mesh")))
    return tree


def _refuse_xacro(root: ET.Element, file: Path) -> None:
    """A file for xacro is a program that writes a URDF."""
    for element in root.iter():
        template = next((value for value in element.attrib.values() if "${" in value or "$(" in value), None)
        if element.tag.startswith("xacro:") or (
            template and element.tag in ("link", "joint", "origin", "mass", "limit")
        ):
            what = f"<{element.tag}>" if template is None else f"'{shown(template)}' in a <{element.tag}>"
            raise RobotError(
                f"robot.urdf = {file}: a xacro file, not expanded ({what}); expand it first: "
                f"xacro {file.name} > {file.name.split('.')[0]}_expanded.urdf"
            )


def _inertial(link: ET.Element, where: str) -> Inertial | None:
    inertial = only(link, "inertial", where)
    if inertial is None:
        return None
    mass, inertia = only(inertial, "mass", where), only(inertial, "inertia", where)
    moments: Vector = (0.0,) * 6  # a point mass
    if inertia is not None:
        written = {key: inertia.get(key, "" if key in ("ixx", "iyy", "izz") else "0") for key in MOMENTS}
        moments = tuple(number(text, f"{where} the inertia {key}") for key, text in written.items())
    return Inertial(
        0.0 if mass is None else number(mass.get("value", ""), f"{where} the mass"),
        _vector(inertial, "origin", "xyz", f"{where} in its inertial"),
        _vector(inertial, "origin", "rpy", f"{where} in its inertial"),
        moments,
    )


def _joint(joint: ET.Element, where: str) -> Joint:
    kind, limit, mimic = joint.get("type", ""), only(joint, "limit", where), only(joint, "mimic", where)
    follows = None
    if mimic is not None:
        factors = (number(mimic.get(key, default), f"{where} in its mimic the {key}")
                   for key, default in (("multiplier", "1"), ("offset", "0")))  # fmt: skip
        follows = Mimic(mimic.get("joint", ""), *factors)
    return Joint(
        joint.get("name", ""),
        kind,
        _end(joint, "parent", where),
        _end(joint, "child", where),
        _vector(joint, "origin", "xyz", f"{where} in its"),
        _vector(joint, "origin", "rpy", f"{where} in its"),
        # An axis says nothing of a fixed joint, and many files have three zeros there.
        _vector(joint, "axis", "xyz", f"{where} in its", "1 0 0") if kind != "fixed" else (1.0, 0.0, 0.0),
        {} if limit is None else dict(limit.attrib),
        follows,
    )


def _vector(element: ET.Element, tag: str, key: str, where: str, absent: str = "0 0 0") -> Vector:
    """The three numbers of <origin xyz>, <origin rpy> or <axis xyz>."""
    found = only(element, tag, where)
    if found is None:
        return ZERO if absent == "0 0 0" else numbers(absent, 3, "")
    return numbers(found.get(key, absent), 3, f"{where} {tag} the {key}")


def _end(joint: ET.Element, end: str, where: str) -> str:
    found = only(joint, end, where)
    return "" if found is None else found.get("link", "")
