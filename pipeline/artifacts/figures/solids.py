"""Obstacles in matplotlib figures: all kinds are convex, so the hull of points on their surface draws them."""

from __future__ import annotations

from typing import Any

import numpy as np
from mpl_toolkits.mplot3d.art3d import Poly3DCollection
from scipy.spatial import ConvexHull

from pipeline.common.arrays import Array
from pipeline.robot.shapes import Shape

COLOR, GROUND = "#C8463C", "#8A8F98"


def surface(shape: Shape) -> Array:
    """Points (P, 3) [m] on the surface of a solid in the world, of which the hull is the solid."""
    if shape.kind in ("box", "mesh", "half_space"):
        own = shape.points
    elif shape.kind == "cylinder":
        angle = np.linspace(0.0, 2 * np.pi, 25)
        rim = shape.size[0] * np.stack([np.cos(angle), np.sin(angle), 0 * angle], axis=-1)
        up = np.array([0.0, 0.0, shape.size[1] / 2])
        own = np.concatenate([rim + up, rim - up])
    else:
        u, v = np.meshgrid(np.linspace(0.0, 2 * np.pi, 25), np.linspace(0.0, np.pi, 14))
        ball = np.stack([np.cos(u) * np.sin(v), np.sin(u) * np.sin(v), np.cos(v)], axis=-1).reshape(-1, 3)
        own = shape.size[0] * ball
        if shape.kind == "capsule":
            own[:, 2] += np.sign(ball[:, 2]) * shape.size[1] / 2
    return shape.placed(own)


def outline(shape: Shape, dims: Any = (0, 1)) -> Array:
    """Its outline (K, 2) [m] seen along the third coordinate, without the first point again at the end."""
    flat = surface(shape)[:, dims]
    return flat[ConvexHull(flat).vertices]


def draw(axes: Any, shape: Shape, dims: Any, color: str = COLOR) -> None:
    """The solid in 3-D axes, or its outline in the plane of the coordinates `dims`; a half space in grey, and not where
    it is looked upon from above.
    """
    color = GROUND if shape.kind == "half_space" else color
    if len(dims) == 3:
        points = surface(shape)
        faces = points[ConvexHull(points).simplices]
        axes.add_collection3d(Poly3DCollection(faces, facecolor=color, edgecolor="none", alpha=0.35))
    elif not below(shape, dims):
        axes.fill(*outline(shape, dims).T, facecolor=color, edgecolor="none", alpha=0.35, zorder=1)


def below(shape: Shape, dims: Any = (0, 1)) -> bool:
    """Whether it is a half space with all the view of the coordinates `dims` above it or below."""
    normal = shape.placed(np.array([[0.0, 0.0, 1.0]]))[0] - shape.position
    return shape.kind == "half_space" and bool(np.abs(normal[list(dims)]).max() < 1e-9)
