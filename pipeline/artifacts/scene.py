"""What pictures of every kind show besides the arm: its path, and the box of even density that has the mass and inertia
of a floating base.
"""

from __future__ import annotations

import xml.etree.ElementTree as ET
from dataclasses import replace
from typing import Any

import numpy as np
from scipy.spatial import ConvexHull
from scipy.spatial.transform import Rotation

from pipeline.common.arrays import Array
from pipeline.evaluation.base import BaseMotion
from pipeline.evaluation.evaluation import Evaluation
from pipeline.model.arm import Arm
from pipeline.model.places import Places
from pipeline.problem.problem import Problem
from pipeline.robot.shapes import Shape
from pipeline.robot.touching import groups

POINTS = 201  # of the path
SMALLEST, THIN = 0.04, 0.1  # [m] of an edge; of the height of a planar arm's base, relative
PLATE, BESIDE = 0.01, 0.1  # of the size of what stands on it: how thick a half space is drawn, and how far beyond


def path_in_world(problem: Problem) -> Array:
    """The prescribed path (POINTS, 3) [m] in the world; what is not prescribed stays as at `q_init`."""
    geometry = problem.reference.geometry
    path = geometry.sample(np.linspace(0.0, geometry.length, POINTS))[0]
    return problem.task.in_world(path, problem.task.arm.position(problem.q_init[None])[0])


def around(problem: Problem, points: Array) -> tuple[Shape, ...]:
    """The obstacles as pictures of `points` (P, 3) show them: of a half space a plate beside those points."""
    shapes = () if problem.obstacles is None else problem.obstacles.shapes
    own = [shape.position for shape in shapes]
    every = np.concatenate([points.reshape(-1, 3), np.reshape(own, (-1, 3))])
    every = every[np.isfinite(every).all(axis=1)]
    return tuple(_plate(shape, every) if shape.kind == "half_space" else shape for shape in shapes)


def limbs(problem: Problem) -> tuple[Shape, ...]:
    """The other limbs of the base, in the world: they stand still, and the line through the arm's joints shows none."""
    arm, own = problem.task.arm, problem.own
    if own is None or own.unknown or arm.base.count:
        return ()
    joints, at = groups(arm.description), Places(arm)(np.zeros(arm.n))
    found = [shape for shape in arm.description.collision if shape.frame in arm.description.aside]
    return tuple(shape.moved(*at[str(shape.frame)]) for shape in found if joints[str(shape.frame)] == 0)


def _plate(shape: Shape, points: Array) -> Shape:
    turn = Rotation.from_rotvec(shape.rotation)
    across = turn.inv().apply(points - shape.position)[:, :2]
    low, high = across.min(axis=0), across.max(axis=0)
    size = float(np.linalg.norm(high - low)) or 1.0
    edges = high - low + 2 * BESIDE * size
    middle = shape.position + turn.apply([*((low + high) / 2), 0.0])
    return replace(shape, size=(*map(float, edges), PLATE * size), position=tuple(map(float, middle)))


def tool_poses(arm: Arm, e: Evaluation, rows: Any) -> tuple[Array, Array]:
    """Where what is fixed to the end effector is at some knots: rotations (K, 3, 3), positions (K, 3) [m]."""
    places, mounting, tool = Places(arm.on_fixed_base), arm.mounting, arm.description.tool
    q = e.q[rows]
    turned, place = np.full((len(q), 3, 3), np.nan), np.full((len(q), 3), np.nan)
    if not tool:
        return turned, place
    for k in np.flatnonzero(np.isfinite(q).all(axis=1)):
        turned[k], place[k] = places(q[k])[tool]
    if arm.base.count:  # from where the root link started to where it is
        start = Rotation.from_euler("xyz", mounting.base_rpy).as_matrix().T
        place = np.einsum("kij,kj->ki", e.base.rotation[rows] @ start, place - mounting.base_position)
        turned, place = e.base.rotation[rows] @ start @ turned, place + e.base.position[rows]
    return turned, place


def carried(arm: Arm, e: Evaluation, rows: Any) -> list[Shape]:
    """What is fixed to the end effector, in the world at some knots at which the arm has a pose."""
    poses = [pose for pose in zip(*tool_poses(arm, e, rows), strict=True) if np.isfinite(pose[1]).all()]
    return [shape.moved(*pose) for pose in poses for shape in arm.description.attached]


