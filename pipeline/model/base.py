"""An arm on a base that moves: a spacecraft that floats without external forces, or one that is held still.

The base's pose becomes coordinates before the joints: x, y, z [m] and yaw, pitch, roll [rad] in the frame in which it
starts, or x, y and yaw for a planar arm. All else that is known of an arm then holds with n = base coordinates + joints.
Without external forces the momentum of the whole system is constant (Umetani and Yoshida 1989):

    M_b(q) qd = p(q)    =>    qd = B(q) qd_m + d(q),    B = [-M_bb^-1 M_bm; I],    d = [M_bb^-1 p; 0],

M_b being the base's rows of the inertia matrix, [M_bb M_bm], and qd_m the joints' velocities. J B is the generalized
Jacobian, B' M B = M_mm - M_mb M_bb^-1 M_bm the reduced inertia. A base that is held has B = [0; I]. The attitude is not
a function of the joint positions (the constraint is not integrable): it is a state of the motion.
"""

from __future__ import annotations

from functools import cached_property

import numpy as np
from scipy.spatial.transform import Rotation

from pipeline.common.arrays import Array
from pipeline.model.arm import Arm
from pipeline.model.stack import STEP, Stack
from pipeline.robot.spacecraft import PLANAR, SPATIAL, Spacecraft, floating


