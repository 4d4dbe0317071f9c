"""Solids in a recording: those that stand in the world, and those that the end effector carries."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator, Sequence
from typing import Any

import rerun as rr
from scipy.spatial import ConvexHull
from scipy.spatial.transform import Rotation

from pipeline.artifacts.figures.solids import below, outline, surface
from pipeline.artifacts.recording.blueprint import pixels, slug
from pipeline.common.arrays import Array
from pipeline.model.arm import Arm
from pipeline.robot.shapes import Shape

OBSTACLE, GROUND = (200, 70, 60, 255), (138, 143, 152, 255)


def send_obstacles(recording: Any, shapes: Sequence[Shape], planar: bool) -> None:
    """Solids that stand in the world, and for the view from above their outlines."""
    for entity, shape in _entities(shapes):
        color = GROUND if shape.kind == "half_space" else OBSTACLE
        if planar and not below(shape):
            edge = outline(shape) * [1.0, -1.0]  # y points down there
            line = rr.LineStrips2D([[*edge, edge[0]]], colors=color, radii=pixels(2.0), draw_order=15.0)
            recording.log(f"planar/obstacles/{entity}", line, static=True)
        recording.log(f"obstacles/{entity}", solid(shape, color), static=True)


def send_tool(
    recording: Any, arm: Arm, root: str, color: tuple[int, ...], time: list[Any], poses: tuple[Array, Array]
) -> None:
    """What the end effector carries, below the entity `root`. poses: rotations (K, 3, 3) and positions (K, 3) [m] of it
    in the world.
    """
    shapes = arm.description.attached
    if not shapes:
        return
    turned = Rotation.from_matrix(poses[0]).as_quat()
    recording.send_columns(f"{root}/tool", time, rr.Transform3D.columns(translation=poses[1], quaternion=turned))
    for number, shape in enumerate(shapes):
        recording.log(f"{root}/tool/{number}", solid(shape, color), static=True)


def solid(shape: Shape, color: tuple[int, ...]) -> Any:
    """A shape as Rerun draws it, in the frame that it stands in."""
    common: dict[str, Any] = {"colors": [color], "fill_mode": "solid"}
    turn = Rotation.from_rotvec(shape.rotation)
    place = {"quaternions": [turn.as_quat()]}
    if shape.kind == "capsule":
        radius, length = shape.size
        # Rerun's capsules start at their origin: moved back by half their length.
        axis = turn.apply([0.0, 0.0, length / 2])
        return rr.Capsules3D(lengths=[length], radii=[radius], translations=[shape.position - axis], **place, **common)
    if shape.kind == "cylinder":
        sizes = {"lengths": [shape.size[1]], "radii": [shape.size[0]]}
        return rr.Cylinders3D(**sizes, centers=[shape.position], **place, **common)
    if shape.kind == "mesh":
        points = surface(shape)
        return rr.Mesh3D(
            vertex_positions=points, triangle_indices=ConvexHull(points).simplices, albedo_factor=list(color)
        )
    if shape.kind == "sphere":
        return rr.Ellipsoids3D(radii=[shape.size[0]], centers=[shape.position], **common)
    middle = shape.placed(shape.points.mean(axis=0)[None])[0]
    return rr.Boxes3D(sizes=[shape.size], centers=[middle], **place, **common)


def _entities(shapes: Sequence[Shape]) -> Iterator[tuple[str, Shape]]:
    """Each shape with a name of its own: the parts of one obstacle have the same."""
    seen: Counter[str] = Counter()
    for shape in shapes:
        name = slug(shape.name)
        yield (f"{name}_{seen[name]}" if seen[name] else name), shape
        seen[name] += 1
