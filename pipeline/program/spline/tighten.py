"""By how much a spline exceeds limits between its knots, and limits at the knots that prevent it."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np
from scipy.ndimage import maximum_filter1d

from pipeline.common.arrays import Array
from pipeline.problem.problem import Problem
from pipeline.program.feasibility import Violation
from pipeline.program.spline.curve import Curve
from pipeline.program.spline.program import Solved, Tightened
from pipeline.program.spline.transcription import transcribe
from pipeline.program.terms.tracking import INSIDE

BETWEEN = 10  # points per interval


ROUNDS = 8


FORCES = ("torque", "power")
OF_TOOL = ("tolerance", "orientation_tolerance", "tool_speed", "tool_acceleration")


MARGIN = 1e-4  # relative, on what is tightened


NEAR = 10  # a tenth of the intervals on either side gives way with one in which the tool exceeds a limit


KEPT = 1e-7  # relative: excess that is none


ROOM = 1e-3  # relative, to a torque limit that may be left out


def sampled(times: Array, between: int = BETWEEN) -> Array:
    """So many points per interval, the knots among them: (between N + 1,)."""
    return np.interp(np.arange(between * (len(times) - 1) + 1) / between, np.arange(len(times)), times)


def excesses(problem: Problem, curve: Curve) -> dict[str, Array]:
    """By how much each kind of limit is exceeded (K, n) at the `sampled` times, relative to it; <= 0 where it is kept.

    Those of the tool (K, 1), those of position relative to half the range. The jerk, constant in an interval, is that
    before each sample.
    """
    bounds, moments = problem.bounds, sampled(curve.times)
    q, v, a = curve(moments), curve(moments, 1), curve(moments, 2)
    half = np.where(np.isfinite(bounds.upper - bounds.lower), (bounds.upper - bounds.lower) / 2, 1.0)
    found = {}
    if np.isfinite(bounds.upper).any() or np.isfinite(bounds.lower).any():
        found["position"] = np.maximum(q - bounds.upper, bounds.lower - q) / half
    if np.isfinite(bounds.torque).any() or np.isfinite(bounds.power).any():
        tau = np.abs(problem.task.arm.inverse_dynamics(q, v, a))
        found |= {"torque": tau / bounds.torque - 1, "power": tau * np.abs(v) / bounds.power - 1}
    jerk = np.repeat(np.diff(curve.a, axis=0) / np.diff(curve.times)[:, None], BETWEEN, axis=0)
    found |= {"velocity": np.abs(v) / bounds.velocity - 1, "acceleration": np.abs(a) / bounds.acceleration - 1}
    found["jerk"] = np.abs(np.vstack([jerk[:1], jerk])) / bounds.jerk - 1
    found |= _off_path(problem, moments, q) | _pace(problem, q, v, a)
    return {kind: excess for kind, excess in found.items() if excess.max() > -1.0}


def _off_path(problem: Problem, moments: Array, q: Array) -> dict[str, Any]:
    """By how much a path's tolerances, less what the walls of its tube leave of them, are exceeded where it need not be
    kept exactly, each (K, 1).
    """
    reference = problem.reference
    if reference.exact:
        return {}
    error, count = problem.task.error(q, reference.position(moments)), len(problem.task.axes)
    kinds = {"tolerance": error[:, :count], "orientation_tolerance": error[:, count:]}
    return {
        kind: peaks(moments, np.linalg.norm(part, axis=1))[:, None] / (allowed * (1 - INSIDE)) - 1
        for (kind, part), allowed in zip(kinds.items(), reference.tolerances, strict=True)
        if part.size
    }


def peaks(moments: Array, values: Array) -> Array:
    """The values (K,); those that their neighbours do not exceed, as the peak of the parabola through all three."""
    h, slopes = np.diff(moments), np.diff(values) / np.diff(moments)
    bend = np.diff(slopes) / (h[:-1] + h[1:])
    slope = (slopes[:-1] * h[1:] + slopes[1:] * h[:-1]) / (h[:-1] + h[1:])
    highest = (slopes[:-1] >= 0) & (slopes[1:] <= 0) & (bend < 0)
    found = values.copy()
    found[1:-1][highest] -= slope[highest] ** 2 / (4 * bend[highest])
    return found


def _pace(problem: Problem, q: Array, v: Array, a: Array) -> dict[str, Any]:
    """The same of the tool's speed and acceleration."""
    bounds, task = problem.bounds, problem.task
    if not bounds.limits_tool:
        return {}
    jacobian, rows = task.arm.jacobian(q)[:, task.rows], task.arm.jacobian_rate_term(q, v)[:, task.rows]
    speed, acceleration = np.einsum("kij,kj->ki", jacobian, v), np.einsum("kij,kj->ki", jacobian, a) + rows
    return {
        "tool_speed": np.linalg.norm(speed, axis=1, keepdims=True) / bounds.tool_speed - 1,
        "tool_acceleration": np.linalg.norm(acceleration, axis=1, keepdims=True) / bounds.tool_acceleration - 1,
    }


