"""How many knots a path needs, so that a smooth motion through them stays on it: judged by the path's own spline.

The path, splined through its points and orientations at the knots, is off itself by an error that falls as the fourth
power of their number once they resolve it. A motion's is larger by a factor, measured on the knots that it has.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import CubicSpline
from scipy.spatial.transform import Rotation

from pipeline.common.arrays import Array
from pipeline.problem.problem import Problem

MOST = 100_000  # intervals that may be advised
SAFETY = (1.5, 5.0)  # on the measured error: for at most twice the knots, and for more
ORDER = 4  # of the error of a cubic spline
ROUNDING = 1e-12  # [m] and [rad]: an error below it says nothing
STRAYS = 0.1  # of the path's extent, or [rad]
WITHIN = np.array([0.382, 0.5])  # of an interval: one alone meets a circle again after whole turns
SHORTEST = 1e-7  # of the motion time: shorter intervals do not help
SAVES = 2  # times fewer knots must there be for them not to be even
GRADE = 2.0  # at most, from an interval to the next
BEND = 2.0  # [rad] by which a path may turn from knot to knot of a coarse grid
BENT = 4  # places in each interval at which its turning is seen
ROUGH = 0.02  # of the path's extent, and [rad]: by how much a coarse grid's spline may be off


def divided(times: Array, parts: int) -> Array:
    """The knots `times` (N + 1,) and parts - 1 more, evenly, in each of their intervals."""
    return np.interp(np.arange(parts * (len(times) - 1) + 1) / parts, np.arange(len(times)), times)


def path_error(problem: Problem, knots: Array) -> tuple[float, float]:
    """How far the path's own spline through `knots` (N + 1,) [s] is from it between them, at most: [m] and [rad]."""
    distance, angle = map(float, path_errors(problem, knots).max(axis=1))
    return distance, angle


def path_errors(problem: Problem, knots: Array) -> Array:
    """The same of every interval, (2, N)."""
    rows = len(problem.task.axes)
    middle = (knots[:-1, None] + np.diff(knots)[:, None] * WITHIN).ravel()
    ends = "clamped" if problem.reference.timing.at_rest else "not-a-knot"
    at_knots, between = problem.reference.position(knots), problem.reference.position(middle)
    spline = CubicSpline(knots, at_knots[:, :rows], bc_type=ends)
    found = np.zeros((2, len(knots) - 1))
    found[0] = _worst(np.linalg.norm(spline(middle) - between[:, :rows], axis=1), len(WITHIN))
    if at_knots.shape[1] == rows:
        return found
    quaternions = Rotation.from_rotvec(at_knots[:, rows:]).as_quat()
    same_way = np.einsum("ki,ki->k", quaternions[1:], quaternions[:-1]) >= 0
    quaternions *= np.cumprod(np.concatenate([[1.0], np.where(same_way, 1.0, -1.0)]))[:, None]
    turned = Rotation.from_quat(CubicSpline(knots, quaternions, bc_type=ends)(middle))
    found[1] = _worst((Rotation.from_rotvec(between[:, rows:]).inv() * turned).magnitude(), len(WITHIN))
    return found


