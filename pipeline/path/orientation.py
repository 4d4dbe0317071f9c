"""Orientations along a path."""

from __future__ import annotations

import numpy as np
from scipy.spatial.transform import Rotation, RotationSpline

from pipeline.common.arrays import Array


class Orientation:
    """A smooth turning along a path, through `rotations` at the arc lengths `marks` (P,) [m].

    Two rotations: about a fixed axis, in proportion to s. More: the spline of scipy's RotationSpline, with continuous
    angular velocity and acceleration.
    """

    def __init__(self, marks: Array, rotations: Rotation) -> None:
        self.marks, self.rotations = np.asarray(marks, dtype=float), rotations
        # Its iteration does not stop on rotations that are all the same.
        self._still = bool(np.all((rotations[0].inv() * rotations).magnitude() < 1e-12))
        few = self._still or len(rotations) == 2
        self._spline = None if few else RotationSpline(self.marks, rotations)
        self._axis = np.zeros(3) if self._still else _axis(self.marks, rotations)

    def sample(self, s: Array) -> tuple[Array, Array, Array]:
        """Rotation vector [rad], angular velocity dphi/ds [rad/m], its derivative by s: in the world, each (K, 3)."""
        s = np.clip(s, self.marks[0], self.marks[-1])
        if self._spline is None:
            still = np.zeros((len(s), 3))
            turned = Rotation.from_rotvec((s - self.marks[0])[:, None] * self._axis) * self.rotations[0]
            return turned.as_rotvec(), still + self._axis, still
        turned = self._spline(s)
        return turned.as_rotvec(), turned.apply(self._spline(s, 1)), turned.apply(self._spline(s, 2))


def _axis(marks: Array, rotations: Rotation) -> Array:
    """The angular velocity (3,) [rad/m] in the world that leads from the first rotation to the second."""
    return np.asarray(rotations[0].apply((rotations[0].inv() * rotations[1]).as_rotvec()) / (marks[1] - marks[0]))
