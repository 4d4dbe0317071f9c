"""By how much a motion exceeds each kind of limit, relative to its size."""

from __future__ import annotations

import numpy as np

from pipeline.common.arrays import Array
from pipeline.problem.problem import Problem

LIMITS = 1e-6  # relative: how well a method that promises limits must keep them at its knots
STILL = np.zeros(1)


def limit_excess(
    problem: Problem,
    q: Array,
    qd: Array,
    tau: Array,
    clearance: float = np.inf,
    turn: float = 0.0,
    *,
    own: float = np.inf,
    qdd: Array = STILL,
    jerk: Array = STILL,
    pace: Array | None = None,
) -> dict[str, float]:
    """By how much each kind of limit is exceeded, relative to its size (positions: to half the range; clearances: to
    the margin); <= 0 if kept. clearance, own [m]: from obstacles, of the arm from itself. turn [rad]: of the base from
    its start; pace (K, 2): of the tool, [m/s] and [m/s^2].
    """
    limited = problem.constrained or problem.keeps_clear or problem.bounds.limits_tool
    if not limited or not np.all(np.isfinite(q)):
        return {}
    found = {kind: float(excess.max()) for kind, excess in excesses(problem, q, qd, tau, qdd, jerk).items()}
    if problem.obstacles is not None:
        found["clearance"] = 1 - clearance / problem.obstacles.margin
    if problem.own is not None and problem.own.kept:
        found["self_clearance"] = 1 - own / problem.own.margin
    if np.isfinite(problem.bounds.attitude):
        found["attitude"] = turn / problem.bounds.attitude - 1
    return found | {kind: float(excess.max()) for kind, excess in of_tool(problem, pace).items()}


def of_tool(problem: Problem, pace: Array | None) -> dict[str, Array]:
    """The same (K,) of the limits of its pace (K, 2), where it has any."""
    bounds = {"tool_speed": problem.bounds.tool_speed, "tool_acceleration": problem.bounds.tool_acceleration}
    limited = {kind: (own, bound) for own, (kind, bound) in enumerate(bounds.items()) if np.isfinite(bound)}
    return {} if pace is None else {kind: pace[:, own] / bound - 1 for kind, (own, bound) in limited.items()}


def excesses(
    problem: Problem, q: Array, qd: Array, tau: Array, qdd: Array = STILL, jerk: Array = STILL
) -> dict[str, Array]:
    """The same (K, n) for every sample and joint, of the kinds that are limited."""
    limits = problem.bounds
    half = np.where(np.isfinite(limits.upper - limits.lower), (limits.upper - limits.lower) / 2, 1.0)
    kinds = {
        "position": (np.maximum(q - limits.upper, limits.lower - q) / half, np.minimum(-limits.lower, limits.upper)),
        "velocity": (np.abs(qd) / limits.velocity - 1, limits.velocity),
        "acceleration": (np.abs(qdd) / limits.acceleration - 1, limits.acceleration),
        "jerk": (np.abs(jerk) / limits.jerk - 1, limits.jerk),
        "torque": (np.abs(tau) / limits.torque - 1, limits.torque),
        "power": (np.abs(tau * qd) / limits.power - 1, limits.power),
    }
    limited = {kind: excess for kind, (excess, bound) in kinds.items() if np.isfinite(bound).any()}
    return {kind: np.broadcast_to(excess, q.shape) for kind, excess in limited.items()}
