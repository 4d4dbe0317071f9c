"""Read a URDF or SDF, check it, and reduce it to the chain that moves: the form in which `arm.py` hands it to Drake.

Only the dynamics are kept: pictures, meshes, transmissions and simulator tags are dropped, so that a missing mesh
does not matter. Every joint off the chain from base to end effector becomes rigid at its given (or zero) position.
"""

from __future__ import annotations

import difflib
import xml.etree.ElementTree as ET
from collections.abc import Mapping
from pathlib import Path

import numpy as np
from scipy.spatial.transform import Rotation

from pipeline.common.arrays import Array
from pipeline.common.errors import RobotError
from pipeline.robot.description import Description
from pipeline.robot.sdf import to_urdf
from pipeline.robot.shapes import link_shapes

MOVING = ("revolute", "continuous", "prismatic")


KEPT_IN_LINK = {"inertial"}


def read(
    file: str | Path, end_effector: str, base: str | None = None, locked: Mapping[str, float] | None = None
) -> Description:
    """Load `file` and reduce it to the chain base -> end_effector; raises RobotError, one line, naming the culprit."""
    file = Path(file)
    if not file.is_file():
        raise RobotError(f"robot.urdf = {file}: no such file")
    if file.suffix == ".sdf":
        root = to_urdf(file)
    else:
        try:
            root = ET.fromstring(file.read_bytes())
        except ET.ParseError as error:
            raise RobotError(f"robot.urdf = {file}: not well-formed XML ({error})") from None
    if root.tag != "robot":
        raise RobotError(f"robot.urdf = {file}: the root element is <{root.tag}>, expected <robot>")

    links = _by_name(root, "link", file)
    joints = _by_name(root, "joint", file)
    parent_joint: dict[str, ET.Element] = {}
    for name, joint in joints.items():
        for end in ("parent", "child"):
            if _end(joint, end) not in links:
                raise RobotError(
                    f"robot.urdf = {file}: joint '{name}' has the {end} '{_end(joint, end)}', which is no link of the file"
                )
        child = _end(joint, "child")
        if child in parent_joint:
            raise RobotError(
                f"robot.urdf = {file}: link '{child}' is the child of two joints, '{parent_joint[child].get('name')}' and '{name}'"
            )
        parent_joint[child] = joint
        for place, key in (("origin", "xyz"), ("origin", "rpy"), ("axis", "xyz")):
            _vector(joint, place, key, file)
    roots = [link for link in links if link not in parent_joint]
    if len(roots) != 1:
        raise RobotError(
            f"robot.urdf = {file}: a robot has one root link, this one has {len(roots)} ({', '.join(roots) or 'a loop'})"
        )
    _require_known("robot.base", base, links, file)
    _require_known("robot.end_effector", end_effector, links, file)
    for joint_name in locked or {}:
        _require_known("robot.locked", joint_name, joints, file)

    chain = _chain(base or roots[0], end_effector, parent_joint, file)
    moving: list[ET.Element] = []
    for name, joint in joints.items():
        kind = joint.get("type", "")
        if joint in chain and name not in (locked or {}):
            if kind not in (*MOVING, "fixed"):
                raise RobotError(
                    f"robot.urdf = {file}: joint '{name}' in the chain is of type '{kind}'; allowed: {', '.join(MOVING)}, fixed"
                )
            if joint.find("mimic") is not None:
                raise RobotError(
                    f"robot.urdf = {file}: joint '{name}' in the chain mimics another joint; lock it (robot.locked.{name}=0)"
                )
        elif kind != "fixed":
            _freeze(joint, float((locked or {}).get(name, 0.0)), file)
    moving = [joint for joint in chain if joint.get("type") in MOVING]
    if not moving:
        raise RobotError(f"robot.urdf = {file}: no moving joint between '{base or roots[0]}' and '{end_effector}'")
    _check_inertia(links, moving, joints, file)
    revolute = np.array([joint.get("type") != "prismatic" for joint in moving])
    lower, upper = (_limits(moving, key, absent, file) for key, absent in (("lower", -np.inf), ("upper", np.inf)))
    velocity, effort = (_limits(moving, key, np.inf, file) for key in ("velocity", "effort"))
    shapes, meshes = link_shapes(root)
    pictures = dict.fromkeys(mesh.get("filename", "") for mesh in root.iterfind("link/visual/geometry/mesh"))
    _strip(root)  # drops the limits too

    return Description(
        name=root.get("name", file.stem),
        file=file,
        xml=ET.tostring(root, encoding="unicode"),
        base=roots[0],
        end_effector=end_effector,
        joints=tuple(joint.get("name", "") for joint in moving),
        revolute=revolute,
        lower=lower,
        upper=upper,
        velocity=velocity,
        effort=effort,
        links=tuple(links),
        collision=tuple(shapes),
        meshes=tuple(meshes),
        pictures=tuple(pictures),
    )


