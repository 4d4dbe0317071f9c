"""Shapes in coal, another library of distances."""

from __future__ import annotations

from collections.abc import Iterable
from functools import cache
from typing import Any

import coal
import numpy as np
from scipy.spatial.transform import Rotation

from pipeline.common.arrays import Array
from pipeline.robot.shapes import Shape


def hull(points: Array) -> coal.ConvexBase:
    """The convex hull of points (V, 3) [m]."""
    vector = coal.StdVec_Vec3s()
    for point in points:
        vector.append(point)
    return coal.ConvexBase.convexHull(vector, True, "")


@cache
def solid(shape: Shape) -> tuple[Any, Array, Array]:
    """coal's solid, its rotation (3, 3) and its position (3,) in the frame that the shape stands in."""
    turn, place, size = Rotation.from_rotvec(shape.rotation).as_matrix(), np.array(shape.position), shape.size
    made = {
        "sphere": lambda: coal.Sphere(*size),
        "box": lambda: coal.Box(*size),
        "capsule": lambda: coal.Capsule(*size),
        "cylinder": lambda: coal.Cylinder(*size),
        "mesh": lambda: hull(shape.points),
        "half_space": lambda: coal.Halfspace(np.array([0.0, 0.0, 1.0]), 0.0),
    }
    return made[shape.kind](), turn, place


def apart(first: tuple[Any, Array, Array], second: tuple[Any, Array, Array]) -> float:
    """The distance [m] of two solids, each with its rotation and position in the world."""
    answer = coal.DistanceResult()
    request = coal.DistanceRequest(True, True)
    poses = (coal.Transform3s(turn, place) for _, turn, place in (first, second))
    here, there = poses
    return float(coal.distance(first[0], here, second[0], there, request, answer))


def least(shapes: Iterable[Shape], at: dict[str, tuple[Array, Array]], others: Iterable[Shape]) -> float:
    """The least distance [m] of shapes whose links are at `at` (rotation, position) from others in the world."""
    placed = []
    for shape in shapes:
        made, turn, place = solid(shape)
        rotation, position = at[str(shape.frame)]
        placed.append((made, rotation @ turn, rotation @ place + position))
    return min(apart(one, solid(other)) for one in placed for other in others)
