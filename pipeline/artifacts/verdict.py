"""The verdict on a run: which motion to send and why it can be trusted, or why there is none."""

from __future__ import annotations

import numpy as np

from pipeline.artifacts.bands import bands, closest
from pipeline.artifacts.report import Report
from pipeline.evaluation.evaluation import Evaluation
from pipeline.methods.registry import METHODS
from pipeline.problem.problem import Problem
from pipeline.problem.solution import Status
from pipeline.studies.estimate import Estimate
from pipeline.studies.export import TOLERANCE, Nothing, Resampled, as_shown

BASELINES = ("lsv", "inertia_weighted")
COSTS = {"kinetic_energy": "energy", "torque": "squared torque"}  # what is saved, by the integral


def sent(report: Report) -> Evaluation | None:
    """The motion that is exported."""
    exported = report.find(Resampled)
    return next((e for e in report.motions.evaluations if exported and exported.is_of(e)), None)


def first(report: Report) -> Evaluation | None:
    """The motion to look at first: that to send, else the cheapest within its limits; None if no method found any."""
    solved = sorted(report.motions.solved, key=lambda e: (bool(exceeded(e)), as_shown(e)))
    found = [e for e in report.motions.evaluations if e.solution.found]
    return sent(report) or next(iter([*solved, *found]), None)


def verdict(report: Report) -> str:
    """One paragraph."""
    motion, exported, refused = first(report), report.find(Resampled), report.find(Nothing)
    if motion is None or motion.status is not Status.SOLVED:
        return f"Nothing to send: {'; '.join(f'{called(e)} is {status(e)}' for e in report.motions.evaluations)}."
    if motion.solution.stretch is not None:
        return _pieces(report)
    reasons = f"{_reasons(report, motion)}."
    if exported is not None and exported.faults:
        return f"Not to be sent, though exported: {called(motion)} {exported.fault}. {called(motion)}: {reasons}"
    if exported is not None:
        return f"Send {called(motion)}: {reasons}{_passed(report, exported)}"
    if refused is not None and refused.refused:
        fault = next(one.fault for one in refused.refused if one.is_of(motion))
        return (
            f"Nothing to send: {called(motion)}, the best found, {fault}. {refused.instead}{called(motion)}: {reasons}"
        )
    return f"Best found: {called(motion)}: {reasons}"


def _passed(report: Report, exported: Resampled) -> str:
    """The best motion, where a dearer one is sent: why not that one, and what to do."""
    if not exported.before:
        return ""
    best = next(e for e in report.motions.evaluations if exported.before[0].is_of(e))
    sent_one = next(e for e in report.motions.evaluations if exported.is_of(e))
    problem = report.motions.problem
    less = f"{percent(saving(problem, best, sent_one))} % less {COSTS.get(weighs(problem), 'of the objective')}"
    return f" {called(best)} would take {less}, but {exported.before[0].fault}. {exported.instead}".rstrip()


def _pieces(report: Report) -> str:
    """Of a path that was cut: how many pieces there are, and which of them were not found."""
    pieces = [e for e in report.motions.evaluations if e.solution.stretch is not None]
    bad = [f"{called(e)} is {status(e)}" for e in pieces if status(e) != Status.SOLVED.word]
    most = max(e.tracking_error_between for e in pieces)
    found = f"Best found: {len(pieces)} pieces, run one after the other with the transits between them (program.csv)"
    if len(pieces) == 1:
        found = "Best found: the whole path in one piece (program.csv)"
    return f"{'; '.join([found, f'path error {most:.1g} m', *bad])}."


def called(e: Evaluation) -> str:
    """`global 1`, the first optimum with its number too."""
    return f"{e.method} {e.solution.optimum}"


def status(e: Evaluation) -> str:
    """How a motion ended; `solved` alone is not said of one that a robot could not make."""
    if e.status is not Status.SOLVED:
        return e.status.word
    beyond = exceeded(e)
    return f"{e.status.word}, exceeds {', '.join(beyond)}" if beyond else e.status.word


def exceeded(e: Evaluation) -> list[str]:
    """The kinds of limits that a motion exceeds, at its knots or between them."""
    kinds = dict.fromkeys([*e.limit_excess, *e.limit_excess_between])
    return [
        kind for kind in kinds if max(e.limit_excess.get(kind, 0.0), e.limit_excess_between.get(kind, 0.0)) > TOLERANCE
    ]


