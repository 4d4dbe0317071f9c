"""How far the curve that is exported is from its path, at its knots and between them."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from pipeline.evaluation.plant import SinglePlant
from pipeline.problem.curve import whole
from pipeline.problem.problem import Problem
from pipeline.problem.solution import Trajectory

INNER = 8  # sub-intervals per knot interval at which the curve is held against its path


@dataclass(frozen=True)
class OffPath:
    """The largest errors of a curve, at its knots and between them: distance [m] and angle [rad], and when [s]."""

    distance: float
    angle: float
    when: tuple[float, float]


def off_path(problem: Problem, plant: SinglePlant, trajectory: Trajectory) -> OffPath:
    """How far the curve of a trajectory is from its path; nan where it has none."""
    time, q = trajectory.time, trajectory.q
    if not np.all(np.isfinite(q)):
        return OffPath(np.nan, np.nan, (np.nan, np.nan))
    moments = np.interp(np.arange(INNER * (len(time) - 1) + 1) / INNER, np.arange(len(time)), time)
    motion, targets = whole(problem, trajectory)(moments), problem.reference.position(moments)
    error = np.empty((len(moments), 2))
    for i in range(len(moments)):
        plant.at(motion[i], np.zeros_like(motion[i]))
        error[i] = plant.task_error(problem.task, targets[i])
    worst = error.argmax(axis=0)
    distance, angle = error.max(axis=0)
    return OffPath(float(distance), float(angle), (float(moments[worst[0]]), float(moments[worst[1]])))
