"""The coordinates of a moving base's pose, in the frame in which it starts: positions first, then angles.

In the plane x, y [m] and yaw [rad]; in space x, y, z [m] and yaw, pitch, roll [rad], each about the axis that the turns
before it have left: R = Rz(yaw) Ry(pitch) Rx(roll). At a pitch of 90 degrees yaw and roll turn about the same axis.
All arguments are stacked: angles and their rates are (K, a), in that order.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar, Protocol

import numpy as np

from pipeline.common.arrays import Array


class Coordinates(Protocol):
    """What a base needs to know of the coordinates of its pose."""

    @property
    def names(self) -> tuple[str, ...]:
        """Of all coordinates, in order."""

    @property
    def positions(self) -> int:
        """How many of them, the first ones, are positions; the others are the a angles."""

    def axes(self, angles: Array) -> Array:
        """The axes (K, 3, a) about which the angles turn the base, as columns: its angular velocity is axes @ rates."""

    def metric(self, angles: Array) -> Array:
        """S (K, a, a) with |w|^2 = rates' S rates for the base's angular velocity w."""

    def metric_gradient(self, angles: Array, rates: Array) -> Array:
        """The derivative of |w|^2 by the angles (K, a)."""

    def cosine(self, angles: Array) -> tuple[Array, Array]:
        """The cosine (K,) of the angle of the whole turn, (tr R - 1) / 2, and its derivative (K, a)."""

    def center(self, angles: Array, by_q: Array) -> Array:
        """Where the system's centre of mass c is from the base's place r: (K, positions) [m].

        by_q (K, positions, n): dc/dq; a turn about an axis a moves the centre by a x (c - r).
        """


@dataclass(frozen=True)
class Plane:
    """x, y, yaw: of a base that stays in the plane in which it stands."""

    names: ClassVar[tuple[str, ...]] = ("x", "y", "yaw")
    positions: ClassVar[int] = 2

    def axes(self, angles: Array) -> Array:
        return np.tile([[0.0], [0.0], [1.0]], (len(angles), 1, 1))

    def metric(self, angles: Array) -> Array:
        return np.ones((len(angles), 1, 1))

    def metric_gradient(self, angles: Array, rates: Array) -> Array:
        return np.zeros_like(angles)

    def cosine(self, angles: Array) -> tuple[Array, Array]:
        return np.cos(angles[:, 0]), -np.sin(angles)

    def center(self, angles: Array, by_q: Array) -> Array:
        return np.stack([by_q[:, 1, 2], -by_q[:, 0, 2]], axis=1)


@dataclass(frozen=True)
class Space:
    """x, y, z, yaw, pitch, roll: of any base."""

    names: ClassVar[tuple[str, ...]] = ("x", "y", "z", "yaw", "pitch", "roll")
    positions: ClassVar[int] = 3

    def axes(self, angles: Array) -> Array:
        (sy, sp, _), (cy, cp, _) = np.sin(angles).T, np.cos(angles).T
        zero, one = np.zeros_like(sy), np.ones_like(sy)
        return np.array([[zero, -sy, cy * cp], [zero, cy, sy * cp], [one, zero, -sp]]).transpose(2, 0, 1)

    def metric(self, angles: Array) -> Array:
        out = np.tile(np.eye(3), (len(angles), 1, 1))
        out[:, 0, 2] = out[:, 2, 0] = -np.sin(angles[:, 1])
        return out

    def metric_gradient(self, angles: Array, rates: Array) -> Array:
        out = np.zeros_like(angles)
        out[:, 1] = -2 * np.cos(angles[:, 1]) * rates[:, 0] * rates[:, 2]
        return out

    def cosine(self, angles: Array) -> tuple[Array, Array]:
        (sy, sp, sr), (cy, cp, cr) = np.sin(angles).T, np.cos(angles).T
        by_yaw = -sy * (cp + cr) + cy * sp * sr
        by_pitch = -sp * (cy + cr) + sy * cp * sr
        by_roll = -sr * (cy + cp) + sy * sp * cr
        value = (cy * cp + cy * cr + sy * sp * sr + cp * cr - 1) / 2
        return value, np.stack([by_yaw, by_pitch, by_roll], axis=1) / 2

    def center(self, angles: Array, by_q: Array) -> Array:
        up = np.cos(angles[:, 0]) * by_q[:, 0, 4] + np.sin(angles[:, 0]) * by_q[:, 1, 4]
        return np.stack([by_q[:, 1, 3], -by_q[:, 0, 3], up], axis=1)


PLANE, SPACE = Plane(), Space()
