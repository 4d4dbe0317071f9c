"""A motion at the rate of a controller: a smooth curve through its knots, its exact derivatives, and what it keeps."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any, ClassVar

import numpy as np

from pipeline.build.rest import suggested, unlimited_start
from pipeline.common.arrays import Array
from pipeline.config.options import options
from pipeline.evaluation.between import Audit, audit
from pipeline.evaluation.evaluation import Evaluation
from pipeline.problem.curve import curve, end_speeds, turns_of_cycle, whole
from pipeline.problem.problem import Boundary, Problem
from pipeline.problem.turns import full_turns
from pipeline.program.spline.program import why_not as unserved
from pipeline.studies.study import Motions, Result

TOLERANCE = 1e-6  # relative: of limits that are met
RESTS = 0.01  # of the largest joint speed: what still counts as rest
NAMED = 3  # motions whose faults are said
SENDABLE = "_sendable"  # ends the name of the experiment that makes of another one a motion that can be sent
BETWEEN = 4  # sub-intervals per knot interval at which the curve is judged, besides its samples


@dataclass(frozen=True)
class Resampled(Result):
    """Samples at time (K,) [s]: q, qd, qdd (K, n); and what the evaluation's own plant says of their curve.

    limit_excess: by kind, relative (see evaluation.limit_excess); worst: where each is largest, (time [s], joint).
    faults: why it cannot be sent; none if it can. strays: whether one of them is its distance from the path.
    before: cheaper motions that cannot be sent; instead: what would make one of them that can, in sentences.
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
    faults: tuple[str, ...] = ()
    strays: bool = False
    before: tuple[Resampled, ...] = ()
    instead: str = ""

    def is_of(self, motion: Evaluation) -> bool:
        """Whether these are the samples of that motion."""
        return (self.method, self.optimum) == (motion.method, motion.solution.optimum)

    @property
    def fault(self) -> str:
        """The first of its faults in one sentence."""
        more = len(self.faults) - NAMED
        return " and ".join([*self.faults[:NAMED], *([f"has {more} more fault{'s' * (more > 1)}"] if more > 0 else [])])

    @property
    def keeps_limits(self) -> bool:
        return all(excess <= TOLERANCE for excess in self.limit_excess.values())

    def section(self) -> list[str]:
        return [f"Exported: {sentence(self)}."]

    def said(self) -> list[str]:
        return self.section()

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
            "faults": list(self.faults),
        }


@dataclass(frozen=True)
class Nothing(Result):
    """No motion is good enough to be sent. refused: those that were looked at, the cheapest first; instead: what to
    do, in sentences.
    """

    name: ClassVar[str] = "export"
    refused: tuple[Resampled, ...] = ()
    instead: str = ""

    def section(self) -> list[str]:
        if not self.refused:
            return ["Exported: nothing, since no motion is confirmed."]
        named = [f"{motion.method} {motion.optimum} {motion.fault}" for motion in self.refused[:NAMED]]
        more = len(self.refused) - len(named)
        others = f"; so it is with {more} more" if more else ""
        return [
            f"Exported: nothing, since no confirmed motion can be sent: {'; '.join(named)}{others}. {self.instead}"
            "export.force=true writes the cheapest all the same."
        ]

    def facts(self) -> Mapping[str, Any]:
        return {"refused": {f"{motion.method} {motion.optimum}": list(motion.faults) for motion in self.refused}}


def study(motions: Motions) -> Result | None:
    """The motion that is to be exported, resampled; None if none is asked for, or the method asked for has none."""
    asked = motions.config.export.method
    if any(e.solution.stretch is not None for e in motions.evaluations) and motions.methods == {"segments"}:
        return None  # pieces are sent with their transits (`pieces.py`)
    sent, refused = _sent(motions)
    if sent is not None:
        passed = () if sent[1].faults else refused
        return replace(sent[1], before=passed, instead=instead(motions, passed) if passed else "")
    return Nothing(refused, instead(motions, refused)) if refused or asked == "best" else None


