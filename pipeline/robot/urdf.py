"""The arm of a robot file (URDF, SDF or MJCF): read, checked, and reduced to the chain that moves, as a URDF for Drake.

Only what moves and what touches is kept: pictures, transmissions and simulator tags are dropped, so that a missing
picture does not matter; the mesh of a collision shape is read where that shape is used. Every joint off the chain from
base to end effector becomes rigid at its given (or zero) position.
What Drake gets is written from the numbers that were checked, never from the text of the file.
"""

from __future__ import annotations

import difflib
import xml.etree.ElementTree as ET
from collections.abc import Collection, Mapping
from pathlib import Path

import numpy as np
from scipy.spatial.transform import Rotation

from pipeline.common.errors import RobotError
from pipeline.robot import formats, inertia, limits
from pipeline.robot.description import Description, Held
from pipeline.robot.formats.urdf import read as from_element
from pipeline.robot.numbers import written
from pipeline.robot.planar import split_planar
from pipeline.robot.tree import MOMENTS, ZERO, Joint, Tree

MOVING = ("revolute", "continuous", "prismatic")


def read(
    file: str | Path,
    end_effector: str,
    base: str | None = None,
    locked: Mapping[str, float] | None = None,
    *,
    repair_inertia: bool = False,
    unlimited: Collection[str] = (),
) -> Description:
    """Load `file` and reduce it to the chain base -> end_effector; raises RobotError, one line, naming the culprit.

    locked: positions [rad or m] of joints that are held. repair_inertia: whether inertias that no body can have give
    way to the nearest possible ones. unlimited: `velocity`, `effort` or both: a limit of zero then means none.
    """
    file, locked = Path(file), dict(locked or {})
    tree = formats.load(file, end_effector)
    split_planar(tree)
    carrier = tree.carriers()
    root = tree.root(carrier)
    _require_connected(tree, root)
    _require_known("robot.base", base, tree.links, file)
    _require_known("robot.end_effector", end_effector, tree.links, file)
    for name in locked:
        _require_known("robot.locked", name, tree.joints, file)
    base = base or root
    chain = _chain(base, end_effector, carrier, file)
    positions = _held(tree, chain, locked)
    held = tuple(
        Held(
            name, value, limits.bound(tree, tree.joints[name], "lower"), limits.bound(tree, tree.joints[name], "upper")
        )
        for name, value in locked.items()
    )
    limbs = [joint for joint in tree.joints.values() if joint.kind != "fixed" and joint not in chain]
    aside = {link for joint in limbs for link in tree.group(joint.child, set())}
    for name, position in positions.items():
        _freeze(tree, tree.joints[name], position)
    moving = [joint for joint in chain if joint.name not in positions]
    if not moving:
        raise tree.fail(f"no moving joint between '{base}' and '{end_effector}'")
    for joint in moving:
        _axis(tree, joint)
    names = {joint.name for joint in moving}
    for joint in moving:
        inertia.check(tree, tree.group(joint.child, names), repair_inertia)
    inertia.check_carried(tree, chain, moving)
    root_fault = ""
    try:
        inertia.check(tree, tree.group(root, names), repair_inertia)
    except RobotError as error:  # it counts where the base floats only
        root_fault = str(error)
        inertia.drop(tree, tree.group(root, names))
    if any(joint.armature for joint in moving):
        rotors = ",".join(f"{joint.armature:g}" for joint in moving)
        tree.notes.append(f"the file's rotor inertia is not used; robot.armature=[{rotors}] takes it")
    velocity, effort = (limits.bounds(tree, moving, key, unlimited) for key in ("velocity", "effort"))
    return Description(
        name=tree.name,
        file=file,
        xml=_to_xml(tree),
        base=root,
        end_effector=end_effector,
        joints=tuple(joint.name for joint in moving),
        revolute=np.array([joint.kind != "prismatic" for joint in moving]),
        lower=limits.bounds(tree, moving, "lower"),
        upper=limits.bounds(tree, moving, "upper"),
        velocity=velocity,
        effort=effort,
        links=tuple(tree.links),
        collision=tuple(tree.shapes),
        pictures=tuple(tree.pictures),
        held=held,
        notes=tuple(tree.notes),
        root_fault=root_fault,
        aside=frozenset(aside),
    )


def _require_known(key: str, name: str | None, known: Collection[str], file: Path) -> None:
    if name is None or name in known:
        return
    close = difflib.get_close_matches(name, known, n=3, cutoff=0.4) or list(known)[:12]
    raise RobotError(f"{key} = {name}: {file.name} has no such name; did you mean {', '.join(close)}?")


def _require_connected(tree: Tree, root: str) -> None:
    lost = set(tree.links) - set(tree.group(root, set()))
    if lost:
        raise tree.fail(f"the links {', '.join(sorted(lost)[:12])} are joined in a loop, which no base carries")


def _chain(base: str, tip: str, carrier: Mapping[str, Joint], file: Path) -> list[Joint]:
    chain: list[Joint] = []
    link = tip
    while link != base:
        if link not in carrier:
            raise RobotError(f"robot.end_effector = {tip}: not reached from robot.base = {base} in {file.name}")
        chain.insert(0, carrier[link])
        link = chain[0].parent
    return chain


