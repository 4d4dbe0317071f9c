"""How far two convex solids are from each other, with a bound that never lies above the truth.

For a unit vector n from A to B every distance is at least min over B of n.b less max over A of n.a, and for the best n
it is that. `distance` finds it by Wolfe's algorithm for the point of least norm of B - A (Wolfe 1976, "Finding the
nearest point in a polytope"): among the points of support found so far by least squares without negative weights, then
with the support in its direction, until the two bounds meet.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.optimize import nnls
from scipy.spatial import ConvexHull

from pipeline.common.arrays import Array
from pipeline.robot.description import Description
from pipeline.robot.shapes import Shape

MEET = 1e-9  # [m] between the bounds
TOUCHES = 1e-12  # [m] between the cores: nearer, they have points in common
STEPS = 100  # Wolfe's algorithm takes at most 13 on polytopes


@dataclass(frozen=True)
class Solid:
    """A convex solid in its link's frame: what is within `radius` [m] of the hull of `points` (V, 3) or, of a cylinder,
    of the two discs of radius `rim` around its two points. face: of the slab of a half space the normal (3,) of its
    face, along which all that is not far beyond its edges is nearest to it.
    """

    points: Array
    radius: float = 0.0
    rim: float = 0.0
    face: Array | None = None

    @classmethod
    def of(cls, shape: Shape) -> Solid:
        """Of a shape; raises RobotError for a mesh that cannot be read."""
        placed = shape.placed
        if shape.kind == "sphere":
            return cls(placed(np.zeros((1, 3))), shape.size[0])
        if shape.kind in ("capsule", "cylinder"):
            ends = placed(np.array([[0.0, 0.0, 0.5], [0.0, 0.0, -0.5]]) * shape.size[1])
            return cls(ends, shape.size[0]) if shape.kind == "capsule" else cls(ends, rim=shape.size[0])
        up = placed(np.array([[0.0, 0.0, 1.0]]))[0] - shape.position if shape.kind == "half_space" else None
        return cls(placed(shape.points), face=up)

    @property
    def center(self) -> Array:
        """The middle (3,) of its extent along the axes."""
        return np.asarray((self.points.min(axis=0) + self.points.max(axis=0)) / 2)

    def reach(self, point: Array) -> float:
        """The largest distance [m] of any of its points from `point` (3,), or a little more."""
        return float(np.linalg.norm(self.points - point, axis=1).max()) + self.radius + self.rim

    def moved(self, rotation: Array, position: Array) -> Solid:
        """The solid where its link is so."""
        face = None if self.face is None else rotation @ self.face
        return Solid(self.points @ rotation.T + position, self.radius, self.rim, face)

    def support(self, n: Array) -> Array:
        """The point (3,) of its core that is farthest along the unit vector n (3,)."""
        point: Array = self.points[np.argmax(self.points @ n)]
        if not self.rim:
            return point
        axis = self.points[0] - self.points[1]
        axis = axis / np.sqrt(axis @ axis)
        across = n - (n @ axis) * axis
        size = np.sqrt(across @ across)
        return point + self.rim / size * across if size > 1e-12 else point


def along(a: Solid, b: Solid, n: Array) -> float:
    """The least distance [m] that the unit vector n (3,), from a to b, shows; negative where it shows an overlap."""
    return float(n @ b.support(-n) - n @ a.support(n)) - a.radius - b.radius


def distance(a: Solid, b: Solid) -> tuple[float, float]:
    """A lower and an upper bound [m] on the distance, which meet; where the cores overlap, less the radii, twice: they
    overlap by so much at least.
    """
    return nearest(a, b)[:2]


def nearest(a: Solid, b: Solid) -> tuple[float, float, Array]:
    """The same, and the unit vector (3,) from a to b that shows the lower one (any, where the cores overlap)."""
    n = b.points.mean(axis=0) - a.points.mean(axis=0)
    size = float(np.sqrt(n @ n))
    n = n / size if size > TOUCHES else np.array([0.0, 0.0, 1.0])
    found: list[Array] = []
    low, high, best = -np.inf, np.inf, n
    for _ in range(STEPS):
        new = b.support(-n) - a.support(n)
        shown = float(n @ new)
        if shown > low:
            low, best = shown, n
        if high - low < MEET:
            break
        found.append(new)
        corners = np.array(found).T
        scale = max(float(np.abs(corners).max()), TOUCHES)
        weights, _ = nnls(np.vstack([corners / scale, np.ones(len(found))]), np.array([0.0, 0.0, 0.0, 1.0]))
        closest = corners @ weights / weights.sum()
        high = float(np.sqrt(closest @ closest))
        found = [point for point, weight in zip(found, weights, strict=True) if weight > 0]
        if high <= TOUCHES:
            low = high = 0.0
            break
        n = closest / high
    return min(low, high) - a.radius - b.radius, high - a.radius - b.radius, best


def depth(solid: Solid, points: Array) -> Array:
    """How deep (K,) [m] points (K, 3) lie inside a solid; not above 0 outside."""
    beyond_ball = np.linalg.norm(points - solid.center, axis=1) - solid.reach(solid.center)
    inner = beyond_ball < 0
    found = -beyond_ball
    if inner.any():
        found[inner] = _depth(solid, points[inner])
    return np.asarray(found)


def _depth(solid: Solid, points: Array) -> Array:
    if not (solid.rim or solid.radius):
        sides = ConvexHull(solid.points).equations
        return np.asarray(-(points @ sides[:, :3].T + sides[:, 3]).max(axis=1))
    axis, inner = solid.points[0] - solid.points[-1], points - solid.points.mean(axis=0)
    length = float(np.linalg.norm(axis))
    along_it = inner @ axis / max(length, TOUCHES)
    across = np.linalg.norm(inner - along_it[:, None] * axis / max(length, TOUCHES), axis=1)
    beyond = np.abs(along_it) - length / 2
    if solid.rim:
        return np.asarray(np.minimum(solid.rim - across, -beyond))
    return np.asarray(solid.radius - np.hypot(across, np.maximum(beyond, 0.0)))


def solids_of(description: Description) -> dict[str, list[Solid]]:
    """The solids of every link that has any."""
    found: dict[str, list[Solid]] = {}
    for shape in description.collision:
        found.setdefault(str(shape.frame), []).append(Solid.of(shape))
    return found
