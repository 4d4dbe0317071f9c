"""When does a motion count as singular, or as lost? Watched at every step of the integrating methods."""

from __future__ import annotations

from typing import Any

import numpy as np

from pipeline.common.arrays import Array
from pipeline.problem.solution import Solution, Status, Trajectory

LOST = 1e6  # [rad or m]: no joint is there, and a sine is hardly known


def lost(q: Array) -> bool:
    """Whether an integration has left all bounds: what follows is not finite."""
    return not bool(np.abs(q).max() <= LOST)


def singular_value_ratio(jacobian: Array) -> Array:
    """The smallest singular value of J (..., m, n) over the largest (...)."""
    values = np.linalg.svd(jacobian, compute_uv=False)
    return np.asarray(values[..., -1] / values[..., 0])


class SingularityWatch:
    """Follows the smallest singular value of J, relative to the largest, and reports where it was too small."""

    def __init__(self, threshold: float, max_drift: float) -> None:
        self.threshold, self.max_drift, self.time, self.smallest = threshold, max_drift, 0.0, np.inf
        self.first = np.inf  # [s] when it fell below the threshold

    def see(self, time: float, jacobian: Array) -> None:
        ratio = float(singular_value_ratio(jacobian))
        if ratio < self.threshold:
            self.first = min(self.first, float(time))
        if ratio < self.smallest:
            self.time, self.smallest = float(time), ratio

    def lost(self, method: str, time: Array, q_init: Array, step: int) -> Solution:
        """None found, since the integration left all bounds at a step: the arm is held at its start (n,)."""
        message = (
            f"diverged at t = {time[step]:.3g} s, where the joints are beyond {LOST:g} rad or m; smallest singular "
            f"value {self.smallest:.1e} of the largest, at t = {self.time:.3g} s"
        )
        held = Trajectory(time, np.repeat(q_init[None], len(time), axis=0))
        return Solution(method, held, Status.INFEASIBLE, message, found=False, grid=f"method.{method}.dt")

    def judge(self, method: str, trajectory: Trajectory, statistics: dict[str, Any]) -> Solution:
        singular = self.smallest < self.threshold
        message = f"singular at t = {self.time:.2f} s (smallest singular value {self.smallest:.1e} of the largest)"
        return Solution(
            method,
            trajectory,
            Status.SINGULAR if singular else Status.SOLVED,
            message if singular else "",
            event_time=self.time if singular else None,
            tracking_tolerance=self.max_drift,
            until=self.first,
            grid=f"method.{method}.dt",
            statistics={**statistics, "smallest_singular_value_ratio": self.smallest},
        )
