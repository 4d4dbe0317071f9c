"""Timing laws s(t): raised cosine, constant speed, quintic, cruise; such laws with stops on the way; time stamps."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cached_property
from itertools import pairwise
from typing import Protocol, Self, TypeVar

import numpy as np
from scipy.interpolate import BPoly, CubicSpline

from pipeline.common.arrays import Array
from pipeline.common.errors import InputError

SAME_STOP = 1e-9  # of the length


Scaled = TypeVar("Scaled", bound="Timing")


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

    def slowed(self, by: float) -> Timing:
        """The same law in `by` times the time."""

    def part(self, start: float, end: float) -> Timing:
        """The law of the part of the path between two fractions of its length, which takes that share of the time and
        begins and ends as the whole does; raises InputError where there is none.
        """


class Scalable:
    """A law that its duration says all of."""

    def slowed(self: Scaled, by: float) -> Scaled:
        """The same law in `by` times the time."""
        return replace(self, duration=self.duration * by)  # type: ignore[type-var]

    def part(self: Scaled, start: float, end: float) -> Timing:
        """The same law in its share of the time."""
        return self.slowed(end - start)


class Indivisible:
    """A law whose parts do not begin and end at rest."""

    def part(self, start: float, end: float) -> Timing:
        """There is none."""
        raise InputError(
            "a part of the path cannot be run through by itself under the times or feeds of a file; choose "
            "timing=raised_cosine, quintic or cruise"
        )


@dataclass(frozen=True)
class RaisedCosine(Scalable):
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
class ConstantSpeed(Scalable):
    """s = L t / T: the path is entered and left at speed."""

    duration: float
    at_rest: bool = False

    def sample(self, t: Array, length: float) -> tuple[Array, Array, Array]:
        speed = length / self.duration
        return speed * t, np.full_like(t, speed), np.zeros_like(t)


@dataclass(frozen=True)
class Quintic(Scalable):
    """Rest to rest with zero acceleration at both ends: s = L (10 u^3 - 15 u^4 + 6 u^5), u = t / T."""

    duration: float
    at_rest: bool = True

    def sample(self, t: Array, length: float) -> tuple[Array, Array, Array]:
        total = self.duration
        u = t / total
        s = length * u**3 * (10 - 15 * u + 6 * u**2)
        sd = length / total * 30 * u**2 * (1 - u) ** 2
        return s, sd, length / total**2 * 60 * u * (1 - u) * (1 - 2 * u)


@dataclass(frozen=True)
class Cruise(Scalable):
    """Up to speed in a share `ramp` of the motion time, as much of it down again, and constant speed in between.

    T_a = ramp T, v = L / (T - T_a), acceleration (v / T_a)(1 - cos(2 pi t / T_a)), mirrored: with ramp = 1/2 the law of
    the papers.
    """

    duration: float
    ramp: float = 0.4
    at_rest: bool = True

    def sample(self, t: Array, length: float) -> tuple[Array, Array, Array]:
        total, rise = self.duration, self.ramp * self.duration
        speed, omega = length / (total - rise), 2 * np.pi / rise
        late = t > total / 2
        u = np.where(late, total - t, t)
        up = u < rise
        w = np.where(up, u, rise)
        s = speed / rise * (w**2 / 2 + (np.cos(omega * w) - 1) / omega**2) + speed * (u - w)
        sd = speed / rise * (w - np.sin(omega * w) / omega)
        sdd = np.where(up, speed / rise * (1 - np.cos(omega * w)), 0.0)
        return np.where(late, length - s, s), sd, np.where(late, -sdd, sdd)


@dataclass(frozen=True)
class WithStops(Scalable):
    """A law from rest to rest between each stop and the next: the time is shared out by length, so that the same speed
    is reached in all parts. stops: fractions of the length, increasing, from 0 to 1.
    """

    law: Callable[[float], Timing]
    duration: float
    stops: tuple[float, ...]
    at_rest: bool = True

    def sample(self, t: Array, length: float) -> tuple[Array, Array, Array]:
        stops = np.array(self.stops)
        which = np.searchsorted(stops[1:-1] * self.duration, t, side="right")
        out: Array = np.empty((3, len(t)))
        for i, share in enumerate(np.diff(stops)):
            rows = which == i
            part = self.law(share * self.duration).sample(t[rows] - stops[i] * self.duration, share * length)
            out[:, rows] = part
            out[0, rows] += stops[i] * length
        return out[0], out[1], out[2]

    def part(self, start: float, end: float) -> Timing:
        """The same from rest to rest between the stops that are left."""
        within = [stop for stop in self.stops if start + SAME_STOP < stop < end - SAME_STOP]
        if not within:
            return self.law((end - start) * self.duration)
        stops = (0.0, *((stop - start) / (end - start) for stop in within), 1.0)
        return replace(self, duration=(end - start) * self.duration, stops=stops)


@dataclass(frozen=True)
class Feeds(Indivisible):
    """From stop to stop each move at a feed of its own, every change of it a raised cosine of the time T_a:

    sdd = sum dv_j k(t - t_j),    k(t) = (1 - cos(2 pi t / T_a)) / T_a    on [0, T_a],

    dv_j the change of speed after t_j at the feeds alone. So a rise takes T_a, and no speed is above all feeds that it
    lies between. With one feed the law Cruise.

    fractions (P,): of the length, from 0 to 1; spans (P - 1,) [s]: what each move takes at its feed; stops: indices;
    ramp: T_a as a share of the time from stop to stop.
    """

    fractions: tuple[float, ...]
    spans: tuple[float, ...]
    stops: tuple[int, ...]
    ramp: float
    at_rest: bool = True

    @property
    def duration(self) -> float:
        return sum(self.spans) / (1 - self.ramp)

    def sample(self, t: Array, length: float) -> tuple[Array, Array, Array]:
        out: Array = np.zeros((3, len(t)))
        begins, breaks = 0.0, [0, *self.stops, len(self.spans)]
        for first, last in pairwise(breaks):
            spans = np.array(self.spans[first:last])
            at = np.concatenate([[0.0], np.cumsum(spans)])
            speed = np.diff(self.fractions[first : last + 1]) / spans
            change = np.diff(speed, prepend=0.0, append=0.0)
            rise = self.ramp / (1 - self.ramp) * at[-1]
            rows = (t >= begins) if first else np.ones(len(t), dtype=bool)
            u = np.maximum(t[rows, None] - begins - at, 0.0)
            w = np.minimum(u, rise)
            angle = 2 * np.pi * w / rise
            moved = w**2 / (2 * rise) + rise * (np.cos(angle) - 1) / (4 * np.pi**2) + (u - w)
            parts = (moved, w / rise - np.sin(angle) / (2 * np.pi), (1 - np.cos(angle)) / rise)
            out[:, rows] = length * np.array([part @ change for part in parts])
            out[0, rows] += length * self.fractions[first]
            begins += at[-1] + rise
        return out[0], out[1], out[2]

    def slowed(self, by: float) -> Feeds:
        """The same law in `by` times the time."""
        return replace(self, spans=tuple(by * span for span in self.spans))


@dataclass(frozen=True)
class Tabled(Indivisible, ABC):
    """A law through fractions (P,) of the length at times (P,) [s], from 0 on; how it goes between is `_law`."""

    times: tuple[float, ...]
    fractions: tuple[float, ...]

    @property
    def duration(self) -> float:
        return self.times[-1]

    @property
    @abstractmethod
    def _law(self) -> BPoly | CubicSpline: ...

    def sample(self, t: Array, length: float) -> tuple[Array, Array, Array]:
        return length * self._law(t), length * self._law(t, 1), length * self._law(t, 2)

    def slowed(self, by: float) -> Self:
        """The same law in `by` times the time."""
        return replace(self, times=tuple(by * time for time in self.times))


@dataclass(frozen=True)
class Stamped(Tabled):
    """Rest to rest past time stamps, and at rest in `stops` (indices).

    Quintics with continuous acceleration, which is zero at the time stamps. The speed there is the harmonic mean of
    the mean speeds before and after (Fritsch and Butland 1984), at most 5/4 of either: then the Bezier points of
    the speed, d0, d0, 5 v - 2 (d0 + d1), d1, d1 with mean speed v, are not negative, and no quintic runs backwards.
    """

    stops: tuple[int, ...] = ()
    at_rest: bool = True

    @cached_property
    def _law(self) -> BPoly:
        s = np.array(self.fractions)
        mean = np.diff(s) / np.diff(self.times)
        before, after = mean[:-1], mean[1:]
        harmonic = 2 * before * after / np.maximum(before + after, 1e-300)
        speed = np.zeros(len(s))
        speed[1:-1] = np.minimum(harmonic, 1.25 * np.minimum(before, after))
        speed[list(self.stops)] = 0.0
        return BPoly.from_derivatives(self.times, np.column_stack([s, speed, np.zeros(len(s))]))


@dataclass(frozen=True)
class Found(Tabled):
    """A law that was optimised: the C2 cubic spline, at rest at both ends."""

    at_rest: bool = True

    @cached_property
    def _law(self) -> CubicSpline:
        return CubicSpline(self.times, self.fractions, bc_type="clamped")
