"""The motion of the end effector over time: a curve, a timing law and, for poses, an orientation."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from pipeline.common.arrays import Array
from pipeline.path.curves import Geometry
from pipeline.path.part import Part
from pipeline.path.spline import Sampled
from pipeline.path.timing import Timing


@dataclass(frozen=True)
class Reference:
    """The end-effector motion to follow: a geometry, with or without orientations, run through under a timing law.

    tolerance [m], orientation_tolerance [rad]: how far from it a motion may be between its knots; where it is not
    `exact`, at any time: the path is then the centre of a tube.
    notes: what a user should know of the path, in sentences without a full stop.
    breaks: arc lengths [m] where one tool path ends and another begins elsewhere; no continuous motion passes them.
    """

    geometry: Geometry
    timing: Timing
    orientation: Sampled | None = None
    tolerance: float = 1e-4
    orientation_tolerance: float = 1e-3
    notes: tuple[str, ...] = ()
    exact: bool = True
    breaks: tuple[float, ...] = ()

    @property
    def tolerances(self) -> tuple[float, float]:
        """[m] and [rad]."""
        return self.tolerance, self.orientation_tolerance

    @property
    def duration(self) -> float:
        return self.timing.duration

    def sample(self, t: Array) -> tuple[Array, Array, Array]:
        """Targets, their velocities and accelerations at times t (K,): each (K, m), or (K, 6) for poses (task.py)."""
        s, sd, sdd = self.timing.sample(np.asarray(t, dtype=float), self.geometry.length)
        x, tangent, curvature = self.along(s)
        return x, tangent * sd[:, None], curvature * sd[:, None] ** 2 + tangent * sdd[:, None]

    def along(self, s: Array) -> tuple[Array, Array, Array]:
        """Targets at the arc lengths s (K,) [m], and their first and second derivatives by it, in the same shapes."""
        x, tangent, curvature = self.geometry.sample(s)
        if self.orientation is not None:
            turned = self.orientation.sample(s)
            x, tangent, curvature = (np.hstack(pair) for pair in zip((x, tangent, curvature), turned, strict=True))
        return x, tangent, curvature

    def paces(self, t: Array) -> tuple[float, float]:
        """The largest speed [m/s] and acceleration [m/s^2] of its point at the times t (K,)."""
        s, sd, sdd = self.timing.sample(np.asarray(t, dtype=float), self.geometry.length)
        tangent, curvature = self.geometry.sample(s)[1:]
        second = curvature * sd[:, None] ** 2 + tangent * sdd[:, None]
        speed, acceleration = (np.linalg.norm(values, axis=1) for values in (tangent * sd[:, None], second))
        return float(speed.max()), float(acceleration.max())

    def within(self, share: float) -> Reference:
        """The same path with so much of its tolerances."""
        tolerance, orientation_tolerance = share * self.tolerance, share * self.orientation_tolerance
        return replace(self, tolerance=tolerance, orientation_tolerance=orientation_tolerance)

    def part(self, start: float, end: float) -> Reference:
        """The path between two arc lengths [m] under its share of the law; raises InputError where there is none."""
        length = self.geometry.length
        oriented = None if self.orientation is None else Part(self.orientation, start, end)
        law = self.timing.part(start / length, end / length)
        return replace(self, geometry=Part(self.geometry, start, end), timing=law, orientation=oriented, breaks=())

    def slowed(self, by: float) -> Reference:
        """The same path in `by` times the time."""
        return replace(self, timing=self.timing.slowed(by))

    def position(self, t: Array) -> Array:
        return self.sample(t)[0]
