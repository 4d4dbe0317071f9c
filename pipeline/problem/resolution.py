"""How many knots a path needs, so that a smooth motion through them stays on it: judged by the path's own spline.

The path, splined through its points and orientations at the knots, is off itself by an error that falls as the fourth
power of their number once they resolve it. A motion's is larger by a factor, measured on the knots that it has.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
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
ROUGH = 0.02  # of the path's extent, and [rad]: by how much a coarse grid's spline may be off


def divided(times: Array, parts: int) -> Array:
    """The knots `times` (N + 1,) and parts - 1 more, evenly, in each of their intervals."""
    return np.interp(np.arange(parts * (len(times) - 1) + 1) / parts, np.arange(len(times)), times)


def path_error(problem: Problem, knots: Array) -> tuple[float, float]:
    """How far the path's own spline through `knots` (N + 1,) [s] is from it between them, at most: [m] and [rad]."""
    rows = len(problem.task.axes)
    middle = (knots[:-1, None] + np.diff(knots)[:, None] * WITHIN).ravel()
    ends = "clamped" if problem.reference.timing.at_rest else "not-a-knot"
    at_knots, between = problem.reference.position(knots), problem.reference.position(middle)
    spline = CubicSpline(knots, at_knots[:, :rows], bc_type=ends)
    distance = float(np.linalg.norm(spline(middle) - between[:, :rows], axis=1).max())
    if at_knots.shape[1] == rows:
        return distance, 0.0
    quaternions = Rotation.from_rotvec(at_knots[:, rows:]).as_quat()
    same_way = np.einsum("ki,ki->k", quaternions[1:], quaternions[:-1]) >= 0
    quaternions *= np.cumprod(np.concatenate([[1.0], np.where(same_way, 1.0, -1.0)]))[:, None]
    turned = Rotation.from_quat(CubicSpline(knots, quaternions, bc_type=ends)(middle))
    return distance, float((Rotation.from_rotvec(between[:, rows:]).inv() * turned).magnitude().max())


def resolving(problem: Problem, most: int) -> int | None:
    """The least number of parts of each interval of the grid on which the path's own spline keeps the path's tolerances
    with some room; None if more than `most` intervals would have to be made.
    """
    reference = problem.reference
    room = np.array([reference.tolerance, reference.orientation_tolerance]) / SAFETY[0]
    bound = most // (len(problem.times) - 1)
    return _least(lambda parts: _keeps(problem, divided(problem.times, parts), room), 1, bound)


def on_path(problem: Problem) -> Array:
    """The knots of the problem, or as many parts of their intervals as its path needs, for motions that are known at
    any time.
    """
    return divided(problem.times, resolving(problem, MOST) or 1)


def roughly(problem: Problem, intervals: int) -> int:
    """At least `intervals`, evenly spread: as many as show the path's shape."""
    room = np.array([ROUGH * _extent(problem) + ROUNDING, ROUGH])
    found = _least(lambda count: _keeps(problem, _even(problem, count), room), intervals, MOST)
    return intervals if found is None else found


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
