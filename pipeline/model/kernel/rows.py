"""The rows of a task on the kernel: error, Jacobian and second derivatives, for many knots in one call.

For a point of the end effector an earlier joint i turns what a later joint j does: d2x/dq_i dq_j = w_i x J_j for
i <= j. Orientation rows use own_i, joint i's angular velocity in the effector's frame. Of the rotation logarithm phi
(whose first derivative is exact) and of the direction `seen` (the prescribed axis in the effector's frame), on the
target:

    d2phi/dq_i dq_j = 1/2 own_i x own_j,       d2seen/dq_i dq_j = own_j x (own_i x seen),       i <= j,

so that the multipliers' curvature is a sum of products left_i . right_j for i <= j, and symmetric.
Away from the target the angular ones lack terms of the size of the error, which vanish where a Newton method ends.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from pipeline.common.arrays import Array
from pipeline.model.kernel.chain import Chain, Places
from pipeline.model.task import PoseTask, Task


@dataclass(frozen=True)
class Rows:
    """error (K, m), jacobian (K, m, n), and the columns (K, n, 3) that second derivatives are made of: turning w_i,
    moving J_i and, for poses, own_i.
    """

    error: Array
    jacobian: Array
    columns: tuple[Array, ...]


class TaskRows:
    """The rows of `task`, on the kernel of its arm."""

    def __init__(self, chain: Chain, task: Task) -> None:
        self.chain, self.task, self.axes = chain, task, task.rows
        self.pose = task if isinstance(task, PoseTask) else None

    def error(self, at: Places, target: Array) -> Array:
        """(K, m)."""
        x = self.chain.tip_position(at)[self.axes].T
        if self.pose is None:
            return x - target
        return np.hstack([x - target[:, :3], self.pose.turn(self.chain.tip_rotation(at), target)[0]])

    def evaluate(self, at: Places, target: Array) -> Rows:
        """Error, Jacobian and what second derivatives need, at targets (K, task coordinates)."""
        x = self.chain.tip_position(at)
        turning = np.ascontiguousarray(at.turning.transpose(2, 0, 1))
        moving = np.ascontiguousarray(self.chain.tip_jacobian(at, x).transpose(2, 0, 1))
        jacobian = moving[:, :, self.axes].swapaxes(1, 2)
        if self.pose is None:
            return Rows(x[self.axes].T - target, jacobian, (turning, moving))
        rotation = self.chain.tip_rotation(at)
        turn, by_turn = self.pose.turn(rotation, target)
        own = turning @ rotation
        error = np.hstack([x.T - target[:, :3], turn])
        columns = (turning, moving, own)
        return Rows(error, np.concatenate([jacobian, by_turn @ own.swapaxes(1, 2)], axis=1), columns)

    def curvature(self, columns: tuple[Array, ...], multipliers: Array) -> Array:
        """sum_k multipliers_k d2 error_k / dq dq (K, n, n), for multipliers (K, m)."""
        turning, moving, *own = columns
        pull = np.zeros((len(multipliers), 3))
        pull[:, self.axes] = multipliers[:, : len(self.axes)]
        product = _cross(pull[:, None], turning) @ moving.swapaxes(1, 2)
        if self.pose is not None:
            product += self.angular(own[0], multipliers[:, len(self.axes) :])
        return self.chain.mirrored(product)

    def angular(self, own: Array, multipliers: Array) -> Array:
        """The angular rows' share (K, n, n), right on and above the diagonal: own (K, n, 3), multipliers (K, m - 3)."""
        assert self.pose is not None
        if self.pose.pointing is None:
            return 0.5 * _cross(multipliers[:, None], own) @ own.swapaxes(1, 2)
        # error_k = (axis x basis_k) . seen, and seen = axis on the target
        axis = np.array(self.pose.pointing) / np.linalg.norm(self.pose.pointing)
        pull = np.cross(axis, multipliers @ self.pose.basis)
        return _cross(_cross(own, axis), pull[:, None]) @ own.swapaxes(1, 2)


def _cross(a: Array, b: Array) -> Array:
    """a x b on the last axis, without numpy.cross's cost."""
    ahead, behind = [1, 2, 0], [2, 0, 1]
    return np.asarray(a[..., ahead] * b[..., behind] - a[..., behind] * b[..., ahead])
