"""Solid shapes for clearances: spheres, boxes and capsules, of the arm's links and of obstacles."""

from __future__ import annotations

import xml.etree.ElementTree as ET
from dataclasses import dataclass

import numpy as np
from scipy.spatial.transform import Rotation

from pipeline.common.arrays import Array
from pipeline.common.errors import RobotError
from pipeline.robot.numbers import Vector, numbers, shown

# How URDF calls them, what they become, and the attributes that give their sizes.
SIZES = {
    "sphere": ("sphere", ("radius",)),
    "box": ("box", ("size",)),
    "cylinder": ("capsule", ("radius", "length")),
    "capsule": ("capsule", ("radius", "length")),
}


@dataclass(frozen=True)
class Shape:
    """One solid in a frame: `frame` is a link, or None for the world.

    kind: sphere, box or capsule. size: (radius,), the edges (x, y, z), or (radius, length between the centres of the
    caps), the capsule lying along its z axis [m]. position (3,) [m], rotation: rotation vector (3,) [rad] in the frame.
    """

    name: str
    kind: str
    size: tuple[float, ...]
    position: tuple[float, ...]
    rotation: tuple[float, ...] = (0.0, 0.0, 0.0)
    frame: str | None = None


def capsule(name: str, start: Array, end: Array, radius: float, frame: str | None = None) -> Shape:
    """The capsule around the segment from start to end (3,) [m]; one without length is a sphere."""
    axis = np.asarray(end, dtype=float) - start
    length = float(np.linalg.norm(axis))
    middle = tuple(float(v) for v in (np.asarray(start, dtype=float) + end) / 2)
    if length < 1e-12:
        return Shape(name, "sphere", (radius,), middle, frame=frame)
    turn = Rotation.align_vectors(axis[None] / length, [[0.0, 0.0, 1.0]])[0].as_rotvec()
    return Shape(name, "capsule", (radius, length), middle, tuple(map(float, turn)), frame)


def link_shapes(robot: ET.Element, where: str = "robot") -> tuple[list[Shape], list[str]]:
    """The primitive collision shapes of a URDF's links, and the names of links that have meshes instead.

    A cylinder becomes the capsule that holds it: its distance is smooth, and never overestimates the clearance.
    Raises RobotError, which begins with `where`, for what is no number.
    """
    shapes, meshes = [], []
    for link in robot.findall("link"):
        name = link.get("name", "")
        for count, collision in enumerate(link.findall("collision")):
            origin, solid = collision.find("origin"), collision.find("geometry")
            if solid is None:
                continue
            what = f"{where}: link '{name}' has in its collision the"
            values = {} if origin is None else origin.attrib
            position = numbers(values.get("xyz", "0 0 0"), 3, f"{what} origin xyz")
            rotation = Rotation.from_euler("xyz", numbers(values.get("rpy", "0 0 0"), 3, f"{what} origin rpy"))
            for child in solid:
                if child.tag not in SIZES:
                    meshes.append(name)
                    continue
                kind, keys = SIZES[child.tag]
                size: Vector = ()
                for key in keys:
                    text, place = child.get(key, ""), f"{what} {child.tag} {key}"
                    size += numbers(text, 3 if kind == "box" else 1, place)
                    if min(size) < 0:
                        raise RobotError(f"{place} '{shown(text)}', expected no negative number")
                if min(size) > 0:
                    turn = tuple(map(float, rotation.as_rotvec()))
                    shapes.append(Shape(f"{name}_{count}", kind, size, position, turn, name))
    return shapes, sorted(set(meshes))