def _by_name(root: ET.Element, tag: str, file: Path) -> dict[str, ET.Element]:
    found: dict[str, ET.Element] = {}
    for element in root.findall(tag):
        name = element.get("name")
        if not name:
            raise RobotError(f"robot.urdf = {file}: a <{tag}> has no name")
        if name in found:
            raise RobotError(f"robot.urdf = {file}: two {tag}s are called '{name}'")
        found[name] = element
    return found


def _number(text: str, what: str, file: Path) -> float:
    try:
        value = float(text)
    except ValueError:
        value = np.nan
    if not np.isfinite(value):
        raise RobotError(f"robot.urdf = {file}: {what} '{text}', expected a number")
    return value


def _vector(joint: ET.Element, place: str, key: str, file: Path) -> Array:
    """The three numbers of <origin xyz>, <origin rpy> or <axis xyz> (a unit vector), with URDF's defaults."""
    element = joint.find(place)
    text = ("1 0 0" if place == "axis" else "0 0 0") if element is None else element.get(key, "0 0 0")
    what = f"joint '{joint.get('name')}' has in its {place} the {key}"
    values = np.array([_number(word, what, file) for word in text.split()])
    size = float(np.linalg.norm(values))
    if values.shape != (3,) or (place == "axis" and size == 0.0):
        raise RobotError(
            f"robot.urdf = {file}: {what} '{text}', expected three numbers"
            + (" that are not all zero" if place == "axis" else "")
        )
    return values / size if place == "axis" else values


def _end(joint: ET.Element, end: str) -> str:
    found = joint.find(end)
    return "" if found is None else found.get("link", "")


def _require_known(key: str, name: str | None, known: Mapping[str, ET.Element], file: Path) -> None:
    if name is None or name in known:
        return
    close = difflib.get_close_matches(name, known, n=3, cutoff=0.4) or list(known)[:12]
    raise RobotError(f"{key} = {name}: {file.name} has no such name; did you mean {', '.join(close)}?")


def _chain(base: str, tip: str, parent_joint: Mapping[str, ET.Element], file: Path) -> list[ET.Element]:
    chain: list[ET.Element] = []
    link = tip
    while link != base:
        if link not in parent_joint or parent_joint[link] in chain:
            raise RobotError(f"robot.end_effector = {tip}: not reached from robot.base = {base} in {file.name}")
        chain.insert(0, parent_joint[link])
        link = _end(parent_joint[link], "parent")
    return chain


def _limits(joints: list[ET.Element], key: str, absent: float, file: Path) -> Array:
    """One bound of each joint; a continuous joint has no position limits."""
    values = np.full(len(joints), absent)
    for index, joint in enumerate(joints):
        limit = joint.find("limit")
        unlimited = joint.get("type") == "continuous" and key in ("lower", "upper")
        if limit is not None and key in limit.attrib and not unlimited:
            values[index] = _number(limit.attrib[key], f"joint '{joint.get('name')}' has the {key} limit", file)
    return values


def _freeze(joint: ET.Element, position: float, file: Path) -> None:
    """Make a joint rigid, its position folded into its origin."""
    kind = joint.get("type")
    if position != 0.0 and kind in MOVING:
        axis = _vector(joint, "axis", "xyz", file)
        rotation = Rotation.from_euler("xyz", _vector(joint, "origin", "rpy", file))
        origin = joint.find("origin")
        if origin is None:
            origin = ET.SubElement(joint, "origin")
        if kind == "prismatic":
            shift = _vector(joint, "origin", "xyz", file) + rotation.apply(axis * position)
            origin.set("xyz", " ".join(map(repr, shift.tolist())))
        else:
            turned = rotation * Rotation.from_rotvec(axis * position)
            angles = turned.as_euler("xyz", suppress_warnings=True)
            origin.set("rpy", " ".join(map(repr, angles.tolist())))
    joint.set("type", "fixed")


