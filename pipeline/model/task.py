"""What the end effector must do: the target that it is given, the error from it, and Jacobians, for stacked q.

A target is a row of task coordinates: the prescribed world coordinates [m], and for a pose the rotation vector of the
end effector's frame in the world [rad] behind them. Velocities and accelerations of a target are the coordinates', and
the angular ones in the world. Errors and Jacobians have m rows; the angular ones are taken in the end effector's frame,
in which they do not depend on the target. Orientation errors are rotation logarithms (Murray, Li and Sastry 1994, 2.2).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from scipy.spatial.transform import Rotation

from pipeline.common.arrays import Array
from pipeline.common.errors import RobotError
from pipeline.model.arm import Arm

AXES = ("x", "y", "z")


SMALL = 1e-4  # [rad] below which closed forms lose digits and series do not


@dataclass(frozen=True)
class PositionTask:
    """Prescribe the world coordinates `axes` (m of x, y, z) of the end effector."""

    arm: Arm
    axes: tuple[str, ...] = ("x", "y")

    def __post_init__(self) -> None:
        _require_redundancy(self.redundancy, self.m, f"robot.task = [{', '.join(self.axes)}]")

    @property
    def m(self) -> int:
        """Number of prescribed coordinates."""
        return len(self.axes)

    @property
    def redundancy(self) -> int:
        """Redundancy degree r: the arm's joints less m."""
        return self.arm.n - self.arm.base.count - self.m

    @property
    def rows(self) -> list[int]:
        return [AXES.index(axis) for axis in self.axes]

    def value(self, q: Array) -> Array:
        """Task coordinates x(q) (K, m) [m]."""
        return self.arm.position(q)[:, self.rows]

    def jacobian(self, q: Array) -> Array:
        """Task Jacobian J(q) (K, m, n) [m/rad]."""
        return self.arm.jacobian(q)[:, self.rows]

    def error(self, q: Array, target: Array) -> Array:
        """x(q) - target (K, m) [m]."""
        return self.value(q) - target

    def error_and_jacobian(self, q: Array, target: Array) -> tuple[Array, Array]:
        """The error (K, m) and its derivative by q (K, m, n), here J, from one pass."""
        x, jacobian = self.arm.position_and_jacobian(q)
        return x[:, self.rows] - target, jacobian[:, self.rows]

    def error_by_target(self, q: Array, target: Array, rate: Array) -> Array:
        """The derivative (K, m) of the error by a parameter of the target, of which `rate` (K, m) is the target's."""
        return -rate

    def jacobian_and_gradient(self, q: Array) -> tuple[Array, Array]:
        """J (K, m, n) and d J_ij / d q_k (K, m, n, n) [m/rad^2] from one pass."""
        jacobian, gradient = self.arm.jacobian_and_gradient(q)
        return jacobian[:, self.rows], gradient[:, self.rows]

    def jacobian_rate_term(self, q: Array, qd: Array) -> Array:
        """Jd qd (K, m) [m/s^2]."""
        return self.arm.jacobian_rate_term(q, qd)[:, self.rows]

    def velocity(self, q: Array, target_rate: Array) -> Array:
        """The velocity xd (K, m) that J qd must have on a target that moves at target_rate (K, m)."""
        return target_rate

    def acceleration(self, q: Array, qd: Array, target_rate: Array, target_acceleration: Array) -> Array:
        """What J qdd + Jd qd (K, m) must be on the target."""
        return target_acceleration

    def apart(self, first: Array, second: Array) -> tuple[float, float]:
        """How far two targets (m,) are from each other, [m] and [rad]."""
        return float(np.linalg.norm(second - first)), 0.0

    def in_world(self, target: Array, fallback: Array) -> Array:
        """Targets (K, m) as world points (K, 3); coordinates that are not prescribed come from `fallback` (3,)."""
        world = np.tile(fallback, (len(target), 1))
        world[:, self.rows] = target
        return world


