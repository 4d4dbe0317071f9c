"""Length and angle in one parameter: a curve and the orientations along it, by ds = sqrt(|dx|^2 + (w |dphi|)^2)."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.interpolate import BPoly, CubicSpline
from scipy.spatial.transform import Rotation

from pipeline.common.arrays import Array
from pipeline.common.errors import PathError
from pipeline.path.curves import Geometry
from pipeline.path.orientation import Orientation
from pipeline.path.spline import CUSP, Sampled

PIECES, MOST_PIECES = 16, 20_000  # between two marks, and at most


@dataclass(frozen=True)
class _Points:
    """A spline through points, by its own parameter."""

    spline: CubicSpline

    def sample(self, u: Array) -> tuple[Array, Array, Array]:
        return self.spline(u), self.spline(u, 1), self.spline(u, 2)


@dataclass(frozen=True)
class _Along:
    """A curve, or orientations, whose own parameter is a C2 function of the new one."""

    curve: Sampled
    by: BPoly

    @property
    def length(self) -> float:
        return float(self.by.x[-1])

    def sample(self, s: Array) -> tuple[Array, Array, Array]:
        s = np.clip(s, 0.0, self.length)
        rate, second = (self.by(s, order)[:, None] for order in (1, 2))
        x, tangent, curvature = self.curve.sample(self.by(s))
        return x, tangent * rate, curvature * rate**2 + tangent * second


def splined(
    points: Array, rotations: Rotation, moves: Array, turns: Array, weight: float
) -> tuple[Geometry, Sampled, Array]:
    """The smooth path through points (P, m) [m] and rotations (P), which lie `moves` [m] and `turns` [rad] apart: as
    from `mixed`.
    """
    knots = np.concatenate([[0.0], np.cumsum(np.hypot(moves, weight * turns))])
    spline = CubicSpline(knots, points) if len(points) > 2 else CubicSpline(knots, points, bc_type="natural")
    return mixed(_Points(spline), Orientation(knots, rotations), knots, weight)


def mixed(curve: Sampled, orientation: Sampled, marks: Array, weight: float) -> tuple[Geometry, Sampled, Array]:
    """A curve, its orientations and the `marks` (P,) by length and angle: a radian counts `weight` [m].

    marks: of the parameter of both, from 0 to its end, between which they are smooth.
    """
    count = max(2, min(PIECES, MOST_PIECES // len(marks)))
    u = np.interp(np.arange(count * (len(marks) - 1) + 1) / count, np.arange(len(marks)), marks)
    nodes, weights = np.polynomial.legendre.leggauss(8)
    half = np.diff(u)[:, None] / 2
    inner = (u[:-1, None] + half * (1 + nodes)).ravel()
    between = _rate(curve, orientation, inner, weight)[0].reshape(-1, len(nodes))
    rate, change = _rate(curve, orientation, u, weight)
    slowest = int(between.min(axis=1).argmin())
    if between.min() < CUSP * between.mean():
        raise PathError(
            f"path: the smooth curve turns back on itself between way-points {slowest // count + 1} and "
            f"{slowest // count + 2}; give more way-points there, or path.corners=stop"
        )
    there = np.concatenate([[0.0], np.cumsum((half * weights * between).sum(axis=1))])
    by = BPoly.from_derivatives(there, np.stack([u, 1 / rate, -change / rate**3], axis=1))
    return _Along(curve, by), _Along(orientation, by), there[::count]


def _rate(curve: Sampled, orientation: Sampled, u: Array, weight: float) -> tuple[Array, Array]:
    """ds/du and its derivative (K,) at u (K,)."""
    tangent, curvature = curve.sample(u)[1:]
    spin, bend = (weight * values for values in orientation.sample(u)[1:])
    rate = np.sqrt((tangent**2).sum(axis=1) + (spin**2).sum(axis=1))
    return rate, ((tangent * curvature).sum(axis=1) + (spin * bend).sum(axis=1)) / rate
