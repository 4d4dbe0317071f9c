"""The distinct optima that starts have led to on one grid, and how many starts ago the last of them was new."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from pipeline.common.arrays import Array
from pipeline.methods.global_planner.optimum import Optimum, stays_on_path
from pipeline.model.kinematics import wrap
from pipeline.problem.problem import Problem


@dataclass(frozen=True)
class Basins:
    """`optima`: distinct, best first; `members`: how many starts came to each; `barren`: how many starts were tried
    since the last of them was new; `jumping`: how many more optima leave the path between their knots.
    """

    optima: list[Optimum]
    members: list[int]
    barren: int
    jumping: int


def basins(
    problem: Problem,
    times: Array,
    starts: Sequence[Optimum],
    same: float,
    *,
    jumps: float = np.inf,
    dearest: float = np.inf,
) -> Basins:
    """Of the optima on the knots `times` that `starts` ended in: those of which no two are closer than `same` [rad].

    Left out are those that between the knots leave the path by more than the share `jumps` of its length, and those
    that cost more than `dearest` times the best of the others (`ceiling`).
    """
    converged = [number for number, start in enumerate(starts) if start.converged]
    left = np.array(sorted(converged, key=lambda number: starts[number].cost), dtype=int)
    q, revolute = np.array([starts[number].q for number in left]), problem.task.arm.description.revolute
    optima: list[Optimum] = []
    members, newest, jumping = [], -1, 0
    while len(left) and (not optima or starts[left[0]].cost <= ceiling(optima[0].cost, dearest)):
        optimum = starts[left[0]]
        here = np.abs(wrap(q - q[0], revolute)).max(axis=(1, 2)) <= same
        if np.isinf(jumps) or stays_on_path(problem, times, optimum.q, jumps):
            optima.append(optimum)
            members.append(int(here.sum()))
            newest = max(newest, int(left[here].min()))
        else:
            jumping += 1
        left, q = left[~here], q[~here]
    return Basins(optima, members, len(starts) - 1 - newest, jumping)


def ceiling(best: float, times: float) -> float:
    """The cost that is so many times the best: as far above it where that is negative, as a secondary criterion can
    make it.
    """
    return best + (times - 1) * abs(best) if np.isfinite(times) else np.inf


def nearest(problem: Problem, optimum: Optimum, others: list[Optimum]) -> int:
    """Which of the others' motions is nearest."""
    apart = wrap(np.array([other.q for other in others]) - optimum.q, problem.task.arm.description.revolute)
    return int(np.abs(apart).max(axis=(1, 2)).argmin())