@dataclass(frozen=True)
class PoseTask:
    """Prescribe the position and orientation of the end effector (m = 6), or where its axis `pointing` points (m = 5).

    pointing: (3,) axis in the end effector's frame, about which it may spin; None: the whole orientation is prescribed.
    """

    arm: Arm
    pointing: tuple[float, float, float] | None = None
    axes: tuple[str, ...] = AXES

    def __post_init__(self) -> None:
        kind = "full" if self.pointing is None else "pointing"
        _require_redundancy(self.redundancy, self.m, f"robot.orientation = {kind}")

    @property
    def m(self) -> int:
        return 6 if self.pointing is None else 5

    @property
    def redundancy(self) -> int:
        return self.arm.n - self.arm.base.count - self.m

    @property
    def rows(self) -> list[int]:
        return [0, 1, 2]

    @cached_property
    def basis(self) -> Array:
        """The prescribed angular directions (3 or 2, 3) in the end effector's frame, right-handed before `pointing`."""
        if self.pointing is None:
            return np.eye(3)
        axis = np.array(self.pointing) / np.linalg.norm(self.pointing)
        first = np.cross(axis, np.eye(3)[np.argmin(np.abs(axis))])
        first /= np.linalg.norm(first)
        return np.array([first, np.cross(axis, first)])

    def value(self, q: Array) -> Array:
        """Position [m] and rotation vector [rad] (K, 6)."""
        position, rotation = self.arm.pose(q)
        return np.hstack([position, Rotation.from_matrix(rotation).as_rotvec()])

    def jacobian(self, q: Array) -> Array:
        """J (K, m, n): translational in the world, then angular in the end effector's frame."""
        return self._rows(*self.arm.pose_and_jacobian(q)[1:])

    def error(self, q: Array, target: Array) -> Array:
        """[x(q) - x_ref; rotation from the target's orientation] (K, m) [m, rad]."""
        position, rotation = self.arm.pose(q)
        return np.hstack([position - target[:, :3], self.turn(rotation, target)[0]])

    def error_and_jacobian(self, q: Array, target: Array) -> tuple[Array, Array]:
        """The error (K, m) and its derivative by q (K, m, n), which is J on the target."""
        position, rotation, both = self.arm.pose_and_jacobian(q)
        turn, by_angular = self.turn(rotation, target)
        angular = by_angular @ rotation.swapaxes(1, 2) @ both[:, :3]
        return np.hstack([position - target[:, :3], turn]), np.concatenate([both[:, 3:], angular], axis=1)

    def error_by_target(self, q: Array, target: Array, rate: Array) -> Array:
        """The derivative (K, m) of the error by a parameter of the target, of which `rate` (K, 6) is the target's, its
        turning in the world: as if the end effector turned the other way.
        """
        rotation = self.arm.pose(q)[1]
        own = np.einsum("kji,kj->ki", rotation, -rate[:, 3:])
        return np.hstack([-rate[:, :3], np.einsum("kai,ki->ka", self.turn(rotation, target)[1], own)])

    def jacobian_and_gradient(self, q: Array) -> tuple[Array, Array]:
        """J (K, m, n), d J_ij / d q_k (K, m, n, n): later joints turn a joint's angular velocity in this frame."""
        linear, by_q = self.arm.jacobian_and_gradient(q)
        rotation, both = self.arm.pose_and_jacobian(q)[1:]
        own = rotation.swapaxes(1, 2) @ both[:, :3]
        columns = own.swapaxes(1, 2)
        product = -np.cross(columns[:, None], columns[:, :, None])  # (K, j, k, 3): -w_k x w_j
        later = np.tri(self.arm.n, dtype=bool).T[:, :, None]  # k >= j
        turned = np.where(later, product, 0.0).transpose(0, 3, 1, 2)
        gradient = np.concatenate([by_q, np.einsum("ai,kijl->kajl", self.basis, turned)], axis=1)
        return np.concatenate([linear, self.basis @ own], axis=1), gradient

    def jacobian_rate_term(self, q: Array, qd: Array) -> Array:
        """Jd qd (K, m)."""
        bias = self.arm.spatial_rate_term(q, qd)
        angular = self._own(self.arm.pose(q)[1], bias[:, :3])
        return np.hstack([bias[:, 3:], angular])

    def velocity(self, q: Array, target_rate: Array) -> Array:
        """xd (K, m) at q (K, n) for target_rate (K, 6): linear and angular velocity in the world."""
        return np.hstack([target_rate[:, :3], self._own(self.arm.pose(q)[1], target_rate[:, 3:])])

    def acceleration(self, q: Array, qd: Array, target_rate: Array, target_acceleration: Array) -> Array:
        """What J qdd + Jd qd (K, m) must be: where the tool may spin, its axis turns with the spin that qd has."""
        rotation, both = self.arm.pose_and_jacobian(q)[1:]
        angular = target_acceleration[:, 3:]
        if self.pointing is not None:
            axis = rotation @ (np.array(self.pointing) / np.linalg.norm(self.pointing))
            turning = np.einsum("kij,kj->ki", both[:, :3], qd)
            spin = ((turning - target_rate[:, 3:]) * axis).sum(axis=1, keepdims=True)
            angular = angular + spin * np.cross(turning, axis)
        return np.hstack([target_acceleration[:, :3], self._own(rotation, angular)])

    def apart(self, first: Array, second: Array) -> tuple[float, float]:
        """How far two targets (6,) are from each other, [m] and [rad]: the angle of R0' R1, or between the axes."""
        pair = np.array([first, second])
        rotation = Rotation.from_rotvec(pair[:1, 3:]).as_matrix()
        return float(np.linalg.norm(second[:3] - first[:3])), float(np.linalg.norm(self.turn(rotation, pair[1:])[0]))

    def in_world(self, target: Array, fallback: Array) -> Array:
        """The points (K, 3) of targets (K, 6)."""
        return target[:, :3].copy()

    def _own(self, rotation: Array, vector: Array) -> Array:
        return np.einsum("ai,kji,kj->ka", self.basis, rotation, vector)

    def _rows(self, rotation: Array, both: Array) -> Array:
        return np.concatenate([both[:, 3:], self.basis @ rotation.swapaxes(1, 2) @ both[:, :3]], axis=1)

    def turn(self, rotation: Array, target: Array) -> tuple[Array, Array]:
        """Orientation error (K, 3 or 2) [rad] and its derivative (K, 3 or 2, 3) by a turn in the effector's frame."""
        wanted = Rotation.from_rotvec(target[:, 3:]).as_matrix()
        if self.pointing is None:
            return _logarithm(wanted.swapaxes(1, 2) @ rotation)
        axis = np.array(self.pointing) / np.linalg.norm(self.pointing)
        return _swing(np.einsum("kji,kj->ki", rotation, wanted @ axis), axis, self.basis)