def instead(motions: Motions, refused: Sequence[Resampled]) -> str:
    """What makes a motion that can be sent of this problem, in sentences: words for the command line."""
    problem, said = motions.problem, []
    if not all(problem.rest) and problem.reference.timing.at_rest and unserved(problem) is None:
        words = ["boundary.rest=[start,end]"]
        if unlimited_start(problem) and motions.config.robot.limits is None:
            words.append(f"limits.acceleration={suggested(problem):g}")
        own = f"{motions.config.name}{SENDABLE}"
        shipped = f", and so does +experiment={own}" * (own in options("experiment"))
        said.append(f"{' '.join(words)} makes the planner seek one that can be{shipped}.")
    elif not any(problem.rest) and unserved(problem) is None and not all(motion.keeps_limits for motion in refused):
        said.append("method.global.transcription=spline keeps the limits between the knots too.")
    elif not all(problem.rest) and (why := unserved(problem)):
        said.append(f"No start from rest is sought where {why}.")
    for motion in refused:
        off = float(f"{1.1 * motion.tracking_error:.1e}")
        if len(motion.faults) == 1 and motion.strays:
            said.append(f"path.tolerance={off:g} lets {motion.method} {motion.optimum} through.")
            break
    return "".join(f"{one} " for one in said)


def chosen(motions: Motions) -> Evaluation | None:
    """The motion to export; None if none can be sent, or none is asked for."""
    sent = _sent(motions)[0]
    return None if sent is None else sent[0]


def _sent(motions: Motions) -> tuple[tuple[Evaluation, Resampled] | None, tuple[Resampled, ...]]:
    """The cheapest confirmed motion, by the problem's own objective, that can be sent; and those before it.

    A method that knows no limits may go cheaply through a wall, and an optimum by differences may jump to its speed.
    """
    config = motions.config.export
    refused: list[Resampled] = []
    good = sorted(
        (e for e in motions.solved if e.solution.stretch is None and config.method in ("best", e.method)),
        key=as_shown,
    )
    for motion in good:
        found = resample(motion.solution.posed(motions.problem), motion, config.rate)
        if not found.faults:
            return (motion, found), tuple(refused)
        refused.append(found)
    return (good[0], refused[0]) if refused and config.force else None, tuple(refused)


def as_shown(motion: Evaluation) -> float:
    """The objective to the four digits that tables show: of motions that are equal there the first listed is best."""
    return float(f"{motion.objective:.4g}")


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
    checked = audit(problem, everything, knots, judged)
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
        tuple(_faults(problem, evaluation, checked, worst)),
        checked.tracking_error > problem.reference.tolerance,
    )


def _faults(
    problem: Problem, evaluation: Evaluation, checked: Audit, worst: Mapping[str, tuple[float, str]]
) -> list[str]:
    """Why a motion cannot be sent, as the rest of a sentence that begins with its name."""
    faults, reference, description = [], problem.reference, problem.task.arm.description
    names = description.actuated
    speeds, most = np.abs(end_speeds(problem, evaluation.solution.trajectory)), float(np.abs(evaluation.qd).max())
    for speed, said in zip(speeds, ("starts with a jump of velocity", "ends while it moves"), strict=True):
        joint = int(speed.argmax())
        if speed[joint] > RESTS * most:
            faults.append(f"{said} ({names[joint]} at {speed[joint]:.3g} {description.unit(joint)}/s)")
    joints = evaluation.q
    if problem.boundary is Boundary.CYCLIC and turns_of_cycle(problem, joints) is None:
        apart = np.abs(joints[-1] - joints[0] - full_turns(problem, joints[0], joints[-1]))
        joint = int(apart.argmax())
        gap = f"{apart[joint]:.3g} {description.unit(joint)}"
        faults.append(f"is no cycle ({names[joint]} ends {gap} from where it began)")
    for kind, excess in checked.limit_excess.items():
        if excess > TOLERANCE:
            time, joint_name = worst[kind]
            whose = "" if kind.endswith("clearance") else f" of {joint_name}"
            faults.append(f"exceeds the {kind} limit{whose} by {100 * excess:.3g} % at t = {time:.3g} s")
    for error, allowed, unit, key in (
        (checked.tracking_error, reference.tolerance, "m", "tolerance"),
        (checked.orientation_error, reference.orientation_tolerance, "rad", "orientation_tolerance"),
    ):
        if not error <= allowed * (1 + TOLERANCE):
            faults.append(f"is up to {error:.2g} {unit} off its path, more than path.{key} = {allowed:g} {unit}")
    return faults


def sentence(exported: Resampled) -> str:
    """What a person who sends the motion to a robot must know."""
    step = exported.time[1] - exported.time[0]
    head = f"{exported.method} {exported.optimum} at {1 / step:.4g} Hz"
    head += f" is at most {exported.tracking_error:.2g} m off its path"
    if exported.orientation_error > 0:
        head += f" and {exported.orientation_error:.2g} rad off its orientation"
    if exported.faults:
        return f"{head}, but it {exported.fault}: not to be sent as it is"
    if not exported.limit_excess:
        return f"{head}; the run has no limits to check it against"
    return f"{head} and meets every limit"
