"""Read a URDF, check it, and reduce it to the chain that moves: the form in which `arm.py` hands it to Drake.

Only the dynamics are kept: pictures, meshes, transmissions and simulator tags are dropped, so that a missing mesh
does not matter. Every joint off the chain from base to end effector becomes rigid at its given (or zero) position.
"""

from __future__ import annotations

import difflib
import xml.etree.ElementTree as ET
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from pipeline.errors import RobotError

MOVING = ("revolute", "continuous", "prismatic")
KEPT_IN_LINK = {"inertial"}


@dataclass(frozen=True)
class Description:
    """One serial chain, ready for Drake.

    xml: the reduced URDF. joints: names of the n moving joints, base to tip. revolute: (n,) whether a joint turns.
    lower, upper: (n,) position limits [rad or m]. velocity: (n,) [rad/s or m/s]. effort: (n,) [N m or N].
    A limit that the file does not state is infinite.
    """

    name: str
    file: Path
    xml: str
    base: str
    end_effector: str
    joints: tuple[str, ...]
    revolute: NDArray[np.bool_]
    lower: NDArray[np.float64]
    upper: NDArray[np.float64]
    velocity: NDArray[np.float64]
    effort: NDArray[np.float64]


def read(
    file: str | Path, end_effector: str, base: str | None = None, locked: Mapping[str, float] | None = None
) -> Description:
    """Load `file` and reduce it to the chain base -> end_effector; raises RobotError, one line, naming the culprit."""
    file = Path(file)
    if not file.is_file():
        raise RobotError(f"robot.urdf = {file}: no such file")
    try:
        root = ET.fromstring(file.read_bytes())
    except ET.ParseError as error:
        raise RobotError(f"robot.urdf = {file}: not well-formed XML ({error})") from None
    if root.tag != "robot":
        raise RobotError(f"robot.urdf = {file}: the root element is <{root.tag}>, expected <robot>")

    links = {_name(link, file): link for link in root.findall("link")}
    joints = {_name(joint, file): joint for joint in root.findall("joint")}
    parent_joint: dict[str, ET.Element] = {}
    for name, joint in joints.items():
        for end in ("parent", "child"):
            if _end(joint, end) not in links:
                raise RobotError(
                    f"robot.urdf = {file}: joint '{name}' has the {end} '{_end(joint, end)}', which is no link of the file"
                )
        parent_joint[_end(joint, "child")] = joint
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
            _freeze(joint, float((locked or {}).get(name, 0.0)))
    moving = [joint for joint in chain if joint.get("type") in MOVING]
    if not moving:
        raise RobotError(f"robot.urdf = {file}: no moving joint between '{base or roots[0]}' and '{end_effector}'")
    _check_inertia(links, moving, joints, file)
    _strip(root)

    return Description(
        name=root.get("name", file.stem),
        file=file,
        xml=ET.tostring(root, encoding="unicode"),
        base=roots[0],
        end_effector=end_effector,
        joints=tuple(joint.get("name", "") for joint in moving),
        revolute=np.array([joint.get("type") != "prismatic" for joint in moving]),
        lower=np.array([_limit(joint, "lower", -np.inf, file) for joint in moving]),
        upper=np.array([_limit(joint, "upper", np.inf, file) for joint in moving]),
        velocity=np.array([_limit(joint, "velocity", np.inf, file) for joint in moving]),
        effort=np.array([_limit(joint, "effort", np.inf, file) for joint in moving]),
    )


def _name(element: ET.Element, file: Path) -> str:
    name = element.get("name")
    if not name:
        raise RobotError(f"robot.urdf = {file}: a <{element.tag}> has no name")
    return name


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
        if link not in parent_joint:
            raise RobotError(f"robot.end_effector = {tip}: not reached from robot.base = {base} in {file.name}")
        chain.insert(0, parent_joint[link])
        link = _end(parent_joint[link], "parent")
    return chain


def _limit(joint: ET.Element, which: str, absent: float, file: Path) -> float:
    limit = joint.find("limit")
    if (
        limit is None
        or (joint.get("type") == "continuous" and which in ("lower", "upper"))
        or which not in limit.attrib
    ):
        return absent
    try:
        return float(limit.attrib[which])
    except ValueError:
        raise RobotError(
            f"robot.urdf = {file}: joint '{joint.get('name')}' has the {which} limit '{limit.attrib[which]}', expected a number"
        ) from None


def _freeze(joint: ET.Element, position: float) -> None:
    """Make a joint rigid, its position folded into its origin."""
    kind = joint.get("type")
    origin = joint.find("origin")
    if origin is None:
        origin = ET.SubElement(joint, "origin")
    if position != 0.0 and kind in MOVING:
        axis_element = joint.find("axis")
        axis = np.array(
            (axis_element.get("xyz", "1 0 0") if axis_element is not None else "1 0 0").split(), dtype=float
        )
        rotation = Rotation.from_euler("xyz", np.array(origin.get("rpy", "0 0 0").split(), dtype=float))
        if kind == "prismatic":
            shift = np.array(origin.get("xyz", "0 0 0").split(), dtype=float) + rotation.apply(axis * position)
            origin.set("xyz", " ".join(map(repr, shift.tolist())))
        else:
            turned = (rotation * Rotation.from_rotvec(axis * position)).as_euler("xyz")
            origin.set("rpy", " ".join(map(repr, turned.tolist())))
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


def _mass(link: ET.Element, file: Path) -> float:
    mass = link.find("inertial/mass")
    if mass is None:
        return 0.0
    try:
        return float(mass.get("value", "0"))
    except ValueError:
        raise RobotError(
            f"robot.urdf = {file}: link '{link.get('name')}' has the mass '{mass.get('value')}', expected a number"
        ) from None


def _check_physical(link: ET.Element, name: str, file: Path) -> None:
    inertia = link.find("inertial/inertia")
    if inertia is None:
        return
    try:
        xx, yy, zz, xy, xz, yz = (float(inertia.get(key, "0")) for key in ("ixx", "iyy", "izz", "ixy", "ixz", "iyz"))
    except ValueError:
        raise RobotError(f"robot.urdf = {file}: link '{name}' has an inertia entry that is not a number") from None
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