class FloatingArm(Arm):
    """An arm with its base's coordinates before its joints; q and qd are (K, n) with both. `planar`: three of them, or six."""

    def __init__(self, fixed: Arm, spacecraft: Spacecraft, planar: bool) -> None:
        names = PLANAR if planar else SPATIAL
        super().__init__(
            floating(fixed.description, spacecraft, names),
            fixed.offset,
            offset_rpy=fixed.offset_rpy,
            base_position=fixed.base_position,
            base_rpy=fixed.base_rpy,
            gravity=fixed.gravity,
            payload=fixed.payload,
            armature=np.concatenate([np.zeros(len(names)), fixed.armature]),
        )
        self.on_fixed_base, self.spacecraft, self.planar = fixed, spacecraft, planar
        turn = Rotation.from_euler("xyz", self.base_rpy).inv()
        momentum = np.array(spacecraft.momentum, dtype=float)
        self._linear, self._angular = turn.apply(momentum[:3]), turn.apply(momentum[3:])

    @property
    def floats(self) -> bool:
        return not self.spacecraft.held

    # --- momentum -----------------------------------------------------------------------------------------------

    def motion_map(self, q: Array) -> Array:
        """B (K, n, joints): all velocities by the joints'."""
        nb = self.base_coordinates
        out = np.zeros((len(q), self.n, self.n - nb))
        out[:, nb:] = np.eye(self.n - nb)
        if self.floats:
            inertia = self.mass_matrix(q)
            out[:, :nb] = -np.linalg.solve(inertia[:, :nb, :nb], inertia[:, :nb, nb:])
        return out

    def drift(self, q: Array) -> Array:
        """d (K, n): the velocities of a system whose joints stand still."""
        nb, out = self.base_coordinates, np.zeros_like(q)
        if self.floats and (np.any(self._linear) or np.any(self._angular)):
            inertia = self.mass_matrix(q)[:, :nb, :nb]
            out[:, :nb] = np.linalg.solve(inertia, self.momentum(q)[:, :, None])[:, :, 0]
        return out

    def follow(self, q: Array, qd: Array) -> Array:
        """qd (K, n) with the base's velocities made to conserve momentum, the joints' kept."""
        return (self.motion_map(q) @ qd[:, self.base_coordinates :, None])[:, :, 0] + self.drift(q)

    def lift(self, q: Array, inverse_weight: Array) -> Array:
        """B W^-1 B' (K, n, n): what (K, joints, joints) inverse weights of the joints are to all coordinates."""
        spread = self.motion_map(q)
        return np.asarray(spread @ inverse_weight @ spread.swapaxes(1, 2))

    def inverse_inertia(self, q: Array) -> Array:
        """B M*^-1 B' (K, n, n), M* = B' M B the reduced inertia."""
        spread = self.motion_map(q)
        return np.asarray(spread @ np.linalg.inv(self.reduced_inertia(q)) @ spread.swapaxes(1, 2))

    def reduced_inertia(self, q: Array) -> Array:
        """M* (K, joints, joints)."""
        spread = self.motion_map(q)
        return np.asarray(spread.swapaxes(1, 2) @ self.mass_matrix(q) @ spread)

    def momentum(self, q: Array) -> Array:
        """p (K, base coordinates): the generalized momentum that the system's linear and angular one give at the pose q.

        The conjugate of a coordinate that turns about an axis a is a' L, L the angular momentum about the base.
        """
        r = np.zeros((len(q), 3))
        r[:, : 2 if self.planar else 3] = q[:, : 2 if self.planar else 3]
        angular = self._angular - np.cross(r, self._linear)
        if self.planar:
            return np.hstack([np.tile(self._linear[:2], (len(q), 1)), angular[:, 2:]])
        turned = np.einsum("kij,ki->kj", self._turning_axes(q), angular)
        return np.hstack([np.tile(self._linear, (len(q), 1)), turned])

    def momentum_residual(self, q: Array, qd: Array) -> tuple[Array, Array, Array]:
        """M_b(q) qd - p(q) (K, base coordinates), its derivatives by q (by central differences) and by qd: M_b."""
        nb = self.base_coordinates

        def one(stack: Stack, q: Array, qd: Array) -> Array:
            out = np.empty((stack.size, nb, 1 + self.n))
            for j, unit in enumerate(np.eye(self.n)):
                stack.at(q + STEP * unit)
                ahead = stack.inertial(qd)[:, :nb]
                stack.at(q - STEP * unit)
                out[:, :, 1 + j] = (ahead - stack.inertial(qd)[:, :nb]) / (2 * STEP)
            stack.at(q)
            out[:, :, 0] = stack.inertial(qd)[:, :nb]
            return out

        both = self._map(one, q, qd)
        value, by_q = both[:, :, 0] - self.momentum(q), both[:, :, 1:]
        if np.any(self._linear) or np.any(self._angular):
            for j, unit in enumerate(np.eye(self.n)[:nb]):
                by_q[:, :, j] -= (self.momentum(q + STEP * unit) - self.momentum(q - STEP * unit)) / (2 * STEP)
        return value, by_q, self.mass_matrix(q)[:, :nb]

    def mean_momentum_residual(self, q: Array, qd: Array, dt: Array) -> tuple[Array, Array, Array]:
        """The same (K, base coordinates) over intervals dt (K,) from q at constant qd, with derivatives by q and by qd.

        Linear momentum by how far the centre of mass has moved: exact, so that a cycle of the joints brings it back to
        where it was. Angular momentum has no such integral: it is taken in the middle, which is of second order in dt.
        """
        half, step = dt[:, None, None] / 2, dt[:, None, None]
        value, by_q, by_qd = self.momentum_residual(q + half[:, 0] * qd, qd)
        by_qd = by_qd + half * by_q
        (before, by_before), (after, by_after) = self.center_of_mass(q), self.center_of_mass(q + step[:, 0] * qd)
        linear, mass = slice(before.shape[1]), self.mass
        value[:, linear] = mass * (after - before) / step[:, 0] - self._linear[linear]
        by_q[:, linear] = mass * (by_after - by_before) / step
        by_qd[:, linear] = mass * by_after
        return value, by_q, by_qd

    @cached_property
    def mass(self) -> float:
        """Of the whole system [kg]."""
        return float(self.mass_matrix(np.zeros((1, self.n)))[0, 0, 0])

    def center_of_mass(self, q: Array) -> tuple[Array, Array]:
        """The whole system's (K, 2 or 3) [m] in the frame in which the base starts, and its derivative (K, 2 or 3, n).

        Both stand in the inertia matrix: the linear momentum of a turn about the axis a is m a x (c - r).
        """
        inertia = self.mass_matrix(q)
        count = 2 if self.planar else 3
        by_q = inertia[:, :count] / inertia[:, :1, :1]
        center = q[:, :count].copy()
        center[:, 0] += by_q[:, 1, count]
        center[:, 1] -= by_q[:, 0, count]
        if not self.planar:
            center[:, 2] += np.cos(q[:, 3]) * by_q[:, 0, 4] + np.sin(q[:, 3]) * by_q[:, 1, 4]
        return center, by_q

    @property
    def center_rests(self) -> bool:
        """Whether the centre of mass of the whole system stays where it is."""
        return self.floats and not np.any(self._linear)

    # --- attitude -----------------------------------------------------------------------------------------------

    def _turning_axes(self, q: Array) -> Array:
        """The axes (K, 3, 3) about which yaw, pitch and roll turn, as columns, in the frame in which the base starts."""
        yaw, pitch = q[:, 3], q[:, 4]
        sy, cy, sp, cp = np.sin(yaw), np.cos(yaw), np.sin(pitch), np.cos(pitch)
        zero, one = np.zeros_like(yaw), np.ones_like(yaw)
        return np.array([[zero, -sy, cy * cp], [zero, cy, sy * cp], [one, zero, -sp]]).transpose(2, 0, 1)

    def turning_metric(self, q: Array) -> Array:
        """S (K, n, n) with |w|^2 = qd' S qd for the base's angular velocity w."""
        out = np.zeros((len(q), self.n, self.n))
        if self.planar:
            out[:, 2, 2] = 1.0
        else:
            out[:, 3:6, 3:6] = np.eye(3)
            out[:, 3, 5] = out[:, 5, 3] = -np.sin(q[:, 4])
        return out

    def turning(self, q: Array, qd: Array) -> tuple[Array, Array, Array]:
        """|w|^2 (K,) [rad^2/s^2] and its derivatives by q and qd (K, n)."""
        by_qd = 2 * np.einsum("kij,kj->ki", self.turning_metric(q), qd)
        by_q = np.zeros_like(q)
        if not self.planar:
            by_q[:, 4] = -2 * np.cos(q[:, 4]) * qd[:, 3] * qd[:, 5]
        return 0.5 * (qd * by_qd).sum(axis=1), by_q, by_qd

    def attitude_cosine(self, q: Array) -> tuple[Array, Array]:
        """The cosine (K,) of the angle by which the base has turned from its start, (tr R - 1) / 2, and its derivative (K, n)."""
        by_q = np.zeros_like(q)
        if self.planar:
            by_q[:, 2] = -np.sin(q[:, 2])
            return np.cos(q[:, 2]), by_q
        (sy, sp, sr), (cy, cp, cr) = np.sin(q[:, 3:6]).T, np.cos(q[:, 3:6]).T
        by_q[:, 3] = -sy * (cp + cr) + cy * sp * sr
        by_q[:, 4] = -sp * (cy + cr) + sy * cp * sr
        by_q[:, 5] = -sr * (cy + cp) + sy * sp * cr
        return (cy * cp + cy * cr + sy * sp * sr + cp * cr - 1) / 2, by_q / 2


def is_planar(fixed: Arm, spacecraft: Spacecraft) -> bool:
    """Whether the base of a floating arm would stay in the x-y plane in which it stands, whatever the joints do."""
    arm = FloatingArm(fixed, spacecraft, planar=False)
    q = np.random.default_rng(0).uniform(-1.0, 1.0, size=(8, arm.n))
    q[:, [2, 4, 5]] = 0.0
    inertia = arm.mass_matrix(q)
    out, within = [2, 4, 5], [0, 1, 3, *range(6, arm.n)]
    return bool(np.abs(inertia[:, out][:, :, within]).max() < 1e-10 * np.abs(inertia).max())
