"""The arm: kinematics, dynamics and their derivatives from Drake's MultibodyPlant, for many configurations per call.

All methods take stacked arguments, one row per knot: q, qd, qdd are (K, n). Up to `BLOCK` copies of the arm live in one
plant, so that one call into Drake serves that many knots. There is no gravity (a space arm), unless it is given.
Sources: PMKE paper Section 2.1, Global paper Section 2; derivatives: see each method.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np
from pydrake.multibody.tree import JacobianWrtVariable

from pipeline.common.arrays import Array
from pipeline.model.base import FIXED, Base
from pipeline.model.stack import BLOCK, STEP, Stack
from pipeline.robot import urdf
from pipeline.robot.description import Description
from pipeline.robot.mounting import Mounting


class Arm:
    """A serial arm, mounted on a base, and its end-effector frame.

    `description` comes from `pipeline.robot.urdf.read`. Its n coordinates are those of the base, of which a fixed one
    has none, and behind them the joints: q[:, arm.joints]. `arm.description` names all of them.
    """

    def __init__(self, description: Description, mounting: Mounting = Mounting(), base: Base = FIXED) -> None:
        self._on_fixed_base, self.mounting, self.base = description, mounting, base
        self.description = base.extend(description)
        self.n = len(self.description.joints)
        self.joints = slice(base.count, self.n)
        self._stacks: dict[int, Stack] = {}

    @classmethod
    def from_urdf(
        cls,
        file: str | Path,
        end_effector: str,
        mounting: Mounting = Mounting(),
        base: Base = FIXED,
        *,
        root: str | None = None,
        locked: Mapping[str, float] | None = None,
    ) -> Arm:
        """The chain from the link `root` (None: the file's root) to the link `end_effector` of a robot file.

        locked: positions [rad or m] of joints that do not move. Raises RobotError.
        """
        return cls(urdf.read(file, end_effector, root, locked), mounting, base)

    # --- the base -----------------------------------------------------------------------------------------------

    @cached_property
    def on_fixed_base(self) -> Arm:
        """The same arm where its base stands still at its start and has no coordinates."""
        return self if self.base.count == 0 else Arm(self._on_fixed_base, self.mounting)

    def motion_map(self, q: Array) -> Array:
        """B (K, n, joints): all velocities by the joints', less those that the base has of itself (`base.drift`)."""
        return self.base.motion_map(self, q)

    def follow(self, q: Array, qd: Array) -> Array:
        """qd (K, n) with the velocities that the base has under the joints' in it: B qd_m + d."""
        return (self.motion_map(q) @ qd[:, self.joints, None])[:, :, 0] + self.base.drift(self, q)

    def lift(self, q: Array, inverse_weight: Array) -> Array:
        """B W^-1 B' (K, n, n): what (K, joints, joints) inverse weights of the joints are to all coordinates."""
        spread = self.motion_map(q)
        return np.asarray(spread @ inverse_weight @ spread.swapaxes(1, 2))

    def reduced_inertia(self, q: Array) -> Array:
        """M* = B' M B (K, joints, joints)."""
        spread = self.motion_map(q)
        return np.asarray(spread.swapaxes(1, 2) @ self.mass_matrix(q) @ spread)

    def inverse_inertia(self, q: Array) -> Array:
        """B M*^-1 B' (K, n, n): the inverse inertia as a weight of the joints' velocities."""
        return self.lift(q, np.linalg.inv(self.reduced_inertia(q)))

    # --- kinematics ---------------------------------------------------------------------------------------------

    def position(self, q: Array) -> Array:
        """End-effector positions (K, 3) [m] in the world."""

        def one(stack: Stack, q: Array) -> Array:
            stack.at(q)
            return np.array([tip.CalcPoseInWorld(stack.context).translation() for tip in stack.tips])

        return self._map(one, q)

    def jacobian(self, q: Array) -> Array:
        """Translational Jacobians (K, 3, n) of the end effector [m/rad]."""

        def one(stack: Stack, q: Array) -> Array:
            stack.at(q)
            return self._jacobians(stack)

        return self._map(one, q)

    def position_and_jacobian(self, q: Array) -> tuple[Array, Array]:
        """Both of the above from one pass: (K, 3), (K, 3, n)."""
        joint = self._map(self._position_and_jacobian, q)
        return joint[:, :, 0], joint[:, :, 1:]

    def jacobian_rate_term(self, q: Array, qd: Array) -> Array:
        """The acceleration Jd qd (K, 3) [m/s^2] of the end effector at qdd = 0."""

        def one(stack: Stack, q: Array, qd: Array) -> Array:
            stack.at(q, qd)
            bias = stack.plant.CalcBiasTranslationalAcceleration
            rows = [
                bias(stack.context, JacobianWrtVariable.kV, tip, np.zeros(3), stack.world, stack.world)
                for tip in stack.tips
            ]
            return np.array(rows).reshape(stack.size, 3)

        return self._map(one, q, qd)

    def spatial_jacobian(self, q: Array) -> Array:
        """Angular, then translational Jacobians (K, 6, n) of the end effector in the world [rad/rad, m/rad]."""

        def one(stack: Stack, q: Array) -> Array:
            stack.at(q)
            return self._jacobians(stack, spatial=True)

        return self._map(one, q)

    def first_joint(self) -> Array:
        """Where the first joint stands (3,) [m] in the world."""
        stack = Stack(self.description, self.mounting, 1)
        frame = stack.plant.GetJointByName(self.description.joints[0]).frame_on_parent()
        return np.asarray(frame.CalcPoseInWorld(stack.context).translation())

    def pose(self, q: Array) -> tuple[Array, Array]:
        """Positions (K, 3) [m] and rotation matrices (K, 3, 3) of the end effector in the world."""

        def one(stack: Stack, q: Array) -> Array:
            stack.at(q)
            return np.array([tip.CalcPoseInWorld(stack.context).GetAsMatrix34() for tip in stack.tips])

        both = self._map(one, q)
        return both[:, :, 3], both[:, :, :3]

    def pose_and_jacobian(self, q: Array) -> tuple[Array, Array, Array]:
        """Positions (K, 3), rotation matrices (K, 3, 3) and spatial Jacobians (K, 6, n), as in the methods above."""

        def one(stack: Stack, q: Array) -> Array:
            stack.at(q)
            pose = np.array([tip.CalcPoseInWorld(stack.context).GetAsMatrix34() for tip in stack.tips])
            jacobian = self._jacobians(stack, spatial=True)
            return np.concatenate([pose.reshape(len(pose), -1), jacobian.reshape(len(pose), -1)], axis=1)

        both = self._map(one, q)
        pose = both[:, :12].reshape(-1, 3, 4)
        return pose[:, :, 3], pose[:, :, :3], both[:, 12:].reshape(-1, 6, self.n)

    def spatial_rate_term(self, q: Array, qd: Array) -> Array:
        """Angular and linear acceleration (K, 6) [rad/s^2, m/s^2] of the end effector at qdd = 0."""

        def one(stack: Stack, q: Array, qd: Array) -> Array:
            stack.at(q, qd)
            bias = stack.plant.CalcBiasSpatialAcceleration
            rows = [
                bias(stack.context, JacobianWrtVariable.kV, tip, np.zeros(3), stack.world, stack.world)
                for tip in stack.tips
            ]
            return np.array([np.concatenate([row.rotational(), row.translational()]) for row in rows])

        return self._map(one, q, qd)

    def jacobian_and_gradient(self, q: Array) -> tuple[Array, Array]:
        """Translational Jacobians (K, 3, n) and d J_ij / d q_k (K, 3, n, n) [m/rad^2], exact and symmetric in j, k.

        An earlier joint a turns whatever a later joint b does to the end effector: d J_b / d q_a = w_a x J_b, with w_a
        the angular Jacobian's column (zero for a sliding joint).
        """
        both = self.spatial_jacobian(q)
        turning, moving = both[:, :3].swapaxes(1, 2), both[:, 3:].swapaxes(1, 2)
        product = np.cross(turning[:, :, None], moving[:, None])  # (K, a, b, 3), right for a <= b
        earlier = np.tri(self.n, dtype=bool).T[:, :, None]
        gradient = np.where(earlier, product, product.swapaxes(1, 2)).transpose(0, 3, 1, 2)
        return both[:, 3:], np.ascontiguousarray(gradient)

    # --- dynamics -----------------------------------------------------------------------------------------------

    def mass_matrix(self, q: Array) -> Array:
        """M(q) (K, n, n) [kg m^2]."""

        def one(stack: Stack, q: Array) -> Array:
            stack.at(q)
            return stack.mass_matrix()

        return self._map(one, q)

    def bias(self, q: Array, qd: Array) -> Array:
        """Coriolis and centrifugal torques n(q, qd) (K, n) [N m], quadratic in qd."""

        def one(stack: Stack, q: Array, qd: Array) -> Array:
            stack.at(q, qd)
            return stack.bias()

        return self._map(one, q, qd)

    def inverse_dynamics(self, q: Array, qd: Array, qdd: Array) -> Array:
        """Joint torques tau = M(q) qdd + n(q, qd) - g(q) (K, n) [N m]."""

        def one(stack: Stack, q: Array, qd: Array, qdd: Array) -> Array:
            stack.at(q, qd)
            return stack.inverse_dynamics(qdd)

        return self._map(one, q, qd, qdd)

    def gravity_torque(self, q: Array) -> Array:
        """g(q) (K, n) [N m]: the joint torques that gravity exerts."""

        def one(stack: Stack, q: Array) -> Array:
            stack.at(q)
            return stack.gravity()

        return self._map(one, q)

    def kinetic_energy(self, q: Array, qd: Array) -> Array:
        """T = 1/2 qd' M(q) qd (K,) [J]."""

        def one(stack: Stack, q: Array, qd: Array) -> Array:
            stack.at(q)
            return 0.5 * np.einsum("kn,kn->k", qd, stack.inertial(qd))

        return self._map(one, q, qd)

    # --- derivatives --------------------------------------------------------------------------------------------

    def kinetic_energy_gradient(self, q: Array, qd: Array) -> tuple[Array, Array, Array]:
        """T (K,), dT/dq (K, n) [J/rad] and dT/dqd = M qd (K, n) [N m s].

        dT/dq = Mdot qd - n(q, qd), with Mdot qd the central difference of M(q) qd along qd: three calls for any n.
        """

        def one(stack: Stack, q: Array, qd: Array) -> Array:
            step = STEP / np.maximum(np.sqrt((qd * qd).sum(axis=1, keepdims=True)), 1e-3)
            stack.at(q)
            momentum = stack.inertial(qd)
            stack.at(q + step * qd)
            ahead = stack.inertial(qd)
            stack.at(q - step * qd)
            rate = (ahead - stack.inertial(qd)) / (2 * step)
            stack.at(q, qd)
            return np.hstack([rate - stack.bias(), momentum])

        both = self._map(one, q, qd)
        by_q, by_qd = both[:, : self.n], both[:, self.n :]
        return 0.5 * (qd * by_qd).sum(axis=1), by_q, by_qd

    def momentum_gradient(self, q: Array, qd: Array) -> tuple[Array, Array]:
        """The generalized momentum M(q) qd (K, n) [N m s] and its derivative by q (K, n, n), by central differences."""

        def one(stack: Stack, q: Array, qd: Array) -> Array:
            out = np.empty((stack.size, stack.n, 1 + stack.n))
            for j, unit in enumerate(np.eye(stack.n)):
                stack.at(q + STEP * unit)
                ahead = stack.inertial(qd)
                stack.at(q - STEP * unit)
                out[:, :, 1 + j] = (ahead - stack.inertial(qd)) / (2 * STEP)
            stack.at(q)
            out[:, :, 0] = stack.inertial(qd)
            return out

        both = self._map(one, q, qd)
        return both[:, :, 0], both[:, :, 1:]

    def inverse_dynamics_gradient(self, q: Array, qd: Array, qdd: Array) -> tuple[Array, Array, Array, Array]:
        """tau (K, n) and dtau/dq, dtau/dqd, dtau/dqdd = M, each (K, n, n) with [k, i, j] = d tau_i / d x_j.

        By qd exactly, by polarisation of the bias (it is quadratic in qd); by q with central differences.
        """

        def one(stack: Stack, q: Array, qd: Array, qdd: Array) -> Array:
            out = np.empty((stack.size, stack.n, 1 + 3 * stack.n))
            by_q, by_qd = out[:, :, 1 : 1 + stack.n], out[:, :, 1 + stack.n : 1 + 2 * stack.n]
            for j, unit in enumerate(np.eye(stack.n)):
                stack.at(q + STEP * unit, qd)
                ahead = stack.inverse_dynamics(qdd)
                stack.at(q - STEP * unit, qd)
                by_q[:, :, j] = (ahead - stack.inverse_dynamics(qdd)) / (2 * STEP)
                stack.at(q, qd + unit)
                ahead = stack.bias()
                stack.at(q, qd - unit)
                by_qd[:, :, j] = (ahead - stack.bias()) / 2
            stack.at(q, qd)
            out[:, :, 0] = stack.inverse_dynamics(qdd)
            out[:, :, 1 + 2 * stack.n :] = stack.mass_matrix()
            return out

        out = self._map(one, q, qd, qdd)
        n = self.n
        return out[:, :, 0], out[:, :, 1 : 1 + n], out[:, :, 1 + n : 1 + 2 * n], out[:, :, 1 + 2 * n :]

    # --- stacking -----------------------------------------------------------------------------------------------

    def _map(self, one: Callable[..., Array], *arguments: Array) -> Array:
        blocks = list(self._blocks(one, *arguments))
        return blocks[0] if len(blocks) == 1 else np.concatenate(blocks)

    def _blocks(self, one: Callable[..., Array], *arguments: Array) -> Iterator[Array]:
        count = len(arguments[0])
        for start in range(0, count, BLOCK):
            size = min(BLOCK, count - start)
            if size not in self._stacks:
                self._stacks[size] = Stack(self.description, self.mounting, size)
            yield one(self._stacks[size], *(argument[start : start + size] for argument in arguments))

    def _position_and_jacobian(self, stack: Stack, q: Array) -> Array:
        stack.at(q)
        out = np.empty((stack.size, 3, 1 + self.n))
        out[:, :, 0] = [tip.CalcPoseInWorld(stack.context).translation() for tip in stack.tips]
        out[:, :, 1:] = self._jacobians(stack)
        return out

    @staticmethod
    def _jacobians(stack: Stack, spatial: bool = False) -> Array:
        n, zero, plant = stack.n, np.zeros(3), stack.plant
        jacobian = plant.CalcJacobianSpatialVelocity if spatial else plant.CalcJacobianTranslationalVelocity
        return np.array(
            [
                jacobian(stack.context, JacobianWrtVariable.kV, tip, zero, stack.world, stack.world)[
                    :, k * n : (k + 1) * n
                ]
                for k, tip in enumerate(stack.tips)
            ]
        )

    def __getstate__(self) -> dict[str, Any]:
        """Plants cannot be pickled: a worker process builds its own (about 3 ms) when it first needs one."""
        return {**self.__dict__, "_stacks": {}}