def _held(tree: Tree, chain: list[Joint], locked: Mapping[str, float]) -> dict[str, float]:
    """The position of every joint that does not move.

    What is locked stands there, what mimics a joint that does not move stands by it, the rest off the chain at zero.
    Raises RobotError for what can neither move nor stand.
    """
    on_chain = {joint.name for joint in chain}

    def position(name: str, asked: tuple[str, ...] = ()) -> float | None:
        """Where a joint stands; None if it moves."""
        joint = tree.joints[name]
        if name in locked or joint.kind == "fixed":
            return float(locked.get(name, 0.0))
        if joint.mimic is not None:
            leader = joint.mimic.joint
            known = leader in tree.joints and leader not in (*asked, name)
            if name in on_chain and not known:
                raise tree.fail(f"joint '{name}' mimics '{leader}', which is no other joint of the file")
            ahead = position(leader, (*asked, name)) if known else 0.0
            if ahead is not None:
                return joint.mimic.multiplier * ahead + joint.mimic.offset
            if name not in on_chain:
                follows.append(name)
        return None if name in on_chain else 0.0

    follows: list[str] = []  # off the chain, what mimics a joint that moves
    positions = {name: stands for name in tree.joints if (stands := position(name)) is not None}
    for joint in chain:
        if joint.name in positions:
            if joint.name not in locked and joint.kind != "fixed":
                tree.notes.append(
                    f"joint {joint.name} stands at {positions[joint.name]:g}, as what it mimics does not move"
                )
        elif joint.kind not in MOVING:
            raise tree.fail(
                f"joint '{joint.name}' in the chain is of type '{joint.kind}'; allowed: {', '.join(MOVING)}, planar, "
                f"fixed; start after it (robot.base={joint.child}) or hold it (robot.locked.{joint.name}=0)"
            )
        elif joint.mimic is not None:
            raise tree.fail(
                f"joint '{joint.name}' in the chain mimics another joint; lock it (robot.locked.{joint.name}=0)"
            )
    if follows:
        named = ", ".join(dict.fromkeys(follows))
        tree.notes.append(f"{named}: off the chain, held at 0 although joints that they mimic move")
    return positions


def _axis(tree: Tree, joint: Joint) -> np.ndarray:
    """The unit vector (3,) that a joint turns about or slides along."""
    axis = np.array(joint.axis)
    size = float(np.linalg.norm(axis))
    if size == 0.0:
        raise tree.fail(
            f"joint '{joint.name}' has in its axis the xyz '{' '.join(f'{v:g}' for v in joint.axis)}', expected three "
            "numbers that are not all zero"
        )
    return axis / size


def _freeze(tree: Tree, joint: Joint, position: float) -> None:
    """Make a joint rigid, its position folded into its origin."""
    if position != 0.0 and joint.kind in MOVING:
        axis = _axis(tree, joint)
        rotation = Rotation.from_euler("xyz", joint.rpy)
        if joint.kind == "prismatic":
            joint.xyz = tuple((np.array(joint.xyz) + rotation.apply(axis * position)).tolist())
        else:
            turned = rotation * Rotation.from_rotvec(axis * position)
            joint.rpy = tuple(turned.as_euler("xyz", suppress_warnings=True).tolist())
    elif position != 0.0 and joint.kind != "fixed":
        raise RobotError(
            f"robot.locked.{joint.name} = {position:g}: a joint of type '{joint.kind}' can be held at 0 only"
        )
    joint.kind = "fixed"


def _to_xml(tree: Tree) -> str:
    """The URDF of links with masses and of joints without limits: those are ours to enforce."""
    robot = ET.Element("robot", name=tree.name)
    for link in tree.links.values():
        element = ET.SubElement(robot, "link", name=link.name)
        if link.inertial is not None and link.mass > 0.0:
            inertial = ET.SubElement(element, "inertial")
            _origin(inertial, link.inertial.com, link.inertial.rpy)
            ET.SubElement(inertial, "mass", value=repr(link.inertial.mass))
            ET.SubElement(inertial, "inertia", dict(zip(MOMENTS, map(repr, link.inertial.moments), strict=True)))
    for joint in tree.joints.values():
        # A revolute joint without <limit> is called continuous.
        kind = "continuous" if joint.kind == "revolute" else joint.kind
        element = ET.SubElement(robot, "joint", name=joint.name, type=kind)
        ET.SubElement(element, "parent", link=joint.parent)
        ET.SubElement(element, "child", link=joint.child)
        _origin(element, joint.xyz, joint.rpy)
        if kind != "fixed":
            ET.SubElement(element, "axis", xyz=written(joint.axis))
    return ET.tostring(robot, encoding="unicode")


def _origin(element: ET.Element, xyz: tuple[float, ...], rpy: tuple[float, ...]) -> None:
    if (xyz, rpy) != (ZERO, ZERO):
        ET.SubElement(element, "origin", xyz=written(xyz), rpy=written(rpy))


def link_masses(description: Description) -> dict[str, float]:
    """The mass [kg] that each moving joint carries rigidly, up to the next moving joints."""
    tree, names = _again(description)
    return {name: _mass(tree, tree.group(tree.joints[name].child, names)) for name in description.joints}


def carried_by(description: Description, joint: str) -> str:
    """The first link that a moving joint carries and that has a mass."""
    tree, names = _again(description)
    group = tree.group(tree.joints[joint].child, names)
    return next((link for link in group if tree.links[link].mass > 0.0), group[0])


def root_mass(description: Description) -> float:
    """The mass [kg] of the root link and of all that is fixed to it."""
    tree, names = _again(description)
    return _mass(tree, tree.group(description.base, names))


def check_root(description: Description) -> None:
    """Refuse an impossible inertia of the root link or of what is bolted to it: it counts where the base floats."""
    if description.root_fault:
        raise RobotError(description.root_fault)


def _again(description: Description) -> tuple[Tree, set[str]]:
    """The reduced robot, and its moving joints."""
    return from_element(ET.fromstring(description.xml), description.file, ""), set(description.joints)


def _mass(tree: Tree, links: list[str]) -> float:
    return sum(tree.links[link].mass for link in links)
