"""Why a problem has no feasible motion: the limit that cannot be met, and the least violation found."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from pipeline.arrays import Array
from pipeline.costs import integrals, velocities
from pipeline.problem import Problem
from pipeline.transcription import Transcription

UNITS = {"position": "rad", "velocity": "rad/s", "torque": "N m", "power": "W"}


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
    def sentence(self) -> str:
        unit = UNITS[self.kind]
        return (
            f"no feasible motion: the {self.kind} limit of {self.joint} ({self.limit:.4g} {unit}) cannot be met; the least "
            f"violation found is {100 * self.relative:.2g} % ({self.reached:.4g} {unit} at t = {self.time:.3g} s)"
        )


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
    return [violation for violation in found if violation is not None]


def _worst(
    kind: str, names: tuple[str, ...], times: Array, values: Array, bound: Array, size: Array, sign: float
) -> Violation | None:
    if not np.isfinite(bound).any():
        return None
    excess = np.where(np.isfinite(bound), (values - bound) / np.where(np.isfinite(size), size, 1.0), -np.inf)
    knot, joint = np.unravel_index(int(np.argmax(excess)), excess.shape)
    reached, limit = sign * values[knot, joint], sign * bound[joint]
    return Violation(kind, names[joint], float(limit), float(reached), float(times[knot]), float(excess[knot, joint]))


def least_violation(problem: Problem, times: Array, guesses: list[Array]) -> Violation | None:
    """Let all limits give way by the same fraction and minimise it, from several motions; None if no solve succeeds."""
    best: Violation | None = None
    for guess in guesses:
        q, outcome, _ = Transcription(problem, times, guess, elastic=True).solve(tolerance=1e-6, max_iterations=300)
        gap = np.abs(problem.task.value(q) - problem.reference.position(times)).max()
        if not outcome.converged or gap > 1e-6:
            continue
        worst = max(violations(problem, times, q), key=lambda violation: violation.relative)
        if best is None or worst.relative < best.relative:
            best = worst
    return best
