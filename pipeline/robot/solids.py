"""Shapes as Drake's SceneGraph knows them."""

from __future__ import annotations

from typing import Any

from pydrake.geometry import Box, Capsule, Convex, Cylinder, Sphere
from pydrake.math import RigidTransform, RotationMatrix
from scipy.spatial.transform import Rotation

from pipeline.robot.shapes import Shape

KINDS = {"sphere": Sphere, "box": Box, "capsule": Capsule, "cylinder": Cylinder}


def solid(shape: Shape) -> Any:
    """Drake's shape; raises RobotError for a mesh that cannot be read."""
    if shape.kind in ("mesh", "half_space"):
        return Convex(points=shape.points.T, label=shape.name)
    return KINDS[shape.kind](*shape.size)


def pose(shape: Shape) -> RigidTransform:
    """Where it stands in its frame."""
    return RigidTransform(RotationMatrix(Rotation.from_rotvec(shape.rotation).as_matrix()), shape.position)
