"""The data that flows through one run: what is asked (Problem) and what comes back (Solution)."""

from __future__ import annotations

import enum
from collections.abc import Mapping
from dataclasses import dataclass, field, replace

import numpy as np

from pipeline.common.arrays import Array
from pipeline.common.errors import InputError
from pipeline.model.obstacles import Obstacles, Own
from pipeline.model.task import Task
from pipeline.path.reference import Reference
from pipeline.problem.integrals import ByIntegral
from pipeline.problem.limits import Limits
from pipeline.problem.objective import Objective

CLOSED = 1e-9  # [m] and [rad]: between the ends of a closed path


class Boundary(enum.Enum):
    """What is prescribed of the joint motion at its ends."""

    FIXED = "fixed"  # q(0) given
    FREE = "free"  # q(0) chosen on the self-motion manifold of the start
    CYCLIC = "cyclic"  # q(T) = q(0), qd(T) = qd(0)


@dataclass(frozen=True)
class Problem:
    """Follow `reference` with the arm of `task`, at least cost, within limits.

    q_init: (n,) [rad] the initial configuration (for boundary `free` and `cyclic`: the one that starts are drawn from).
    times: (N + 1,) [s] the knots of the grid on which a solution is wanted.
    bounds_of_integrals: upper bounds by the names in the catalogue (`integrals.py`), positive; an infinite one is none.
    qd_init: (n,) [rad/s] the velocity that a motion from q_init comes with; None: at rest, or as the path is entered.
    qdd_init: (n,) [rad/s^2] the acceleration that it comes with, which counts where jerks are limited; None: none.
    own: the links that may not touch, None: nothing is to be known of them.
    rest: whether all joints rest at the start, at the end. zero_acceleration: whether they do not accelerate there.
    free_law: whether the law of the path is to be found, in the time of the one given; free_duration: whether the
    motion is to be as short as its limits allow. `reference` and `times` are then where the search begins.
    """

    task: Task
    reference: Reference
    q_init: Array
    times: Array
    objective: Objective = field(default_factory=Objective)
    limits: Limits | None = None
    boundary: Boundary = Boundary.FIXED
    bounds_of_integrals: Mapping[str, float] = field(default_factory=dict)
    obstacles: Obstacles | None = None
    own: Own | None = None
    qd_init: Array | None = None
    qdd_init: Array | None = None
    rest: tuple[bool, bool] = (False, False)
    zero_acceleration: bool = False
    free_law: bool = False
    free_duration: bool = False

    def __post_init__(self) -> None:
        for name, bound in self.bounds_of_integrals.items():
            if not bound > 0:
                raise InputError(f"the bound of the integral {name} is {bound:g}; it must be positive")
        finite = ByIntegral({name: bound for name, bound in self.bounds_of_integrals.items() if bound < float("inf")})
        object.__setattr__(self, "bounds_of_integrals", finite)

    @property
    def bounds(self) -> Limits:
        return self.limits if self.limits is not None else Limits.none(self.task.arm.n)

    @property
    def free_timing(self) -> bool:
        """Whether the law of the path or its duration is to be found."""
        return self.free_law or self.free_duration

    def slowed(self, by: float) -> Problem:
        """The same problem in `by` times the time."""
        return replace(self, reference=self.reference.slowed(by), times=self.times * by)

    @property
    def gap(self) -> tuple[float, float]:
        """How far the path's end is from its start, [m] and [rad]."""
        start, end = self.reference.position(np.array([0.0, self.reference.duration]))
        return self.task.apart(start, end)

    @property
    def closed_path(self) -> bool:
        """Whether the path ends where it starts, so that a cycle can follow it."""
        return max(self.gap) <= CLOSED

    @property
    def constrained(self) -> bool:
        """Whether anything limits the motion besides its path and the arm itself."""
        return self.bounds.any or self.obstacles is not None

    @property
    def keeps_clear(self) -> bool:
        """Whether the motion must keep clear of anything: of obstacles or of the arm itself."""
        return self.obstacles is not None or (self.own is not None and self.own.kept)
