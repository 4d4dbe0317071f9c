"""Solid shapes for clearances, all of them convex: of the arm's links and of obstacles."""

from __future__ import annotations

import xml.etree.ElementTree as ET
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from scipy.spatial.transform import Rotation

from pipeline.common.arrays import Array
from pipeline.common.errors import RobotError
from pipeline.robot import meshes
from pipeline.robot.numbers import Vector, numbers, shown
from pipeline.robot.packages import resolve

CORNERS = np.stack(np.meshgrid(*[(-0.5, 0.5)] * 3), axis=-1).reshape(-1, 3)  # of the unit box
SLAB = (1000.0, 1000.0, 10.0)  # [m] of a half space: Drake measures no hull from an endless one

# The attributes that give their sizes in a URDF.
SIZES = {
    "sphere": ("radius",),
    "box": ("size",),
    "cylinder": ("radius", "length"),
    "capsule": ("radius", "length"),
}


@dataclass(frozen=True)
class Shape:
    """One solid in a frame: `frame` is a link, or None for the world.

    kind: sphere, box, capsule, cylinder, mesh or half_space. size: (radius,), the edges (x, y, z), (radius, length)
    along the z axis, which of a capsule is that between the centres of its caps, the scale (x, y, z) of a mesh, or of a
    half space the edges of the slab that stands for it: below its position, its z axis points out of it [m].
    position (3,) [m], rotation: rotation vector (3,) [rad] in the frame. file: of a mesh, which is read where its
    points are asked for; of that the convex hull counts.
    """

    name: str
    kind: str
    size: tuple[float, ...]
    position: tuple[float, ...]
    rotation: tuple[float, ...] = (0.0, 0.0, 0.0)
    frame: str | None = None
    file: str = ""

    @property
    def points(self) -> Array:
        """The corners (V, 3) [m] of a box, a slab or a mesh's hull, in the shape's own frame; raises RobotError, which
        names whose it is, for a mesh that cannot be read.
        """
        if self.kind in ("box", "half_space"):
            corners = CORNERS * np.array(self.size)
            return corners - [0.0, 0.0, self.size[2] / 2] if self.kind == "half_space" else corners
        try:
            return np.asarray(meshes.hull(self.file) * np.array(self.size))
        except RobotError as error:
            whose = f"obstacle {self.name}" if self.frame is None else f"link '{self.frame}'"
            raise RobotError(f"{whose}: {error}") from None

    def moved(self, rotation: Array, position: Array) -> Shape:
        """The shape in the world, its frame turned by `rotation` (3, 3) and at `position` (3,) [m]."""
        turn = Rotation.from_matrix(rotation) * Rotation.from_rotvec(self.rotation)
        place = rotation @ np.array(self.position) + position
        return replace(
            self, position=tuple(map(float, place)), rotation=tuple(map(float, turn.as_rotvec())), frame=None
        )

    def placed(self, points: Array) -> Array:
        """Points (V, 3) of its own frame in the frame that it stands in."""
        return np.asarray(Rotation.from_rotvec(self.rotation).apply(points) + np.array(self.position))


def capsule(name: str, start: Array, end: Array, radius: float, frame: str | None = None) -> Shape:
    """The capsule around the segment from start to end (3,) [m]; one without length is a sphere."""
    axis = np.asarray(end, dtype=float) - start
    length = float(np.linalg.norm(axis))
    middle = tuple(float(v) for v in (np.asarray(start, dtype=float) + end) / 2)
    if length < 1e-12:
        return Shape(name, "sphere", (radius,), middle, frame=frame)
    turn = Rotation.align_vectors(axis[None] / length, [[0.0, 0.0, 1.0]])[0].as_rotvec()
    return Shape(name, "capsule", (radius, length), middle, tuple(map(float, turn)), frame)


def link_shapes(robot: ET.Element, where: str = "robot", beside: Path | None = None) -> list[Shape]:
    """The collision shapes of a URDF's links. Meshes are not read: that one is there is not known.

    beside: the folder that the names of meshes may start from. Raises RobotError, which begins with `where`, for what
    is no number.
    """
    shapes = []
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
            turn = tuple(map(float, rotation.as_rotvec()))
            for child in solid:
                own = f"{name}_{count}"
                if child.tag == "mesh":
                    scale = numbers(child.get("scale", "1 1 1"), 3, f"{what} mesh scale")
                    file = meshes.named(child.get("filename", ""), resolve(child.get("filename", ""), beside))
                    shapes.append(Shape(own, "mesh", scale, position, turn, name, file))
                elif child.tag in SIZES and min(size := _size(child, what)) > 0:
                    shapes.append(Shape(own, child.tag, size, position, turn, name))
    return shapes


def _size(child: ET.Element, what: str) -> Vector:
    size: Vector = ()
    for key in SIZES[child.tag]:
        text, place = child.get(key, ""), f"{what} {child.tag} {key}"
        size += numbers(text, 3 if child.tag == "box" else 1, place)
        if min(size) < 0:
            raise RobotError(f"{place} '{shown(text)}', expected no negative number")
    return size
