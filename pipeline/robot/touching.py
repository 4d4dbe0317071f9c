"""Which links of an arm may touch: those that are rigid with each other or neighbours, and those of an SRDF."""

from __future__ import annotations

import xml.etree.ElementTree as ET
from itertools import combinations
from pathlib import Path

from pipeline.common.errors import RobotError
from pipeline.robot.description import Description
from pipeline.robot.markup import parse

Pair = tuple[str, str]


def groups(description: Description) -> dict[str, int]:
    """How many of the moving joints carry each link: links of the same number are one rigid body."""
    carrier, moving = {}, set(description.joints)
    for joint in ET.fromstring(description.xml).findall("joint"):
        parent, child = (joint.find(end) for end in ("parent", "child"))
        assert parent is not None
        assert child is not None
        carrier[child.get("link", "")] = parent.get("link", ""), joint.get("name") in moving
    found: dict[str, int] = {}

    def number(link: str) -> int:
        if link not in found:
            parent, moves = carrier.get(link, ("", False))
            found[link] = (number(parent) if parent else 0) + moves
        return found[link]

    return {link: number(link) for link in description.links}


def apart(description: Description) -> list[Pair]:
    """The pairs of links with shapes between which two or more joints move, nearer the base first; of what is fixed to
    the end effector, and of the base's other limbs, all those that a joint moves against them.
    """
    own, tool = groups(description), description.tool
    limbs = {link for link in description.aside if own[link] == 0}
    links = sorted({str(shape.frame) for shape in description.collision}, key=lambda link: own[link])
    return [
        (first, second)
        for first, second in combinations(links, 2)
        if own[second] - own[first] > (0 if tool in (first, second) or first in limbs else 1)
    ]


def disabled(file: Path, key: str = "collision.srdf") -> set[frozenset[str]]:
    """The pairs whose collisions an SRDF disables; raises RobotError, one line, which names `key`."""
    if not file.is_file():
        raise RobotError(f"{key} = {file}: no such file")
    root = parse(file.read_bytes(), file, key)
    if root.tag != "robot":
        raise RobotError(f"{key} = {file}: the root element is <{root.tag}>, expected <robot>")
    pairs = root.findall("disable_collisions")
    return {frozenset((pair.get("link1", ""), pair.get("link2", ""))) for pair in pairs}