def resolving(problem: Problem, most: int) -> Array | None:
    """The knots of the problem with as many more as its path needs, so that its own spline keeps the path's tolerances
    with some room: in all intervals alike, or where that takes `SAVES` times as many, where the path curves alone.
    None if there would be more than `most` intervals.
    """
    reference, times = problem.reference, problem.times
    room = np.array([reference.tolerance, reference.orientation_tolerance]) / SAFETY[0]
    parts = _least(lambda parts: _keeps(problem, divided(times, parts), room), 1, most // (len(times) - 1))
    if parts is not None and parts <= SAVES:
        return divided(times, parts)
    knots = _where_needed(problem, room, most)
    if parts is not None and (knots is None or (len(times) - 1) * parts <= SAVES * (len(knots) - 1)):
        return divided(times, parts)
    return knots


def _where_needed(problem: Problem, room: Array, most: int) -> Array | None:
    """Intervals are halved where the path's own spline is too far off it, and beside much shorter ones."""
    knots = problem.times
    while len(knots) <= most + 1 and np.diff(knots).min() > SHORTEST * problem.reference.duration:
        bad = (path_errors(problem, knots) > room[:, None]).any(axis=0)
        if not bad.any():
            return knots
        knots = graded(parted(knots, np.where(bad, 2, 1)))
    return None


def parted(knots: Array, parts: NDArray[np.int_]) -> Array:
    """The knots (N + 1,) with interval i in parts[i] equal ones, parts (N,)."""
    places = np.concatenate([[0.0], np.cumsum(parts)])
    return np.asarray(np.interp(np.arange(places[-1] + 1), places, knots))


def graded(knots: Array) -> Array:
    """The knots with intervals halved until none is more than `GRADE` times as long as its neighbour."""
    while True:
        length = np.pad(np.diff(knots), 1, constant_values=np.inf)
        long = length[1:-1] > GRADE * (1 + ROUNDING) * np.minimum(length[:-2], length[2:])
        if not long.any():
            return knots
        knots = parted(knots, np.where(long, 2, 1))


def on_path(problem: Problem) -> Array:
    """The knots of the problem, or as many more as its path needs, for motions that are known at any time."""
    knots = resolving(problem, MOST)
    return problem.times if knots is None else knots


def roughly(problem: Problem, intervals: int) -> int:
    """At least `intervals`, evenly spread over the knots of the problem: as many as show the path's shape, and between
    which it does not turn by more than `BEND`.
    """
    room = np.array([ROUGH * _extent(problem) + ROUNDING, ROUGH])

    def shows(count: int) -> bool:
        knots = thinned(problem.times, count)
        return _keeps(problem, knots, room) and bool(_bends(problem, knots).max() <= BEND)

    found = _least(shows, intervals, max(intervals, len(problem.times) - 1))
    return max(intervals, len(problem.times) - 1) if found is None else found


def thinned(times: Array, intervals: int) -> Array:
    """Knots (intervals + 1,), as dense as `times` (N + 1,)."""
    return np.interp(np.linspace(0, len(times) - 1, intervals + 1), np.arange(len(times)), times)


def _bends(problem: Problem, knots: Array) -> Array:
    """By how much (N,) [rad] the path curves between the knots (N + 1,); corners at which it rests do not count."""
    geometry, fine = problem.reference.geometry, divided(knots, BENT)
    s = problem.reference.timing.sample(fine, geometry.length)[0]
    curvature = np.linalg.norm(geometry.sample((s[1:] + s[:-1]) / 2)[2], axis=1)
    return np.asarray((curvature * np.abs(np.diff(s))).reshape(-1, BENT).sum(axis=1))


def _worst(values: Array, each: int) -> Array:
    return np.asarray(values.reshape(-1, each).max(axis=1))


def steps_needed(problem: Problem, time: Array, off: float, which: int) -> int | None:
    """How many even intervals would bring a motion on the knots `time`, `off` its path by so many [m] (which = 0) or
    [rad] (1), to within the path's tolerance; rounded up to two digits. None: no number does.
    """
    count, reference = len(time) - 1, problem.reference
    allowed = (reference.tolerance, reference.orientation_tolerance)[which]
    here = path_error(problem, _even(problem, count))[which]
    if here <= ROUNDING:  # as of a line at constant speed: what is off is the arm's alone
        needed = count * (SAFETY[1] * off / allowed) ** (1 / ORDER)
        return _rounded(needed) if off <= strays(problem)[which] and needed <= MOST else None
    factor = max(off / here, 1.0)
    near, far = (_even_least(problem, count, allowed / (safety * factor), which) for safety in SAFETY)
    return near if near is not None and near <= 2 * count else far


def parts_needed(errors: Array, allowed: float) -> NDArray[np.int_]:
    """Into how many parts (N,) each interval must go in which a motion is off its path by `errors` (N,), so that it is
    off by no more than `allowed`, and those beside it, whose lengths count for the spline there too.
    """
    parts = np.ceil(np.maximum(SAFETY[0] * errors / allowed, 1.0) ** (1 / ORDER)).astype(int)
    parts[errors <= allowed] = 1
    around = np.pad(parts, 1, constant_values=1)
    return np.maximum(np.maximum(around[:-2], around[2:]), parts)


def strays(problem: Problem) -> tuple[float, float]:
    """A motion that is off by more [m], [rad] does not follow the path."""
    return STRAYS * _extent(problem), STRAYS


def _extent(problem: Problem) -> float:
    """The diagonal [m] of the box that holds the path."""
    points = problem.reference.position(np.linspace(0.0, problem.reference.duration, 1001))
    return float(np.linalg.norm(np.ptp(points[:, : len(problem.task.axes)], axis=0)))


def _even_least(problem: Problem, low: int, allowed: float, which: int) -> int | None:
    found = _least(lambda count: path_error(problem, _even(problem, count))[which] <= allowed, low + 1, MOST, 1.02)
    return None if found is None else _rounded(found)


def _least(holds: Callable[[int], bool], low: int, most: int, within: float = 1.0) -> int | None:
    """The least number from `low` to `most` for which it `holds`, and so for all above, to a factor `within`."""
    fails, high = low - 1, low
    while not holds(high):
        if high >= most:
            return None
        fails, high = high, min(2 * high, most)
    while high > within * fails + 1:
        middle = (fails + high) // 2
        fails, high = (fails, middle) if holds(middle) else (middle, high)
    return high


def _keeps(problem: Problem, knots: Array, room: Array) -> bool:
    return bool(np.all(np.array(path_error(problem, knots)) <= room))


def _even(problem: Problem, intervals: int) -> Array:
    return np.linspace(0.0, problem.reference.duration, intervals + 1)


def _rounded(intervals: float) -> int:
    return int(float(f"{intervals * 1.04:.1e}"))
