"""What a robot file says of itself where nobody else does: which link is its last, and whether it moves in a plane."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np
from scipy.spatial.transform import Rotation

from pipeline.common.errors import RobotError
from pipeline.robot import formats
from pipeline.robot.planar import split_planar
from pipeline.robot.tree import Joint, Tree

MOVING = ("revolute", "continuous", "prismatic")
TOOL = re.compile(r"(?<![a-z])(tool0?|tcp|tip|ee|eef|end_?effector)(?![a-z])", re.IGNORECASE)  # in a tool's name
FINGER = re.compile("finger|thumb", re.IGNORECASE)
GRIPS = re.compile(
    "gripper|finger|thumb|jaw|knuckle|claw", re.IGNORECASE
)  # in the name of a joint that is not the arm's
LEVEL = 1e-9


class SeveralArmsError(RobotError):
    """The file leaves open which arm moves."""


def read(file: Path, base: str | None, end_effector: str | None) -> tuple[str, bool]:
    """The last link of the arm in `file` (or the one given), and whether its joints move it in a plane z = const only.

    Raises RobotError for a file that is none of a robot, SeveralArmsError where nobody says which.
    """
    tree = formats.load(file, end_effector or "")
    split_planar(tree)
    carrier = tree.carriers()
    root = tree.root(carrier)
    tip = end_effector or last_link(tree, base or root)
    return tip, planar(tree, root, base or root, tip)


def last_link(tree: Tree, base: str) -> str:
    """The end of the chain with the most moving joints from `base` on, before those of a gripper; where it forks into
    equal ones, as into fingers, the link that carries them. Of frames fixed to it, the one that is called a tool, else
    the last. Raises SeveralArmsError where the fork is into arms: chains of more joints than lie before it.
    """
    children: dict[str, list[Joint]] = {}
    for joint in tree.joints.values():
        children.setdefault(joint.parent, []).append(joint)

    def depth(joint: Joint) -> int:
        return (joint.kind in MOVING) + max(map(depth, children.get(joint.child, [])), default=0)

    def longest(link: str) -> list[Joint]:
        """The joints at `link` that lead on: several where equally far."""
        far = {id(joint): depth(joint) for joint in children.get(link, [])}
        return [joint for joint in children.get(link, []) if 0 < far[id(joint)] == max(far.values())]

    def grips(joints: list[Joint]) -> bool:
        return any(joint.kind in MOVING and GRIPS.search(joint.name) for joint in joints)

    def end(link: str, before: int) -> str:
        while (ahead := longest(link)) and not grips(ahead):
            if len(ahead) > 1 and depth(ahead[0]) <= before:
                break
            if len(ahead) > 1:
                ends = " or ".join(end(joint.child, len(tree.joints)) for joint in ahead)
                raise SeveralArmsError(
                    f"robot.end_effector must say which arm moves: {link!r} carries {len(ahead)} equal ones, to {ends}"
                )
            link, before = ahead[0].child, before + (ahead[0].kind in MOVING)
        return link

    link = end(base, 0)
    fixed = [link]  # the frames that stand still to it, from it outwards
    for one in fixed:
        fixed += [joint.child for joint in children.get(one, []) if depth(joint) == 0]
    named = [one for one in fixed if TOOL.search(one) and not FINGER.search(one)]
    return (named or [fixed[-1] if len(fixed) == 2 else link])[-1]


def planar(tree: Tree, root: str, base: str, tip: str) -> bool:
    """Whether every moving joint from `base` to `tip` turns about the world's z axis or slides across it."""
    carrier = tree.carriers()
    joints: list[Joint] = []
    link = tip
    while link != root and link in carrier:
        joints.insert(0, carrier[link])
        link = joints[0].parent
    turned, inside = Rotation.identity(), base == root
    for joint in joints:
        inside = inside or joint.parent == base
        turned = turned * Rotation.from_euler("xyz", joint.rpy)
        if inside and joint.kind in MOVING:
            axis = turned.apply(np.array(joint.axis) / max(float(np.linalg.norm(joint.axis)), LEVEL))
            off = np.hypot(axis[0], axis[1]) if joint.kind != "prismatic" else abs(axis[2])
            if off > LEVEL:
                return False
    return True