def baseline(report: Report) -> Evaluation | None:
    """The pseudoinverse's motion that the others are held against, if one is confirmed from end to end."""
    return next((found for name in BASELINES if (found := report.motions.best(name)) is not None), None)


def saving(problem: Problem, e: Evaluation, against: Evaluation) -> float:
    """By how much `e` costs less than another motion, relative; of the integral that weighs in the objective."""
    own, other = (motion.integral(weighs(problem)) for motion in (e, against))
    return 1 - own / other if other > 0 else 0.0


def percent(share: float) -> str:
    """A share in percent, with two digits or all before the point."""
    return f"{100 * share:.0f}" if abs(share) >= 0.995 else f"{100 * share:.2g}"


def weighs(problem: Problem) -> str:
    """The integral that is minimised, or the kinetic energy where several or other things are."""
    names = [name for name, weight in problem.objective.weights.items() if weight]
    return names[0] if len(names) == 1 else "kinetic_energy"


def _reasons(report: Report, e: Evaluation) -> str:
    problem = report.motions.problem
    parts = [part for part in (_against(report, e), _limits(problem, e)) if part]
    if problem.obstacles is not None:
        parts.append(f"clearance {1000 * min(e.clearance.min(), e.clearance_between):.3g} mm")
    band = next(band for band in bands(problem) if band.kind == "acceleration")
    worst = int(np.nanmax(np.abs(e.qdd), axis=0).argmax())
    parts.append(f"peak acceleration {np.nanmax(np.abs(e.qdd[:, worst])):.3g} {band.units[worst]}")
    parts.append(f"path error {e.tracking_error_between:.1g} m")
    if e.orientation_error_between > 0:
        parts[-1] += f" and {e.orientation_error_between:.1g} rad"
    if not problem.reference.timing.at_rest:  # such a path asks for it; the robot has to be brought there
        joint, arm = int(np.abs(e.qd[0]).argmax()), problem.task.arm.description
        parts.append(f"begins at speed ({arm.actuated[joint]} at {abs(e.qd[0, joint]):.3g} {arm.unit(joint)}/s)")
    own = e.near.own
    if np.isfinite(own.bound):
        parts.append(f"clear of itself by {1000 * own.bound:.3g} mm ({own.first} and {own.second})")
    unchecked = [] if problem.own is not None and not problem.own.unknown else ["self-collision"]
    if problem.obstacles is None:
        unchecked.append("obstacles (none given)")
    if not problem.bounds.any:
        unchecked.append("limits (none given)")
    known, broken = _confirmed(report, e), _singular(report)
    left = f"not checked: {', '.join(unchecked)}" if unchecked else ""
    return "; ".join(filter(None, [", ".join(parts), known, broken, left]))


def _against(report: Report, e: Evaluation) -> str:
    other, problem = baseline(report), report.motions.problem
    if other is None or other is e:
        return ""
    saved, what = saving(problem, e, other), COSTS.get(weighs(problem), f"of the {weighs(problem)} integral")
    share = f"{percent(abs(saved))} % {'less' if saved >= 0 else 'more'} {what} than {METHODS[other.method].title}"
    beyond = exceeded(other)
    return share + (f" (which exceeds {', '.join(beyond)})" if beyond else "")


def _singular(report: Report) -> str:
    """The pseudoinverse's fate, where it leaves nothing to be held against."""
    broken = next((e for e in report.motions.evaluations if e.solution.event_time is not None), None)
    if broken is None or baseline(report) is not None:
        return ""
    return f"{METHODS[broken.method].title} is singular at {broken.solution.event_time:.2f} s"


def _limits(problem: Problem, e: Evaluation) -> str:
    near, beyond = closest(problem, e), ", ".join(exceeded(e))
    kept = f"exceeds {beyond}" if beyond else "keeps every limit" if problem.bounds.any else ""
    return f"{kept} (closest: {near.said})" if near is not None else kept


def _confirmed(report: Report, e: Evaluation) -> str:
    """By whom: IPOPT, and searches of other kinds beside it."""
    said = ["confirmed by IPOPT"] if "confirmed by IPOPT" in e.solution.evidence else []
    estimate = report.find(Estimate)
    for one in estimate.comparisons if estimate is not None and e.method == "global" else ():
        if one.same_as == e.solution.optimum and not one.gone_on:
            said.append(f"{one.method.replace('_', ' ')} leads there too")
    return ", ".join(said)
