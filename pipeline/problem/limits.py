"""Bounds on the joint motion and on the base's attitude."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from pipeline.common.arrays import Array
from pipeline.model.arm import Arm

LIMIT_KINDS = (
    *("position", "velocity", "acceleration", "jerk", "torque", "power", "clearance", "self_clearance", "attitude"),
    *("tool_speed", "tool_acceleration"),
)
FREE = np.array(np.inf)


@dataclass(frozen=True)
class Limits:
    """Bounds (n,) on joint motion; infinite where there are none. Units: rad, rad/s, N m, W, rad/s^2, rad/s^3.

    attitude [rad]: by how much a floating base may turn from its start, at any time. tool_speed [m/s],
    tool_acceleration [m/s^2]: of the end effector's prescribed coordinates, by their vector's length.
    """

    lower: Array
    upper: Array
    velocity: Array
    torque: Array
    power: Array
    attitude: float = np.inf
    acceleration: Array = field(default_factory=lambda: FREE)
    jerk: Array = field(default_factory=lambda: FREE)
    tool_speed: float = np.inf
    tool_acceleration: float = np.inf

    @property
    def any(self) -> bool:
        """Whether there is a limit at all that a motion along its path may break."""
        return (
            any(
                np.isfinite(bound).any()
                for bound in (self.lower, self.upper, self.velocity, self.torque, self.power, self.attitude)
            )
            or self.smooth
        )

    @property
    def smooth(self) -> bool:
        """Whether accelerations or jerks are limited, which differences cannot keep between their knots."""
        return bool(np.isfinite(self.acceleration).any() or np.isfinite(self.jerk).any())

    @property
    def limits_tool(self) -> bool:
        """Whether the pace of the tool is limited, which its path and the law of that decide."""
        return bool(np.isfinite(self.tool_speed) or np.isfinite(self.tool_acceleration))

    @classmethod
    def of(cls, arm: Arm) -> Limits:
        """Those of the arm's description: positions, velocities and efforts; powers have none there."""
        own, free = arm.description, np.full(arm.n, np.inf)
        return cls(own.lower.copy(), own.upper.copy(), own.velocity.copy(), own.effort.copy(), free)

    @classmethod
    def none(cls, n: int) -> Limits:
        """No limits on n joints."""
        free = np.full(n, np.inf)
        return cls(-free, free, free, free, free)
