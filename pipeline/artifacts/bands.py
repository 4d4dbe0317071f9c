"""What of a motion is limited, joint by joint: its values, its bounds and how much of them it uses."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from pipeline.common.arrays import Array
from pipeline.evaluation.evaluation import Evaluation
from pipeline.problem.problem import Problem


@dataclass(frozen=True)
class Band:
    """One kind of joint values and its bounds.

    lower, upper: (n,) of the arm's own joints, infinite where there is no limit. units: (n,) of each joint, by whether
    it turns or slides. values: of an evaluated motion, (N + 1, n).
    """

    kind: str
    units: tuple[str, ...]
    lower: Array
    upper: Array
    values: Callable[[Evaluation], Array]

    @property
    def unit(self) -> str:
        """One for an axis on which all joints are drawn."""
        return " or ".join(dict.fromkeys(self.units))

    @property
    def limited(self) -> bool:
        return bool(np.isfinite(self.lower).any() or np.isfinite(self.upper).any())

    def used(self, e: Evaluation) -> Array:
        """The share (N + 1, n) of the bounds that is used, from the middle between them on; 0 where one is missing."""
        both = np.isfinite(self.lower) & np.isfinite(self.upper)
        low, high = np.where(both, self.lower, 0.0), np.where(both, self.upper, 0.0)
        half = np.where(both, (high - low) / 2, np.inf)
        return np.nan_to_num(np.abs(self.values(e) - (low + high) / 2) / half)


@dataclass(frozen=True)
class Closest:
    """Where a motion comes nearest to a limit: share of it, its size with unit, the joint's name, the time [s]."""

    kind: str
    share: float
    bound: str
    joint: str
    time: float

    @property
    def said(self) -> str:
        return f"{self.joint}, {self.percent} % of its {self.kind} ({self.bound}) at {self.time:.3g} s"

    @property
    def brief(self) -> str:
        """For a cell of a table."""
        return f"{self.joint} {self.kind} {self.percent} % of {self.bound} at {self.time:.3g} s"

    @property
    def percent(self) -> str:
        """Whole percents; where that would hide which side of the bound it is on, four digits."""
        share = 100 * self.share
        return f"{share:.0f}" if share < 99.5 else f"{share:.4g}"


def bands(problem: Problem) -> tuple[Band, ...]:
    """Positions, velocities, accelerations, torques and powers, limited or not."""
    arm, limits = problem.task.arm, problem.bounds
    turns = arm.description.turning

    def units(turning: str, sliding: str) -> tuple[str, ...]:
        return tuple(turning if turn else sliding for turn in turns)

    def own(bound: Array) -> Array:
        return np.broadcast_to(bound, arm.n)[arm.joints]

    def both(kind: str, of: tuple[str, ...], bound: Array, values: Callable[[Evaluation], Array]) -> Band:
        return Band(kind, of, -own(bound), own(bound), values)

    return (
        Band("position", units("rad", "m"), own(limits.lower), own(limits.upper), lambda e: e.q),
        both("velocity", units("rad/s", "m/s"), limits.velocity, lambda e: e.qd),
        both("acceleration", units("rad/s²", "m/s²"), limits.acceleration, lambda e: e.qdd),
        both("torque", units("N m", "N"), limits.torque, lambda e: e.tau),
        both("power", units("W", "W"), limits.power, lambda e: e.power),
    )


def used(problem: Problem, e: Evaluation, band: Band) -> Closest:
    """Where `e` uses most of the limits of one kind, at its knots."""
    shares = band.used(e)
    k, j = np.unravel_index(int(np.argmax(shares)), shares.shape)
    low, high = band.lower[j], band.upper[j]
    bound = f"{low:.4g} to {high:.4g}" if band.kind == "position" else f"{high:.4g}"
    joint = problem.task.arm.description.actuated[j]
    return Closest(band.kind, float(shares[k, j]), f"{bound} {band.units[j]}", joint, float(e.time[k]))


def closest(problem: Problem, e: Evaluation) -> Closest | None:
    """The limit of which `e` uses most; None where no joint has one."""
    every = [used(problem, e, band) for band in bands(problem) if band.limited]
    return max(every, key=lambda one: one.share, default=None)
