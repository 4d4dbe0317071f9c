"""An arm whose kinematics and first-order dynamics are the kernel's: for methods that need many knots at once."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np

from pipeline.common.arrays import Array
from pipeline.model.arm import Arm
from pipeline.model.kernel.chain import Chain
from pipeline.model.kernel.energy import energy
from pipeline.model.task import Task

BLOCK = 512  # knots per call: more leave the processor's cache


class KernelArm(Arm):
    """The same numbers as `Arm`'s, out of the same plant, without a call into Drake for every knot.

    What is not defined here is Drake's.
    """

    def __init__(self, arm: Arm) -> None:
        super().__init__(arm.on_fixed_base.description, arm.mounting, arm.base)
        self.chain = Chain.of(arm)

    def position(self, q: Array) -> Array:
        """End-effector positions (K, 3) [m] in the world."""
        return self._blockwise(lambda q: self.chain.tip_position(self.chain.places(q)).T, q)

    def position_and_jacobian(self, q: Array) -> tuple[Array, Array]:
        """Positions (K, 3) [m] and translational Jacobians (K, 3, n) [m/rad]."""
        both = self._blockwise(self._position_and_columns, q)
        return both[:, :, 0], both[:, :, 1 : 1 + self.n]

    def jacobian(self, q: Array) -> Array:
        """Translational Jacobians (K, 3, n) of the end effector [m/rad]."""
        return self.position_and_jacobian(q)[1]

    def spatial_jacobian(self, q: Array) -> Array:
        """Angular, then translational Jacobians (K, 6, n) of the end effector in the world [rad/rad, m/rad]."""
        both = self._blockwise(self._position_and_columns, q)
        return np.concatenate([both[:, :, 1 + self.n :], both[:, :, 1 : 1 + self.n]], axis=1)

    def jacobian_rate_term(self, q: Array, qd: Array) -> Array:
        """The acceleration Jd qd (K, 3) [m/s^2] of the end effector at qdd = 0."""
        return np.asarray(np.einsum("kijl,kj,kl->ki", self.jacobian_and_gradient(q)[1], qd, qd))

    def kinetic_energy_gradient(self, q: Array, qd: Array) -> tuple[Array, Array, Array]:
        """T (K,), dT/dq (K, n) [J/rad] and dT/dqd = M qd (K, n) [N m s]."""

        def one(q: Array, qd: Array) -> Array:
            found = energy(self.chain, q, qd, second=False)
            return np.column_stack([found.value, found.by_q, found.by_qd])

        found = self._blockwise(one, q, qd)
        return found[:, 0], found[:, 1 : 1 + self.n], found[:, 1 + self.n :]

    def _position_and_columns(self, q: Array) -> Array:
        """(K, 3, 1 + 2 n): the position, each joint's translational and then each joint's angular column."""
        at = self.chain.places(q)
        x = self.chain.tip_position(at)
        columns = np.concatenate([x[None], self.chain.tip_jacobian(at, x), at.turning])
        return np.ascontiguousarray(columns.transpose(2, 1, 0))

    @staticmethod
    def _blockwise(one: Callable[..., Any], *arguments: Array) -> Array:
        count = len(arguments[0])
        parts = [one(*(a[k : k + BLOCK] for a in arguments)) for k in range(0, max(1, count), BLOCK)]
        return np.asarray(parts[0] if len(parts) == 1 else np.concatenate(parts))


def on_kernel(task: Task) -> Task:
    """The same task, of the same arm on the kernel."""
    return replace(task, arm=KernelArm(task.arm))
