"""The prescribed path: its geometry and orientation by arc length, its timing law s(t), and the reference they make.

Points are in task coordinates (2 for a planar task, 3 in space) [m]; s is arc length [m]; t is time [s].
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Protocol

import numpy as np
from scipy.interpolate import CubicSpline

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
    (2 pi: a circle).
    """

    start: Array
    to_center: Array
    heading: Array
    radius: float
    angle: float = 2 * np.pi

    @property
    def length(self) -> float:
        return self.radius * self.angle

    def sample(self, s: Array) -> tuple[Array, Array, Array]:
        phi = (s / self.radius)[:, None]
        inward, along = self.to_center, self.heading
        x = self.start + self.radius * ((1 - np.cos(phi)) * inward + np.sin(phi) * along)
        tangent = np.sin(phi) * inward + np.cos(phi) * along
        return x, tangent, (np.cos(phi) * inward - np.sin(phi) * along) / self.radius


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


class Spline:
    """A cubic spline (C2) through `points` (P, m) [m], reparametrised by arc length."""

    def __init__(self, points: Array) -> None:
        chord = np.linalg.norm(np.diff(points, axis=0), axis=1)
        knots = np.concatenate([[0.0], np.cumsum(chord)])
        self._curve = CubicSpline(knots, points) if len(points) > 2 else CubicSpline(knots, points, bc_type="natural")
        # Arc length by 8-point Gauss-Legendre on short pieces, then its inverse by Newton from a linear guess.
        nodes, weights = np.polynomial.legendre.leggauss(8)
        self._u = np.linspace(0.0, knots[-1], 64 * len(points))
        half = np.diff(self._u)[:, None] / 2
        inner = self._u[:-1, None] + half * (1 + nodes)
        pieces = (half * weights * np.linalg.norm(self._curve(inner, 1), axis=2)).sum(axis=1)
        self._s = np.concatenate([[0.0], np.cumsum(pieces)])
        self._gauss = nodes, weights
        self.length = float(self._s[-1])
        self.marks = np.interp(knots, self._u, self._s)  # (P,) [m] where along the curve the points lie

    def _parameter(self, s: Array) -> Array:
        s = np.clip(s, 0.0, self.length)
        u = np.interp(s, self._s, self._u)
        left = np.clip(np.searchsorted(self._s, s, side="right") - 1, 0, len(self._u) - 2)
        nodes, weights = self._gauss
        for _ in range(4):
            half = ((u - self._u[left]) / 2)[:, None]
            speed = np.linalg.norm(self._curve(self._u[left][:, None] + half * (1 + nodes), 1), axis=2)
            error = self._s[left] + (half * weights * speed).sum(axis=1) - s
            u = u - error / np.linalg.norm(self._curve(u, 1), axis=1)
        return np.clip(u, self._u[0], self._u[-1])

    def sample(self, s: Array) -> tuple[Array, Array, Array]:
        u = self._parameter(s)
        first, second = self._curve(u, 1), self._curve(u, 2)
        speed = np.linalg.norm(first, axis=1, keepdims=True)
        tangent = first / speed
        curvature = (second - tangent * np.einsum("km,km->k", tangent, second)[:, None]) / speed**2
        return self._curve(u), tangent, curvature
