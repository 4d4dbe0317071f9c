"""What a robot file says of an arm: its chain, limits, links and shapes."""

from __future__ import annotations

import xml.etree.ElementTree as ET
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from pipeline.common.arrays import Array
from pipeline.robot.shapes import Shape


@dataclass(frozen=True)
class Held:
    """A joint that is locked at a position [rad or m], and the limits that the file gives it."""

    joint: str
    position: float
    lower: float
    upper: float


@dataclass(frozen=True)
class Description:
    """One serial chain, ready for Drake.

    xml: the reduced URDF. joints: names of the n moving joints, base to tip. revolute: (n,) whether a joint turns.
    lower, upper: (n,) position limits [rad or m]. velocity: (n,) [rad/s or m/s]. effort: (n,) [N m or N].
    A limit that the file does not state is infinite. collision: the shapes of links. pictures: file names of visual
    meshes. held: joints that are locked.
    notes: what was read otherwise than it stands in the file, one line each. root_fault: why no body has the inertia of
    the root link, empty if one can.
    base_coordinates: how many of the joints, the first ones, are not the arm's but move its base (`spacecraft.py`), and
    root: the link of the xml that they start from. tool: the link of what is fixed to the end effector; empty: nothing.
    aside: the links of other limbs, which joints off the chain carry that are held.
    """

    name: str
    file: Path
    xml: str
    base: str
    end_effector: str
    joints: tuple[str, ...]
    revolute: NDArray[np.bool_]
    lower: Array
    upper: Array
    velocity: Array
    effort: Array
    links: tuple[str, ...] = ()
    collision: tuple[Shape, ...] = ()
    pictures: tuple[str, ...] = ()
    held: tuple[Held, ...] = ()
    notes: tuple[str, ...] = ()
    root_fault: str = ""
    base_coordinates: int = 0
    root: str = ""
    tool: str = ""
    aside: frozenset[str] = frozenset()

    @property
    def attached(self) -> tuple[Shape, ...]:
        """The shapes of what is fixed to the end effector, in its link's frame."""
        return tuple(shape for shape in self.collision if self.tool and shape.frame == self.tool)

    @property
    def actuated(self) -> tuple[str, ...]:
        """The names of the arm's own joints."""
        return self.joints[self.base_coordinates :]

    @property
    def turning(self) -> NDArray[np.bool_]:
        """Which of the arm's own joints turn."""
        return self.revolute[self.base_coordinates :]

    def unit(self, joint: int | None = None) -> str:
        """Of the position of one of the arm's own joints; of all of them where none is given."""
        turns = self.turning if joint is None else self.turning[[joint]]
        return "rad" if turns.all() else "rad or m" if turns.any() else "m"

    @cached_property
    def for_drake(self) -> tuple[str, str]:
        """The reduced URDF and its root link."""
        root = self.root or self.base
        if "world" not in self.links:
            return self.xml, root
        tree = ET.fromstring(self.xml)
        for element in tree.iter():
            for key in ("link", "name"):
                if element.tag in ("link", "parent", "child") and element.get(key) == "world":
                    element.set(key, self.drake_name("world"))
        return ET.tostring(tree, encoding="unicode"), self.drake_name(root)

    def drake_name(self, link: str) -> str:
        """What a link is called there: Drake takes one called `world` for its own world, so that gets another name."""
        other = "world_"
        while other in self.links:
            other += "_"
        return other if link == "world" else link
