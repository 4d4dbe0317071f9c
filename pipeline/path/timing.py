"""Timing laws s(t): raised cosine, constant speed, quintic."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Protocol

import numpy as np

from pipeline.common.arrays import Array


class Timing(Protocol):
    """A law s(t) on [0, duration]."""

    @property
    def duration(self) -> float:
        """Motion time T [s]."""

    @property
    def at_rest(self) -> bool:
        """Whether the path starts and ends with zero speed."""

    def sample(self, t: Array, length: float) -> tuple[Array, Array, Array]:
        """s [m], sd [m/s] and sdd [m/s^2] at t (K,)."""


@dataclass(frozen=True)
class RaisedCosine:
    """The papers' law: acceleration (4 L / T^2)(1 - cos(4 pi t / T)), mirrored in the second half; jerk is continuous.

    PMKE paper eq. (5) and Global paper eqs (19), (23), which print s(t) under the label ds/dt.
    """

    duration: float
    at_rest: bool = True

    def sample(self, t: Array, length: float) -> tuple[Array, Array, Array]:
        total, omega = self.duration, 4 * np.pi / self.duration
        scale = 4 * length / total**2
        late = t > total / 2
        u = np.where(late, total - t, t)
        half = scale * (u**2 / 2 + (np.cos(omega * u) - 1) / omega**2)
        speed = scale * (u - np.sin(omega * u) / omega)
        acceleration = scale * (1 - np.cos(omega * u))
        return np.where(late, length - half, half), speed, np.where(late, -acceleration, acceleration)


@dataclass(frozen=True)
class ConstantSpeed:
    """s = L t / T: the path is entered and left at speed."""

    duration: float
    at_rest: bool = False

    def sample(self, t: Array, length: float) -> tuple[Array, Array, Array]:
        speed = length / self.duration
        return speed * t, np.full_like(t, speed), np.zeros_like(t)


@dataclass(frozen=True)
class Quintic:
    """Rest to rest with zero acceleration at both ends: s = L (10 u^3 - 15 u^4 + 6 u^5), u = t / T."""

    duration: float
    at_rest: bool = True

    def sample(self, t: Array, length: float) -> tuple[Array, Array, Array]:
        total = self.duration
        u = t / total
        s = length * u**3 * (10 - 15 * u + 6 * u**2)
        sd = length / total * 30 * u**2 * (1 - u) ** 2
        return s, sd, length / total**2 * 60 * u * (1 - u) * (1 - 2 * u)