Task = PositionTask | PoseTask


def _require_redundancy(r: int, m: int, key: str) -> None:
    if r <= 0:
        raise RobotError(
            f"{key}: {r + m} joints for {m} task coordinates leave no redundancy "
            f"(r = {r}); prescribe fewer coordinates or use an arm with more joints"
        )


def _logarithm(rotation: Array) -> tuple[Array, Array]:
    """phi (K, 3) of R = exp(phi) and the inverse right Jacobian (K, 3, 3): d phi = Jr^-1 w for dR = R [w]."""
    phi = Rotation.from_matrix(rotation).as_rotvec()
    angle = np.linalg.norm(phi, axis=1)
    small = angle < SMALL
    theta = np.where(small, 1.0, angle)
    factor = np.where(small, 1 / 12 + angle**2 / 720, 1 / theta**2 - 1 / (2 * theta * np.tan(theta / 2)))
    cross = _skew(phi)
    return phi, np.eye(3) + cross / 2 + factor[:, None, None] * (cross @ cross)


def _swing(seen: Array, axis: Array, basis: Array) -> tuple[Array, Array]:
    """How far the axis is from the direction `seen` (K, 3) that it should have, both in the effector's frame: the
    smallest turn between them, by `basis` (K, 2) [rad], and its derivative (K, 2, 3) by a turn of that frame.
    """
    sine, cosine = np.linalg.norm(np.cross(seen, axis), axis=1), seen @ axis
    angle = np.arctan2(sine, cosine)
    small = sine < SMALL
    safe = np.where(small, 1.0, sine)
    ratio = np.where(small & (cosine > 0), 1 + angle**2 / 6, angle / safe)
    slope = np.where(small & (cosine > 0), 1 / 3, (sine - angle * cosine) / safe**3)
    across = np.array([basis[1], -basis[0]])  # rows: basis x axis
    by_seen = ratio[:, None, None] * across - (seen @ across.T)[:, :, None] * slope[:, None, None] * axis
    return ratio[:, None] * (seen @ across.T), by_seen @ _skew(seen)


def _skew(vector: Array) -> Array:
    """[v] (K, 3, 3) with [v] w = v x w."""
    return np.cross(np.eye(3), vector[:, None, :]).swapaxes(1, 2) * -1.0


def pose_task(arm: Arm, orientation: str, pointing: Sequence[float]) -> PoseTask:
    """The task of `orientation` full or pointing."""
    if orientation == "full":
        return PoseTask(arm)
    if not np.linalg.norm(pointing) > 0:
        raise RobotError(f"robot.pointing = {list(pointing)}: expected three numbers that are not all zero")
    x, y, z = map(float, pointing)
    return PoseTask(arm, (x, y, z))
