"""The peer's arm in space: kinetic energy and tasks of a chain of joints in CasADi, by a recursion from link to link.

Masses, inertias and places come from the pipeline's kernel, which has them from Drake's plant; the equations are
written here.
"""

from __future__ import annotations

import casadi as ca
import numpy as np
from scipy.spatial.transform import Rotation

from pipeline.common.arrays import Array
from pipeline.model.kernel.chain import Chain
from pipeline.model.task import PoseTask, Task


class SpatialArm:
    """A serial arm of revolute joints; its path's rows are those of `task`, orientations by the sine of their error."""

    def __init__(self, task: Task) -> None:
        self.task, self.chain = task, Chain.of(task.arm)
        self.n = self.chain.n
        assert not self.chain.slides.any()

    def targets(self, x: Array) -> Array:
        """(K, m) positions, or (K, 12) positions and rotation matrices, of the pipeline's targets."""
        if not isinstance(self.task, PoseTask):
            return x
        return np.hstack([x[:, :3], Rotation.from_rotvec(x[:, 3:]).as_matrix().reshape(-1, 9)])

    def kinetic_energy(self, q: ca.SX, qd: ca.SX) -> ca.SX:
        chain, energy = self.chain, 0.5 * ca.dot(self.chain.armature * qd, qd)
        angular, linear = ca.SX.zeros(3), ca.SX.zeros(3)  # of each joint's frame, in that frame
        for j in range(self.n):
            back = (chain.turn[j] @ _about_z(q[j])).T
            linear = back @ (linear + ca.cross(angular, chain.shift[j]))
            angular = back @ angular + ca.vertcat(0, 0, qd[j])
            moment = ca.dot(linear, ca.cross(angular, chain.moment[j]))
            energy += 0.5 * chain.mass[j] * ca.sumsqr(linear) + moment
            energy += 0.5 * ca.dot(angular, chain.inertia[j] @ angular)
        return energy

    def rows(self, q: ca.SX, target: ca.SX) -> ca.SX:
        chain, rotation, at = self.chain, ca.SX.eye(3), ca.SX.zeros(3)
        for j in range(self.n):
            at = at + rotation @ chain.shift[j]
            rotation = rotation @ chain.turn[j] @ _about_z(q[j])
        at, rotation = at + rotation @ chain.tip, rotation @ chain.tip_turn
        if not isinstance(self.task, PoseTask):
            return at[self.task.rows] - target
        wanted = ca.reshape(target[3:], 3, 3).T
        if self.task.pointing is None:
            apart = wanted.T @ rotation
            return ca.vertcat(at - target[:3], ca.inv_skew(apart - apart.T) / 2)
        axis = np.array(self.task.pointing) / np.linalg.norm(self.task.pointing)
        return ca.vertcat(at - target[:3], self.task.basis @ rotation.T @ wanted @ axis)


def _about_z(angle: ca.SX) -> ca.SX:
    cos, sin = ca.cos(angle), ca.sin(angle)
    return ca.vertcat(ca.horzcat(cos, -sin, 0), ca.horzcat(sin, cos, 0), ca.horzcat(0, 0, 1))
