"""The rows of a task (`rows.py`) on the kernel for a few knots."""

from __future__ import annotations

import numpy as np

from pipeline.common.arrays import Array
from pipeline.model.kernel.few import Few
from pipeline.model.kernel.rows import Rows, TaskRows
from pipeline.model.task import Task


class FewRows:
    """The rows of `task` at the knots where `few` was placed last."""

    def __init__(self, few: Few, task: Task) -> None:
        self.few, self.own = few, TaskRows(few.chain, task)
        self.pull = np.zeros((few.count, 3))

    def evaluate(self, target: Array) -> Rows:
        """Error, Jacobian and what second derivatives need, at targets (K, task coordinates)."""
        few, axes, pose = self.few, self.own.axes, self.own.pose
        x, moving = few.tip_and_jacobian()
        jacobian = moving[:, :, axes].swapaxes(1, 2)
        if pose is None:
            return Rows(x[:, axes] - target, jacobian, (moving,))
        rotation = few.tip_rotation()
        turn, by_turn = pose.turn(rotation, target)
        own = few.turning() @ rotation
        error = np.concatenate([x - target[:, :3], turn], axis=1)
        return Rows(error, np.concatenate([jacobian, by_turn @ own.swapaxes(1, 2)], axis=1), (moving, own))

    def curvature(self, rows: Rows, multipliers: Array) -> Array:
        """sum_k multipliers_k d2 error_k / dq dq (K, n, n), for multipliers (K, m)."""
        axes = self.own.axes
        self.pull[:, axes] = multipliers[:, : len(axes)]
        bent = self.few.path_curvature(self.pull, rows.columns[0])
        if self.own.pose is None:
            return bent
        return bent + self.own.chain.mirrored(self.own.angular(rows.columns[1], multipliers[:, len(axes) :]))
