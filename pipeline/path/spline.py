"""A smooth curve through points, by arc length; and curves one after the other."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Protocol

import numpy as np
from scipy.interpolate import CubicSpline

from pipeline.common.arrays import Array
from pipeline.common.errors import PathError

PIECES, MOST_PIECES = 64, 200_000  # of the table of arc length: for each point, and at most
CUSP = 0.02  # of the chords' speed: where a curve is slower than that it turns on the spot


class Parametrised(Protocol):
    """A curve (K, m) by a parameter u (K,), or a derivative of it."""

    def __call__(self, u: Array, order: int = 0, /) -> Array: ...


class ByLength:
    """A curve by its arc length, given by a parameter from 0 to marks[-1]: C2, and nowhere slow in it.

    marks: (P,) the parameters of points whose arc lengths are kept; breaks: where its polynomials meet.
    """

    def __init__(self, curve: Parametrised, marks: Array, breaks: Array) -> None:
        self._curve = curve
        # Arc length by 8-point Gauss-Legendre on short pieces, then its inverse by Newton from a linear guess.
        nodes, weights = np.polynomial.legendre.leggauss(8)
        count = max(4, min(PIECES, MOST_PIECES // len(breaks)))
        places = np.arange(count * (len(breaks) - 1) + 1) / count
        self._u = np.interp(places, np.arange(len(breaks)), breaks)
        half = np.diff(self._u)[:, None] / 2
        inner = self._u[:-1, None] + half * (1 + nodes)
        pieces = (half * weights * np.linalg.norm(self._curve(inner, 1), axis=2)).sum(axis=1)
        self._s = np.concatenate([[0.0], np.cumsum(pieces)])
        self._gauss = nodes, weights
        self.length = float(self._s[-1])
        self.marks = self._arc(marks)  # (P,) [m] where along the curve the points lie

    def _arc(self, u: Array) -> Array:
        """The arc length [m] up to u (K,)."""
        left = np.clip(np.searchsorted(self._u, u, side="right") - 1, 0, len(self._u) - 2)
        nodes, weights = self._gauss
        half = ((u - self._u[left]) / 2)[:, None]
        speed = np.linalg.norm(self._curve(self._u[left][:, None] + half * (1 + nodes), 1), axis=2)
        return np.asarray(self._s[left] + (half * weights * speed).sum(axis=1))

    def _parameter(self, s: Array) -> Array:
        s = np.clip(s, 0.0, self.length)
        u = np.interp(s, self._s, self._u)
        for _ in range(4):
            u = u - (self._arc(u) - s) / np.linalg.norm(self._curve(u, 1), axis=1)
        return np.clip(u, self._u[0], self._u[-1])

    def sample(self, s: Array) -> tuple[Array, Array, Array]:
        u = self._parameter(s)
        first, second = self._curve(u, 1), self._curve(u, 2)
        speed = np.linalg.norm(first, axis=1, keepdims=True)
        tangent = first / speed
        curvature = (second - tangent * np.einsum("km,km->k", tangent, second)[:, None]) / speed**2
        return self._curve(u), tangent, curvature


class Spline(ByLength):
    """A cubic spline (C2) through `points` (P, m) [m], by arc length; `first` is its number in messages."""

    def __init__(self, points: Array, first: int = 1) -> None:
        chord = np.linalg.norm(np.diff(points, axis=0), axis=1)
        knots = np.concatenate([[0.0], np.cumsum(chord)])
        curve = CubicSpline(knots, points) if len(points) > 2 else CubicSpline(knots, points, bc_type="natural")
        _require_smooth(curve, knots, first)
        super().__init__(curve, knots, knots)


def _require_smooth(curve: CubicSpline, knots: Array, first: int) -> None:
    """Raise PathError where the curve all but stops: by arc length it would turn on the spot, at full speed."""
    inner = (knots[:-1, None] + np.diff(knots)[:, None] * np.linspace(0.0, 1.0, 17)[:-1]).ravel()
    speed = np.linalg.norm(curve(inner, 1), axis=1)
    slowest = int(np.argmin(speed))
    if speed[slowest] < CUSP:
        chord = slowest // 16 + first
        raise PathError(
            f"path: the smooth curve turns back on itself between way-points {chord} and {chord + 1}; give more "
            "way-points there, or path.corners=stop"
        )


class Sampled(Protocol):
    """Values and their first and second derivative by s (K,), each (K, m)."""

    def sample(self, s: Array) -> tuple[Array, Array, Array]: ...


class Chain:
    """Curves, or orientations, one after the other: the i-th from s = ends[i] to ends[i + 1], ends (pieces + 1,) [m].

    The tangent may jump from one to the next, so that a motion must rest there.
    """

    def __init__(self, pieces: Sequence[Sampled], ends: Array) -> None:
        self.pieces, self.ends, self.length = tuple(pieces), ends, float(ends[-1])

    def sample(self, s: Array) -> tuple[Array, Array, Array]:
        which = np.searchsorted(self.ends[1:-1], s, side="right")
        out: list[Array] = [np.empty(0)] * 3
        for i, piece in enumerate(self.pieces):
            rows = which == i
            for k, values in enumerate(piece.sample(s[rows] - self.ends[i])):
                if not i:
                    out[k] = np.empty((len(s), values.shape[1]))
                out[k][rows] = values
        return out[0], out[1], out[2]
