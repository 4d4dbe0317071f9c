"""Solid shapes for clearances: spheres, boxes and capsules, of the arm's links and of obstacles."""

from __future__ import annotations

import xml.etree.ElementTree as ET
from dataclasses import dataclass

import numpy as np
from scipy.spatial.transform import Rotation

from pipeline.common.arrays import Array


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


def link_shapes(robot: ET.Element) -> tuple[list[Shape], list[str]]:
    """The primitive collision shapes of a URDF's links, and the names of links that have meshes instead.

    A cylinder becomes the capsule that holds it: its distance is smooth, and never overestimates the clearance.
    """
    shapes, meshes = [], []
    for link in robot.findall("link"):
        name = link.get("name", "")
        for number, collision in enumerate(link.findall("collision")):
            origin, solid = collision.find("origin"), collision.find("geometry")
            if solid is None:
                continue
            values = {} if origin is None else origin.attrib
            position = _numbers(values.get("xyz", "0 0 0"))
            rotation = Rotation.from_euler("xyz", _numbers(values.get("rpy", "0 0 0"))).as_rotvec()
            for child in solid:
                size: tuple[float, ...]
                if child.tag == "sphere":
                    kind, size = "sphere", _numbers(child.get("radius", "0"))
                elif child.tag == "box":
                    kind, size = "box", _numbers(child.get("size", "0 0 0"))
                elif child.tag in ("cylinder", "capsule"):
                    kind = "capsule"
                    size = _numbers(f"{child.get('radius', '0')} {child.get('length', '0')}")
                else:
                    meshes.append(name)
                    continue
                if min(size) > 0:
                    turn = tuple(map(float, rotation))
                    shapes.append(Shape(f"{name}_{number}", kind, size, position, turn, name))
    return shapes, sorted(set(meshes))


def _numbers(text: str) -> tuple[float, ...]:
    return tuple(float(word) for word in text.split())
