"""What any robot file says, before it is reduced to one chain: links, joints, and what holds them together."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from pipeline.common.arrays import Array
from pipeline.common.errors import RobotError
from pipeline.robot.numbers import Vector
from pipeline.robot.shapes import Shape

ZERO = (0.0, 0.0, 0.0)
MOMENTS = ("ixx", "iyy", "izz", "ixy", "ixz", "iyz")


@dataclass(frozen=True)
class Inertial:
    """Mass [kg]; centre of mass and roll, pitch, yaw of the axes of the moments, in the link [m, rad]; and the moments
    (ixx, iyy, izz, ixy, ixz, iyz) [kg m^2] about that centre.
    """

    mass: float
    com: Vector = ZERO
    rpy: Vector = ZERO
    moments: Vector = (0.0,) * 6

    @property
    def matrix(self) -> Array:
        """The moments as a matrix (3, 3), in their own axes."""
        xx, yy, zz, xy, xz, yz = self.moments
        return np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]])


def moments_of(matrix: Array) -> Vector:
    """(ixx, iyy, izz, ixy, ixz, iyz) of a matrix (3, 3)."""
    places = ((0, 0), (1, 1), (2, 2), (0, 1), (0, 2), (1, 2))
    return tuple(float(matrix[place]) for place in places)


@dataclass
class Link:
    """One link. solid: whether the file gives it a shape to see or to touch. unknown: why its inertia is not known."""

    name: str
    inertial: Inertial | None = None
    solid: bool = False
    unknown: str = ""

    @property
    def mass(self) -> float:
        return 0.0 if self.inertial is None else self.inertial.mass


@dataclass(frozen=True)
class Mimic:
    """position = multiplier * (position of `joint`) + offset."""

    joint: str
    multiplier: float = 1.0
    offset: float = 0.0


@dataclass
class Joint:
    """One joint: its frame in the parent link (xyz [m], rpy [rad]), which is the child link's frame; its axis in it.

    limit: what the file states, as text, of lower, upper, velocity and effort: read where it is used. armature: rotor
    inertia that the file states [kg m^2].
    """

    name: str
    kind: str
    parent: str
    child: str
    xyz: Vector = ZERO
    rpy: Vector = ZERO
    axis: Vector = (1.0, 0.0, 0.0)
    limit: Mapping[str, str] = field(default_factory=dict)
    mimic: Mimic | None = None
    armature: float = 0.0


@dataclass
class Tree:
    """A robot as its file describes it. notes: what of the file was read otherwise than it stands there."""

    name: str
    file: Path
    links: dict[str, Link] = field(default_factory=dict)
    joints: dict[str, Joint] = field(default_factory=dict)
    shapes: list[Shape] = field(default_factory=list)
    pictures: list[str] = field(default_factory=list)
    notes: list[str] = field(default_factory=list)

    def fail(self, problem: str) -> RobotError:
        return RobotError(f"robot.urdf = {self.file}: {problem}")

    def add_link(self, link: Link) -> None:
        self._add("link", link.name, self.links)
        self.links[link.name] = link

    def add_joint(self, joint: Joint) -> None:
        self._add("joint", joint.name, self.joints)
        self.joints[joint.name] = joint

    def _add(self, tag: str, name: str, known: Mapping[str, object]) -> None:
        if not name:
            raise self.fail(f"a <{tag}> has no name")
        if name in known:
            raise self.fail(f"two {tag}s are called '{name}'")

    def carriers(self) -> dict[str, Joint]:
        """The joint that carries each link but the root; raises RobotError where links and joints are no tree."""
        carrier: dict[str, Joint] = {}
        for joint in self.joints.values():
            for end, link in (("parent", joint.parent), ("child", joint.child)):
                if link == "world" and end == "parent" and link not in self.links:
                    self.links = {"world": Link("world"), **self.links}  # given everywhere, as in Drake
                if link not in self.links:
                    raise self.fail(f"joint '{joint.name}' has the {end} '{link}', which is no link of the file")
            if joint.child in carrier:
                first = carrier[joint.child].name
                raise self.fail(f"link '{joint.child}' is the child of two joints, '{first}' and '{joint.name}'")
            carrier[joint.child] = joint
        return carrier

    def root(self, carrier: Mapping[str, Joint]) -> str:
        """The one link that no joint carries."""
        roots = [link for link in self.links if link not in carrier]
        if not self.links:
            raise self.fail("it holds no link")
        if len(roots) != 1:
            named = ", ".join(roots[:12]) or "a loop"
            raise self.fail(f"a robot has one root link, this one has {len(roots)} ({named})")
        return roots[0]

    def group(self, link: str, moving: set[str]) -> list[str]:
        """The links that are rigid with `link` and beyond it: as far as the next joints in `moving`."""
        children: dict[str, list[str]] = {}
        for joint in self.joints.values():
            if joint.name not in moving:
                children.setdefault(joint.parent, []).append(joint.child)
        found = [link]
        for one in found:
            found += children.get(one, [])
        return found
