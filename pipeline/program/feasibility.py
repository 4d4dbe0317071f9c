"""Why no feasible motion was found: the limit that no attempt keeps, and the least violation found."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from pipeline.common.arrays import Array
from pipeline.model.clearance import Clearance
from pipeline.problem.costs import integrals, velocities
from pipeline.problem.problem import Problem
from pipeline.program.transcription import transcribe

UNITS = {
    **{"position": "rad", "velocity": "rad/s", "acceleration": "rad/s^2", "jerk": "rad/s^3"},
    **{"torque": "N m", "power": "W", "clearance": "m", "self_clearance": "m", "attitude": "rad"},
    **{"tolerance": "m", "orientation_tolerance": "rad", "tool_speed": "m/s", "tool_acceleration": "m/s^2"},
}


@dataclass(frozen=True)
class Violation:
    """The limit that a motion exceeds most, relative to its size."""

    kind: str
    joint: str
    limit: float
    reached: float
    time: float
    relative: float

    @property
    def bound(self) -> str:
        return f"the {self.kind.replace('_', ' ')} limit of {self.joint} ({self.limit:.4g} {UNITS[self.kind]})"

    @property
    def extent(self) -> str:
        percent = f"{100 * self.relative:.0f}" if self.relative > 0.1 else f"{100 * self.relative:.2g}"
        return f"{percent} % ({self.reached:.4g} {UNITS[self.kind]} at t = {self.time:.3g} s)"


def violations(problem: Problem, times: Array, q: Array) -> list[Violation]:
    """For each kind of limit, the worst knot and joint of the motion q (N + 1, n); `relative` <= 0 if it is kept."""
    limits, names = problem.bounds, problem.task.arm.description.joints
    qd = velocities(problem, times, q)
    tau = integrals(problem, times, q).tau
    half = np.where(np.isfinite(limits.upper - limits.lower), (limits.upper - limits.lower) / 2, 1.0)
    found = []
    for side, bound in (("upper", limits.upper), ("lower", limits.lower)):
        sign = 1.0 if side == "upper" else -1.0
        found.append(_worst("position", names, times, sign * q, sign * bound, half, sign))
    for kind, values, bound in (
        ("velocity", np.abs(qd), limits.velocity),
        ("torque", np.abs(tau), limits.torque),
        ("power", np.abs(tau * qd), limits.power),
    ):
        found.append(_worst(kind, names, times, values, bound, bound, 1.0))
    found.append(_turned(problem, times, q))
    if problem.keeps_clear:
        found += _closest(problem, times, q)
    return [violation for violation in found if violation is not None]


def _turned(problem: Problem, times: Array, q: Array) -> Violation | None:
    arm, bound = problem.task.arm, problem.bounds.attitude
    if not np.isfinite(bound):
        return None
    angle = np.arccos(np.clip(arm.base.attitude_cosine(q)[0], -1.0, 1.0))
    knot = int(np.argmax(angle))
    return Violation(
        "attitude", "the base", bound, float(angle[knot]), float(times[knot]), float(angle[knot] / bound - 1)
    )


def _closest(problem: Problem, times: Array, q: Array) -> list[Violation]:
    clearance, found = Clearance(problem.task.arm, problem.obstacles, problem.own), []
    for of_kind in zip(*map(clearance.closest, q), strict=True):
        knot = int(np.argmin([close.distance for close in of_kind]))
        close = of_kind[knot]
        excess, whose = (close.margin - close.distance) / close.margin, f"{close.first} from {close.second}"
        found.append(Violation(close.kind, whose, close.margin, close.distance, float(times[knot]), excess))
    return found


def _worst(
    kind: str, names: tuple[str, ...], times: Array, values: Array, bound: Array, size: Array, sign: float
) -> Violation | None:
    if not np.isfinite(bound).any():
        return None
    excess = np.where(np.isfinite(bound), (values - bound) / np.where(np.isfinite(size), size, 1.0), -np.inf)
    knot, joint = np.unravel_index(int(np.argmax(excess)), excess.shape)
    reached, limit = sign * values[knot, joint], sign * bound[joint]
    return Violation(kind, names[joint], float(limit), float(reached), float(times[knot]), float(excess[knot, joint]))


@dataclass(frozen=True)
class Relaxed:
    """A motion q (N + 1, n) on the path that exceeds its limits as little as could be found, and the worst of them.

    starts: from how many motions it was sought. Local optima all: a sentence on them is no proof that no motion exists.
    """

    q: Array
    worst: Violation
    starts: int

    @property
    def feasible(self) -> bool:
        return self.worst.relative <= 1e-6

    @property
    def sentence(self) -> str:
        tried = "the one attempt" if self.starts == 1 else f"none of {self.starts} attempts"
        keeps = "does not keep" if self.starts == 1 else "keeps"
        return (
            f"{tried} to exceed the limits as little as possible {keeps} {self.worst.bound}; "
            f"the least violation found is {self.worst.extent}"
        )


def least_violation(problem: Problem, times: Array, guesses: list[Array]) -> Relaxed | None:
    """The limit to blame: the kind that, given way alone, lets a motion be found with the least excess.

    If no kind suffices alone, all give way together. None if no solve succeeds. A motion without any excess is
    feasible: the way to it led through motions that are not, which other solves do not dare.
    """
    if not guesses:
        return None
    kinds = list(dict.fromkeys(violation.kind for violation in violations(problem, times, guesses[0])))
    best: Relaxed | None = None
    for kind in kinds:
        found = _relaxed(problem, times, guesses, [kind])
        if found is not None and (best is None or found.worst.relative < best.worst.relative):
            best = found
        if best is not None and best.feasible:
            return best
    if best is None and len(kinds) > 1:
        return _relaxed(problem, times, guesses, kinds)
    return best


def _relaxed(problem: Problem, times: Array, guesses: list[Array], kinds: list[str]) -> Relaxed | None:
    best: Relaxed | None = None
    for guess in guesses:
        q, outcome, _ = transcribe(problem, times, guess, elastic=kinds).solve(tolerance=1e-6, max_iterations=150)
        gap = np.abs(problem.task.error(q, problem.reference.position(times))).max()
        if not outcome.converged or gap > 1e-6:
            continue
        worst = max(
            (violation for violation in violations(problem, times, q) if violation.kind in kinds),
            key=lambda violation: violation.relative,
        )
        if best is None or worst.relative < best.worst.relative:
            best = Relaxed(q, worst, len(guesses))
    return best
