"""The prescribed path: its geometry and orientation by arc length, its timing law s(t), and the reference they make.

Points are in task coordinates (2 for a planar task, 3 in space) [m]; s is arc length [m]; t is time [s].
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Protocol

import numpy as np

from pipeline.common.arrays import Array
from pipeline.common.errors import PathError


class Geometry(Protocol):
    """A curve by arc length."""

    @property
    def length(self) -> float:
        """Total arc length [m]."""

    def sample(self, s: Array) -> tuple[Array, Array, Array]:
        """Position, unit tangent dx/ds and curvature vector d2x/ds2 at s (K,), each (K, m)."""


def direction_vector(direction: float | Sequence[float], m: int, key: str = "path.direction") -> Array:
    """A unit vector (m,) from an angle in degrees (planar tasks) or from m numbers."""
    if isinstance(direction, int | float):
        if m != 2:
            raise PathError(
                f"{key} = {direction}: a task with {m} coordinates needs a direction of {m} numbers, not an angle"
            )
        angle = np.deg2rad(direction)
        return np.array([np.cos(angle), np.sin(angle)])
    vector = np.asarray(direction, dtype=float)
    if vector.shape != (m,) or not np.linalg.norm(vector) > 0:
        raise PathError(
            f"{key} = {list(direction)}: expected {m} numbers that are not all zero"
            + (", or one angle in degrees" if m == 2 else "")
        )
    unit: Array = vector / np.linalg.norm(vector)
    return unit


@dataclass(frozen=True)
class Line:
    """A straight line of `length` [m] from `start` (m,) along the unit vector `direction` (m,)."""

    start: Array
    direction: Array
    length: float

    def sample(self, s: Array) -> tuple[Array, Array, Array]:
        ones = np.ones((len(s), 1))
        return self.start + s[:, None] * self.direction, ones * self.direction, 0 * ones * self.direction


@dataclass(frozen=True)
class Arc:
    """An arc from `start` (m,) around a centre at `radius` [m] along the unit vector `to_center` (m,).

    `heading` (m,) is the unit tangent at the start, at right angles to `to_center`; `angle` [rad] is the arc's extent
    (2 pi: a circle). `rise` (m,) [m]: by how much it ends beside its plane, as a helix; zero or None: not at all.
    """

    start: Array
    to_center: Array
    heading: Array
    radius: float
    angle: float = 2 * np.pi
    rise: Array | None = None

    @property
    def length(self) -> float:
        return float(np.hypot(self.radius * self.angle, 0.0 if self.rise is None else np.linalg.norm(self.rise)))

    def sample(self, s: Array) -> tuple[Array, Array, Array]:
        share = self.radius * self.angle / self.length  # of the length, in the plane
        slope = np.zeros_like(self.start) if self.rise is None else self.rise / self.length
        phi = (share * s / self.radius)[:, None]
        inward, along = self.to_center, self.heading
        x = self.start + self.radius * ((1 - np.cos(phi)) * inward + np.sin(phi) * along) + s[:, None] * slope
        tangent = share * (np.sin(phi) * inward + np.cos(phi) * along) + slope
        return x, tangent, share**2 * (np.cos(phi) * inward - np.sin(phi) * along) / self.radius


def circle(
    start: Array,
    center_direction: float | Sequence[float],
    radius: float,
    *,
    clockwise: bool = False,
    normal: Sequence[float] = (0.0, 0.0, 1.0),
    angle: float = 360.0,
) -> Arc:
    """A circle (or an arc of `angle` degrees) through `start`; its centre lies along `center_direction`.

    In space the circle's plane is the one through `center_direction` at right angles to `normal` (3,).
    """
    m = len(start)
    inward = direction_vector(center_direction, m, "path.center_direction")
    if m == 2:
        heading = np.array([inward[1], -inward[0]])  # counter-clockwise: the centre is on the left
    else:
        axis = direction_vector(normal, 3, "path.normal")
        inward = inward - axis * (inward @ axis)
        if np.linalg.norm(inward) < 1e-9:
            raise PathError("path.center_direction is parallel to path.normal: they must span the circle's plane")
        inward /= np.linalg.norm(inward)
        heading = np.cross(inward, axis)
    return Arc(start, inward, -heading if clockwise else heading, radius, float(np.deg2rad(angle)))


@dataclass(frozen=True)
class Still:
    """A point (m,) that stays while the orientation turns; `length` [m] is what that turn counts (see TURN)."""

    point: Array
    length: float

    def sample(self, s: Array) -> tuple[Array, Array, Array]:
        nothing = np.zeros((len(s), len(self.point)))
        return nothing + self.point, nothing, nothing