def hull(points: Array) -> list[list[int]]:
    """The faces of the convex hull of points (P, 3): the numbers of their corners, in turn."""
    found = ConvexHull(points)
    faces: dict[tuple[float, ...], set[int]] = {}
    scale = float(np.ptp(points, axis=0).max())
    for triangle, plane in zip(found.simplices, found.equations, strict=True):
        key = tuple(np.round([*plane[:3], plane[3] / scale], 6) + 0.0)
        faces.setdefault(key, set()).update(map(int, triangle))
    ordered = []
    for key, numbers in faces.items():
        corners = np.array(sorted(numbers))
        out = points[corners] - points[corners].mean(axis=0)
        along = out[0] / np.linalg.norm(out[0])
        angle = np.arctan2(out @ np.cross(key[:3], along), out @ along)
        ordered.append(corners[np.argsort(angle)].tolist())
    return ordered


def box(arm: Arm) -> Shape:
    """That box in the frame of the root link; without a spacecraft, of the root link itself."""
    craft = arm.base.spacecraft
    mass, com, inertia = craft.mass, craft.com, np.array(craft.inertia)
    if mass == 0:
        mass, com, inertia = _root_inertia(arm)
    moments, axes = np.linalg.eigh(inertia)
    edges = np.sqrt(np.maximum(6 * (moments.sum() - 2 * moments) / mass, SMALLEST**2))
    axes = axes * np.sign(np.linalg.det(axes))
    if np.allclose(moments, moments[0]):
        axes = np.eye(3)
    if arm.base.count == 3:
        # Only the moment about z is known to matter: a square plate of that moment.
        side = max(float(np.sqrt(6 * inertia[2, 2] / mass)), SMALLEST)
        edges, axes = np.array([side, side, THIN * side]), np.eye(3)
    turn = Rotation.from_matrix(axes).as_rotvec()
    return Shape("spacecraft", "box", tuple(edges.tolist()), tuple(map(float, com)), tuple(map(float, turn)))


def _root_inertia(arm: Arm) -> tuple[float, tuple[float, ...], Array]:
    inertial = ET.fromstring(arm.description.xml).find(f"link[@name='{arm.description.base}']/inertial")
    if inertial is None:
        return 1.0, (0.0, 0.0, 0.0), np.zeros((3, 3))
    origin, mass, own = (inertial.find(tag) for tag in ("origin", "mass", "inertia"))
    com = tuple(map(float, ("0 0 0" if origin is None else origin.get("xyz", "0 0 0")).split()))
    moment = {
        key: float(own.get(key, "0")) if own is not None else 0.0 for key in ("ixx", "iyy", "izz", "ixy", "ixz", "iyz")
    }
    full = np.array([[moment["i" + "".join(sorted(a + b))] for b in "xyz"] for a in "xyz"])
    return (float(mass.get("value", "0")) if mass is not None else 0.0) or 1.0, com, full


def outlines(arm: Arm, base: BaseMotion) -> Array:
    """The face on which the arm stands, closed: (N + 1, 5, 3) [m] in the world; of a planar arm's plate the middle."""
    level = 0.0 if arm.base.count == 3 else 1.0 if box(arm).position[2] <= 0 else -1.0
    return _moved(arm, base, np.array([[x, y, level] for x, y in ((1, 1), (-1, 1), (-1, -1), (1, -1), (1, 1))]))


def corners(arm: Arm, base: BaseMotion) -> Array:
    """The box's corners (N + 1, 8, 3) [m] in the world."""
    return _moved(arm, base, np.stack(np.meshgrid(*[(-1, 1)] * 3), axis=-1).reshape(-1, 3))


def _moved(arm: Arm, base: BaseMotion, points: Array) -> Array:
    """Points (P, 3) in half edges from the box's middle, in the world (N + 1, P, 3)."""
    shape = box(arm)
    own = Rotation.from_rotvec(shape.rotation).apply(points * np.array(shape.size) / 2) + np.array(shape.position)
    return base.position[:, None] + own @ base.rotation.swapaxes(1, 2)
