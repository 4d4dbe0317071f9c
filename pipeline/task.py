"""What the end effector must do: which coordinates of it are prescribed, with residual and Jacobian for stacked q."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from pipeline.arm import Arm
from pipeline.arrays import Array
from pipeline.errors import RobotError

AXES = ("x", "y", "z")


@dataclass(frozen=True)
class PositionTask:
    """Prescribe the world coordinates `axes` (m of x, y, z) of the end effector."""

    arm: Arm
    axes: tuple[str, ...] = ("x", "y")

    def __post_init__(self) -> None:
        if self.redundancy <= 0:
            raise RobotError(
                f"robot.task = [{', '.join(self.axes)}]: {self.arm.n} joints for {self.m} task coordinates leave no redundancy "
                f"(r = {self.redundancy}); prescribe fewer coordinates or use an arm with more joints"
            )

    @property
    def m(self) -> int:
        """Number of prescribed coordinates."""
        return len(self.axes)

    @property
    def redundancy(self) -> int:
        """Redundancy degree r = n - m."""
        return self.arm.n - self.m

    @property
    def rows(self) -> list[int]:
        return [AXES.index(axis) for axis in self.axes]

    def value(self, q: Array) -> Array:
        """Task coordinates x(q) (K, m) [m]."""
        return self.arm.position(q)[:, self.rows]

    def jacobian(self, q: Array) -> Array:
        """Task Jacobian J(q) (K, m, n) [m/rad]."""
        return self.arm.jacobian(q)[:, self.rows]

    def value_and_jacobian(self, q: Array) -> tuple[Array, Array]:
        """Both of the above from one pass."""
        x, jacobian = self.arm.position_and_jacobian(q)
        return x[:, self.rows], jacobian[:, self.rows]

    def jacobian_and_gradient(self, q: Array) -> tuple[Array, Array]:
        """J (K, m, n) and d J_ij / d q_k (K, m, n, n) [m/rad^2] from one pass."""
        jacobian, gradient = self.arm.jacobian_and_gradient(q)
        return jacobian[:, self.rows], gradient[:, self.rows]

    def jacobian_rate_term(self, q: Array, qd: Array) -> Array:
        """Jd qd (K, m) [m/s^2]."""
        return self.arm.jacobian_rate_term(q, qd)[:, self.rows]

    def in_world(self, x: Array, fallback: Array) -> Array:
        """Task points (K, m) as world points (K, 3); coordinates that are not prescribed come from `fallback` (3,)."""
        world = np.tile(fallback, (len(x), 1))
        world[:, self.rows] = x
        return world
