"""What a method returns: a motion, how it ended, and statistics of the solver."""

from __future__ import annotations

import enum
from collections.abc import Callable
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
import pandas as pd

from pipeline.common.arrays import Array
from pipeline.path.reference import Reference
from pipeline.problem.problem import Problem

Progress = Callable[[int, int, float], None]  # (done, all, best cost so far)


class Status(enum.Enum):
    """How a method ended; the value is the sentence that a user reads."""

    SOLVED = "solved: the motion follows the path and the method's own conditions hold"
    SINGULAR = "singular: the method ran into a singular configuration; its motion is not to be used from there on"
    NOT_CONVERGED = "not converged: the solver stopped before its conditions held; try more iterations or more starts"
    INFEASIBLE = "none found: of what was tried, no motion meets the path and every limit"
    UNCONFIRMED = "unconfirmed: the motion recomputed from q(t) does not do what the method claims"

    @property
    def word(self) -> str:
        return self.value.split(":")[0]


@dataclass(frozen=True)
class Trajectory:
    """A joint motion: time (N + 1,) [s], q (N + 1, n) [rad]. Everything else is computed from these.

    ends: (2, n) [rad/s] the velocities at both ends of a motion that is a spline, the C2 cubic one through its knots;
    None: of what is known at its knots alone.
    """

    time: Array
    q: Array
    ends: Array | None = None


@dataclass(frozen=True)
class Solution:
    """What a method returns: its motion, how it ended, and statistics of the solver (never used for reporting costs).

    `optimum` counts distinct optima of one method from 1 on. `event_time` [s] is when a singularity was met.
    `tracking_tolerance` [m] is what the method promises to keep of the path at its knots, `until` a time [s] from which
    on a singular motion is not to be used; the evaluation checks it.
    `limits_kept` are the kinds of limits that it promises to keep at its knots.
    `clear_between`: of those, clearances are promised along the whole curve.
    `knots_only`: it goes from node to node of a grid, and promises nothing of the path between its knots.
    `grid` is the key of the configuration that its knots come from.
    `stretch` [m]: the part of the path that it follows, if not all; `approach`: the motion through joint space from
    the part before, from rest to rest, its times from 0 on.
    `evidence`: what speaks for the motion, in words: how it was found and what confirms it.
    `reference`: the path with the law that was found for it; None: it is the problem's.
    `found` is False where there is no motion to speak of: the trajectory then only holds the arm at its start.
    """

    method: str
    trajectory: Trajectory
    status: Status
    message: str = ""
    optimum: int = 1
    event_time: float | None = None
    tracking_tolerance: float = np.inf
    until: float = np.inf
    limits_kept: tuple[str, ...] = ()
    clear_between: bool = False
    found: bool = True
    knots_only: bool = False
    grid: str = "timing.steps"
    evidence: str = ""
    reference: Reference | None = None
    stretch: tuple[float, float] | None = None
    approach: Trajectory | None = None
    statistics: dict[str, Any] = field(default_factory=dict)

    def posed(self, problem: Problem) -> Problem:
        """The problem with the law that was found for it, on its own knots."""
        if self.reference is None:
            return problem
        found = replace(problem, reference=self.reference, times=self.trajectory.time)
        return replace(found, free_law=False, free_duration=False)

    def to_frame(self) -> pd.DataFrame:
        """The motion as a table of N + 1 rows: time [s], all coordinates q_1..n [rad or m], a moving base's first."""
        q = self.trajectory.q
        return pd.DataFrame({"time": self.trajectory.time, **{f"q_{j + 1}": q[:, j] for j in range(q.shape[1])}})


def no_progress(done: int, total: int, best: float) -> None:
    """Say nothing."""


def no_phase(words: str) -> None:
    """Say nothing."""
