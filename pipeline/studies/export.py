"""A motion at the rate of a controller: a smooth curve through its knots, its exact derivatives, and what it keeps."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np

from pipeline.common.arrays import Array
from pipeline.evaluation.between import audit
from pipeline.evaluation.evaluation import Evaluation
from pipeline.evaluation.limits import LIMITS
from pipeline.problem.curve import curve, whole
from pipeline.problem.problem import Problem
from pipeline.studies.study import Motions, Result

TOLERANCE = 1e-6  # relative: of limits that are met
BETWEEN = 4  # sub-intervals per knot interval at which the curve is judged, besides its samples


@dataclass(frozen=True)
class Resampled(Result):
    """Samples at time (K,) [s]: q, qd, qdd (K, n); and what the evaluation's own plant says of their curve.

    limit_excess: by kind, relative (see evaluation.limit_excess); worst: where each is largest, (time [s], joint).
    """

    name: ClassVar[str] = "export"
    units: ClassVar[Mapping[str, str]] = {"export_tracking_error": "m"}
    method: str
    optimum: int
    time: Array
    q: Array
    qd: Array
    qdd: Array
    tracking_error: float
    orientation_error: float
    limit_excess: dict[str, float]
    worst: dict[str, tuple[float, str]]

    @property
    def keeps_limits(self) -> bool:
        return all(excess <= TOLERANCE for excess in self.limit_excess.values())

    def section(self) -> list[str]:
        return [f"Exported: {sentence(self)}."]

    def columns(self, motion: Evaluation) -> Mapping[str, Any]:
        if (motion.method, motion.solution.optimum) != (self.method, self.optimum):
            return {}
        excesses = {f"export_{kind}_limit_excess": excess for kind, excess in self.limit_excess.items()}
        return {"export_tracking_error": self.tracking_error, **excesses}

    def facts(self) -> Mapping[str, Any]:
        return {
            "method": self.method,
            "optimum": self.optimum,
            "samples": len(self.time),
            "tracking_error": self.tracking_error,
            "limit_excess": self.limit_excess,
            "keeps_limits": self.keeps_limits,
        }


class Nothing(Result):
    """No motion is good enough to be sent."""

    name = "export"

    def section(self) -> list[str]:
        return [
            "Exported: nothing, since no confirmed motion keeps every limit and, to path.tolerance between its knots "
            "too, its path (export.method names one anyway)."
        ]


def study(motions: Motions) -> Result | None:
    """The motion that is to be exported, resampled; None if none is asked for, or the method asked for has none."""
    motion, config = chosen(motions), motions.config.export
    if motion is None:
        return Nothing() if config.method == "best" else None
    return resample(motions.problem, motion, config.rate)


def chosen(motions: Motions) -> Evaluation | None:
    """The motion to export; None if there is no confirmed one, or none is asked for.

    The best one keeps every limit and every clearance at its knots, and its path between them too: a method that knows
    none may go cheaply through a wall. Of a method with several optima, and of all methods, it is the cheapest by the
    problem's own objective.
    """
    asked = motions.config.export.method
    good = [e for e in motions.solved if asked in ("best", e.method)]
    if asked == "best":
        good = [e for e in good if max(e.limit_excess.values(), default=0.0) <= LIMITS and e.on_path]
    return min(good, key=lambda e: e.objective, default=None)


def resample(problem: Problem, evaluation: Evaluation, rate: float) -> Resampled:
    """The motion at `rate` [Hz], its last sample at exactly T."""
    spline = curve(problem, evaluation.time, evaluation.q, evaluation.solution.trajectory.ends)
    everything = whole(problem, evaluation.solution.trajectory)
    duration = float(evaluation.time[-1])
    time = np.append(np.arange(0.0, duration - 1e-9, 1.0 / rate), duration)
    q, qd, qdd = spline(time), spline(time, 1), spline(time, 2)
    knots = evaluation.time
    fine = np.interp(np.arange(BETWEEN * (len(knots) - 1) + 1) / BETWEEN, np.arange(len(knots)), knots)
    judged = np.union1d(time, fine)  # a slow rate must not hide what happens between its samples
    checked = audit(problem, judged, everything(judged), *(everything(judged, order) for order in (1, 2, 3)))
    names = problem.task.arm.description.joints
    worst = {kind: (float(judged[row]), names[joint]) for kind, (row, joint) in checked.worst.items()}
    return Resampled(
        evaluation.method,
        evaluation.solution.optimum,
        time,
        q,
        qd,
        qdd,
        checked.tracking_error,
        checked.orientation_error,
        checked.limit_excess,
        worst,
    )


def sentence(exported: Resampled) -> str:
    """What a person who sends the motion to a robot must know."""
    step = exported.time[1] - exported.time[0]
    head = f"{exported.method} {exported.optimum} at {1 / step:.4g} Hz"
    head += f" is at most {exported.tracking_error:.2g} m off its path"
    if exported.orientation_error > 0:
        head += f" and {exported.orientation_error:.2g} rad off its orientation"
    over = [(kind, excess) for kind, excess in exported.limit_excess.items() if excess > TOLERANCE]
    if not exported.limit_excess:
        return f"{head}; the run has no limits to check it against"
    if not over:
        return f"{head} and meets every limit"
    parts = []
    for kind, excess in over:
        time, joint = exported.worst[kind]
        whose = f" of {joint}" if kind != "clearance" else ""
        parts.append(f"exceeds the {kind} limit{whose} by {100 * excess:.3g} % at t = {time:.3g} s")
    return (
        f"{head}, but {' and '.join(parts)}; where the knots keep their limits, the curve between them, which starts "
        "and ends at rest, asks for more: more intervals (timing.steps) or tighter limits give room"
    )