def _check_inertia(
    links: Mapping[str, ET.Element], moving: list[ET.Element], joints: Mapping[str, ET.Element], file: Path
) -> None:
    """Every moving joint must carry something with mass, and every stated inertia must be one that a body can have."""
    children: dict[str, list[str]] = {}
    for joint in joints.values():
        if joint not in moving:
            children.setdefault(_end(joint, "parent"), []).append(_end(joint, "child"))
    massless: list[str] = []
    for joint in moving:
        rigid, queue = [], [_end(joint, "child")]
        while queue:
            link = queue.pop()
            rigid.append(link)
            queue += children.get(link, [])
        if sum(_mass(links[link], file) for link in rigid) <= 0.0:
            massless.append(_end(joint, "child"))
        for link in rigid:
            _check_physical(links[link], link, file)
    if massless:
        raise RobotError(
            f"robot.urdf = {file}: no mass on link{'s' if len(massless) > 1 else ''} {', '.join(massless)}; every moving link needs an <inertial> with a mass"
        )


def link_masses(description: Description) -> dict[str, float]:
    """The mass [kg] that each moving joint carries rigidly, up to the next moving joints."""
    joints = ET.fromstring(description.xml).findall("joint")
    names = {joint.get("name", ""): joint for joint in joints}
    return {name: _rigid_mass(description, _end(names[name], "child")) for name in description.joints}


def root_mass(description: Description) -> float:
    """The mass [kg] of the root link and of all that is fixed to it."""
    return _rigid_mass(description, description.base)


def _rigid_mass(description: Description, link: str) -> float:
    root = ET.fromstring(description.xml)
    links, total, queue = _by_name(root, "link", description.file), 0.0, [link]
    while queue:
        link = queue.pop()
        total += _mass(links[link], description.file)
        queue += [
            _end(joint, "child")
            for joint in root.findall("joint")
            if _end(joint, "parent") == link and joint.get("name") not in description.joints
        ]
    return total


def _mass(link: ET.Element, file: Path) -> float:
    mass = link.find("inertial/mass")
    value = 0.0 if mass is None else _number(mass.get("value", ""), f"link '{link.get('name')}' has the mass", file)
    if value < 0.0:
        raise RobotError(
            f"robot.urdf = {file}: link '{link.get('name')}' has the mass {value:g} kg, expected none or more"
        )
    return value


def _check_physical(link: ET.Element, name: str, file: Path) -> None:
    inertia = link.find("inertial/inertia")
    if inertia is None:
        return
    keys = ("ixx", "iyy", "izz", "ixy", "ixz", "iyz")
    entries = (_number(inertia.get(key, "0"), f"link '{name}' has the inertia {key}", file) for key in keys)
    xx, yy, zz, xy, xz, yz = entries
    a, b, c = np.linalg.eigvalsh(np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]]))
    slack = 1e-6 * max(abs(c), 1e-12)
    if a < -slack or a + b < c - slack:
        raise RobotError(
            f"robot.urdf = {file}: link '{name}' has an inertia that no body has (principal moments {a:.3g}, {b:.3g}, {c:.3g} kg m^2; each at most the sum of the others)"
        )


def _strip(root: ET.Element) -> None:
    for child in list(root):
        if child.tag not in ("link", "joint"):
            root.remove(child)
    for link in root.findall("link"):
        for child in list(link):
            if child.tag not in KEPT_IN_LINK:
                link.remove(child)
    for joint in root.findall("joint"):
        for child in list(joint):
            if child.tag in ("mimic", "dynamics", "safety_controller", "calibration", "limit"):
                joint.remove(child)
        # Drake needs no limits: they are ours to enforce. A revolute joint without <limit> is called continuous.
        if joint.get("type") == "revolute":
            joint.set("type", "continuous")