def worst(problem: Problem, curve: Curve) -> Violation | None:
    """The limit that a spline exceeds most, relative to its size; None if there are none."""
    found = excesses(problem, curve)
    if not found:
        return None
    kind = max(found, key=lambda name: float(found[name].max()))
    sample, joint = np.unravel_index(int(found[kind].argmax()), found[kind].shape)
    moments, relative = sampled(curve.times), float(found[kind][sample, joint])
    bounds, name = problem.bounds, problem.task.arm.description.joints[joint]
    if kind == "position":
        reached = float(curve(moments[sample : sample + 1])[0, joint])
        limit = float(bounds.upper[joint] if reached > bounds.lower[joint] else bounds.lower[joint])
    elif kind in OF_TOOL:
        own = problem.reference if kind.endswith("tolerance") else bounds
        limit, name = float(getattr(own, kind)), "the end effector"
        reached = limit * (1 + relative)
    else:
        limit = float(np.broadcast_to(getattr(bounds, kind), problem.task.arm.n)[joint])
        reached = limit * (1 + relative)
    return Violation(kind, name, limit, reached, float(moments[sample]), relative)


def keeps_forces(problem: Problem, curve: Curve, room: float = ROOM) -> bool:
    """Whether torque and power limits are kept with some room: an optimum without them is then one with them."""
    found = excesses(problem, curve)
    return all(float(found[kind].max()) < -room for kind in ("torque", "power") if kind in found)


def without_forces(problem: Problem) -> Problem:
    """The problem without limits of torque and power."""
    free = np.full(problem.task.arm.n, np.inf)
    return replace(problem, limits=replace(problem.bounds, torque=free, power=free))


Short = Callable[[Problem, Curve], float]  # how far [m] a spline comes within the margins that it has to keep


def tighten(
    problem: Problem, first: Solved, short: Short, begin: Curve | None = None, **options: object
) -> tuple[Solved, list[Solved]]:
    """The optimum that keeps its limits between the knots as well as at them, and all solves after the first.

    Where a limit is exceeded in an interval its bounds at both knots are divided by that excess and a little more; from
    round to round by more of it, since what lies between two knots may give way by less than they do. Of the shortest
    motion the time changes with them. Limits of torque and power that the first solve left out stay out while they are
    kept. begin: where `first` came from, on its knots; what comes too near to something is
    solved again from there: from where it touches IPOPT may be long in finding another way round.
    """
    solved, further, tightened = first, [], Tightened.none(problem, first.curve.times)
    for count in range(ROUNDS):
        posed, curve = solved.timed(problem).slowed(solved.stretch), solved.curve.stretched(solved.stretch)
        lacking = short(posed, curve)
        stricter = _stricter(posed, curve, tightened, 1.0 + count, lacking)
        if stricter is None or not solved.outcome.converged:
            break
        tightened = stricter
        stretch = 0.0 if solved.program.stretch is None else solved.stretch
        start = begin if lacking and begin is not None else solved.curve
        lazy = not solved.program.forces and keeps_forces(posed, curve)
        again = without_forces(solved.timed(problem)) if lazy else solved.timed(problem)
        solved = transcribe(again, start, tightened, stretch=stretch, prices=solved.program.prices).solve(**options)
        further.append(solved)
    return solved, further


def _stricter(problem: Problem, curve: Curve, tightened: Tightened, gain: float, lacking: float) -> Tightened | None:
    """Limits at the knots that leave out what this spline exceeds between them; None if it does not."""
    found = excesses(problem, curve)
    factors = {}
    for kind in FORCES + OF_TOOL:
        factors[kind] = own = getattr(tightened, kind).copy()
        if kind in found:
            beyond = np.maximum(found[kind], 0.0)
            inner = np.lib.stride_tricks.sliding_window_view(beyond, BETWEEN + 1, axis=0)[::BETWEEN].max(axis=-1)
            inner = np.where(inner > KEPT, gain * inner + MARGIN, 0.0)
            if kind in OF_TOOL:  # else the excess moves on to where the limit is not tightened
                inner = maximum_filter1d(inner, 2 * (len(inner) // NEAR) + 1, axis=0)
            own[:-1] = np.minimum(own[:-1], getattr(tightened, kind)[:-1] / (1 + inner))
            own[1:] = np.minimum(own[1:], getattr(tightened, kind)[1:] / (1 + inner))
    exceeded = any(float(found[kind].max()) > KEPT for kind in FORCES + OF_TOOL if kind in found)
    if not exceeded and not lacking:
        return None
    more = (0.2 + gain) * lacking + 1e-7 if lacking else 0.0
    return Tightened(**factors, keep_off=tightened.keep_off + more)
