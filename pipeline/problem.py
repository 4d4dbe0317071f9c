"""The data that flows through one run: what is asked (Problem) and what comes back (Solution)."""

from __future__ import annotations

import enum
from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from pipeline.arrays import Array
from pipeline.clearance import Obstacles
from pipeline.path import Reference
from pipeline.secondary import Secondary
from pipeline.task import Task

Progress = Callable[[int, int, float], None]  # (done, all, best cost so far)


class Status(enum.Enum):
    """How a method ended; the value is the sentence that a user reads."""

    SOLVED = "solved: the motion follows the path and the method's own conditions hold"
    SINGULAR = "singular: the method ran into a singular configuration; its motion is not to be used from there on"
    NOT_CONVERGED = "not converged: the solver stopped before its conditions held; try more iterations or more starts"
    INFEASIBLE = "infeasible: no motion was found that meets the path and every limit"
    UNCONFIRMED = "unconfirmed: the motion recomputed from q(t) does not do what the method claims"

    @property
    def word(self) -> str:
        return self.value.split(":")[0]


@dataclass(frozen=True)
class Objective:
    """A sum of integrals: weights of the kinetic energy, the squared joint torques and the squared joint velocities;
    what `secondary` gains is taken off (Pontryagin report eq. (13) with the sign that maximises it).

    Of the base: the squared angular velocity of one that floats; the squared force and torque on one that is held.
    """

    kinetic_energy: float = 1.0
    torque: float = 0.0
    velocity_norm: float = 0.0
    secondary: Secondary | None = None
    base_rotation: float = 0.0
    reaction_force: float = 0.0
    reaction_torque: float = 0.0

    @property
    def second_order(self) -> bool:
        """Whether accelerations count."""
        return self.torque > 0 or self.reaction_force > 0 or self.reaction_torque > 0


LIMIT_KINDS = ("position", "velocity", "torque", "power", "clearance", "attitude")
INTEGRALS = ("kinetic_energy", "torque", "base_rotation", "reaction_force", "reaction_torque")


@dataclass(frozen=True)
class IntegralBounds:
    """Upper bounds on the same integrals; infinite where there is none."""

    kinetic_energy: float = np.inf
    torque: float = np.inf
    base_rotation: float = np.inf
    reaction_force: float = np.inf
    reaction_torque: float = np.inf

    def bounds(self, *names: str) -> bool:
        """Whether one of the integrals `names` is bounded."""
        return any(np.isfinite(getattr(self, name)) for name in names)


@dataclass(frozen=True)
class Limits:
    """Bounds (n,) on joint motion; infinite where there are none. Units: rad, rad/s, N m, W.

    attitude [rad]: by how much a floating base may turn from its start, at any time.
    """

    lower: Array
    upper: Array
    velocity: Array
    torque: Array
    power: Array
    attitude: float = np.inf

    @property
    def any(self) -> bool:
        """Whether there is a limit at all."""
        return any(
            np.isfinite(bound).any()
            for bound in (self.lower, self.upper, self.velocity, self.torque, self.power, self.attitude)
        )

    @classmethod
    def none(cls, n: int) -> Limits:
        free = np.full(n, np.inf)
        return cls(-free, free, free, free, free)


class Boundary(enum.Enum):
    """What is prescribed of the joint motion at its ends."""

    FIXED = "fixed"  # q(0) given
    FREE = "free"  # q(0) chosen on the self-motion manifold of the start
    CYCLIC = "cyclic"  # q(T) = q(0), qd(T) = qd(0)


@dataclass(frozen=True)
class Problem:
    """Follow `reference` with the arm of `task`, at least cost, within limits.

    q_init: (n,) [rad] the initial configuration (for boundary `free` and `cyclic`: the one that starts are drawn from).
    times: (N + 1,) [s] the knots of the grid on which a global solution is wanted.
    qd_init: (n,) [rad/s] the velocity that a motion from q_init comes with; None: at rest, or as the path is entered.
    """

    task: Task
    reference: Reference
    q_init: Array
    times: Array
    objective: Objective = field(default_factory=Objective)
    limits: Limits | None = None
    boundary: Boundary = Boundary.FIXED
    integral_bounds: IntegralBounds = field(default_factory=IntegralBounds)
    obstacles: Obstacles | None = None
    qd_init: Array | None = None

    @property
    def bounds(self) -> Limits:
        return self.limits if self.limits is not None else Limits.none(self.task.arm.n)

    @property
    def constrained(self) -> bool:
        """Whether anything limits the motion besides its path."""
        return self.bounds.any or self.obstacles is not None


@dataclass(frozen=True)
class Trajectory:
    """A joint motion: time (N + 1,) [s], q (N + 1, n) [rad]. Everything else is computed from these two."""

    time: Array
    q: Array


@dataclass(frozen=True)
class Solution:
    """What a method returns: its motion, how it ended, and statistics of the solver (never used for reporting costs).

    `optimum` counts distinct optima of one method from 1 on. `event_time` [s] is when a singularity was met.
    `tracking_tolerance` [m] is what the method promises to keep of the path at its knots; the evaluation checks it.
    `limits_kept` are the kinds of limits that it promises to keep at its knots.
    `found` is False where there is no motion to speak of: the trajectory then only holds the arm at its start.
    """

    method: str
    trajectory: Trajectory
    status: Status
    message: str = ""
    optimum: int = 1
    event_time: float | None = None
    tracking_tolerance: float = np.inf
    limits_kept: tuple[str, ...] = ()
    found: bool = True
    statistics: dict[str, Any] = field(default_factory=dict)


def no_progress(done: int, total: int, best: float) -> None:
    """Say nothing."""
