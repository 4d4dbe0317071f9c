"""From way-points to a path: where it moves smoothly on, where it turns back or on the spot, and so comes to rest."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from pipeline.common.arrays import Array
from pipeline.path.blend import Blended
from pipeline.path.curves import Geometry, Still
from pipeline.path.mixed import splined
from pipeline.path.orientation import Orientation
from pipeline.path.spline import Chain, Sampled, Spline

TURN = 0.1  # [m/rad] what a turn on the spot counts of the path's length
SAME = 1e-12  # [m] and [rad]: below it nothing moves
BACK = np.deg2rad(170.0)  # a corner at least as sharp as that turns back
FINE = 33  # samples between two way-points


@dataclass(frozen=True)
class Through:
    """A path through way-points: the curve, its orientations or None, and where along it each way-point lies (P,) [m].

    stops: indices of way-points between the first and the last at which the path comes to rest.
    departure: the largest distance [m] of the curve from the way-points' polygon, and the way-point before it, from 1.
    closer: indices of the corners whose legs are too short for the blend asked for.
    breaks: arc lengths [m] where it goes on elsewhere.
    """

    geometry: Geometry
    orientation: Sampled | None
    marks: Array
    stops: tuple[int, ...]
    departure: tuple[float, int]
    closer: tuple[int, ...] = ()
    breaks: tuple[float, ...] = ()


def one_after_the_other(paths: Sequence[Through], begins: Sequence[int]) -> Through:
    """Several paths that do not touch as one, which rests and breaks off where one ends; begins: the indices of their
    first way-points.
    """
    if len(paths) == 1:
        return paths[0]
    ends = np.concatenate([[0.0], np.cumsum([path.geometry.length for path in paths])])
    oriented = [path.orientation for path in paths if path.orientation is not None]
    stops = [i + begin for path, begin in zip(paths, begins, strict=True) for i in path.stops]
    closer = tuple(i + begin for path, begin in zip(paths, begins, strict=True) for i in path.closer)
    worst = max(range(len(paths)), key=lambda k: paths[k].departure[0])
    return Through(
        Chain([path.geometry for path in paths], ends),
        Chain(oriented, ends) if oriented else None,
        np.concatenate([path.marks + end for path, end in zip(paths, ends[:-1], strict=True)]),
        tuple(sorted([*stops, *begins[1:]])),
        (paths[worst].departure[0], paths[worst].departure[1] + begins[worst]),
        closer,
        tuple(map(float, ends[1:-1])),
    )


def through(
    points: Array,
    rotations: Rotation | None,
    *,
    rest: bool = False,
    blend: float | None = None,
    radian: float | None = None,
) -> Through:
    """The path through points (P, m) [m] and rotations (P); equal neighbours are a dwell, of length zero.

    radian: what one of turning counts of the path's length [m]; None: nothing, but `TURN` on the spot. Not with blend.

    It comes to rest where it turns back, before and after it turns on the spot, and with `rest` at every corner, so
    that it is straight in between. Elsewhere it is smooth: a spline, or with `blend` [m] straight legs whose
    corners are rounded, at most so far off them.
    """
    moves, turns = steps(points, rotations)
    kept = np.concatenate([[0], 1 + np.flatnonzero((moves > SAME) | (turns > SAME))])
    where = np.cumsum(np.concatenate([[False], (moves > SAME) | (turns > SAME)]))  # (P,) the kept one of each
    own, turned = points[kept], None if rotations is None else rotations[kept]
    moves, turns = steps(own, turned)
    breaks = [0, *(i for i in range(1, len(own) - 1) if rest or _stops(own, moves, i)), len(own) - 1]
    pieces: list[Geometry] = []
    oriented: list[Sampled] = []
    marks, ends, closer = np.zeros(len(own)), [0.0], list[int]()
    for first, last in pairwise(breaks):
        part, between = slice(first, last + 1), slice(first, last)
        if turned is not None and radian is not None:
            piece, turning, local = splined(own[part], turned[part], moves[between], turns[between], radian)
            oriented.append(turning)
        else:
            piece, local, near = _piece(own[part], moves[between], turns[between], kept[part][1:], blend)
            closer += [int(kept[first + i]) for i in near]
            if turned is not None:
                oriented.append(Orientation(local, turned[part]))
        pieces.append(piece)
        marks[part] = ends[-1] + local
        ends.append(ends[-1] + piece.length)
    whole = len(pieces) > 1
    geometry = Chain(pieces, np.array(ends)) if whole else pieces[0]
    orientation = None if turned is None else Chain(oriented, np.array(ends)) if whole else oriented[0]
    resting = {int(i) for i in np.flatnonzero(np.isin(where, breaks[1:-1]))}
    return Through(
        geometry,
        orientation,
        marks[where],
        tuple(sorted(resting)),
        _departure(geometry, own, marks, kept),
        tuple(closer),
    )


def _piece(
    points: Array, moves: Array, turns: Array, before: NDArray[np.int_], blend: float | None
) -> tuple[Geometry, Array, tuple[int, ...]]:
    """What passes smoothly on, or turns on the spot; the arc lengths of its points; which are too close for `blend`."""
    if moves[0] <= SAME:
        local = TURN * np.concatenate([[0.0], np.cumsum(turns)])
        return Still(points[0], float(local[-1])), local, ()
    if blend is None:
        smooth = Spline(points, before)
        return smooth, smooth.marks, ()
    rounded = Blended(points, blend)
    return rounded, rounded.marks, tuple(rounded.closer)


def steps(points: Array, rotations: Rotation | None) -> tuple[Array, Array]:
    """How far it is from each way-point to the next (P - 1,), in space [m] and in orientation [rad]."""
    moves = np.linalg.norm(np.diff(points, axis=0), axis=1)
    if rotations is None:
        return moves, np.zeros(len(moves))
    return moves, np.asarray((rotations[:-1].inv() * rotations[1:]).magnitude())


def _stops(points: Array, moves: Array, i: int) -> bool:
    """Whether the path cannot go smoothly through point i: it turns back, or on the spot on one side alone."""
    before, after = moves[i - 1] > SAME, moves[i] > SAME
    if not (before and after):
        return bool(before or after)
    cosine = (points[i] - points[i - 1]) @ (points[i + 1] - points[i]) / (moves[i - 1] * moves[i])
    return bool(cosine < np.cos(BACK))


def _departure(geometry: Geometry, points: Array, marks: Array, kept: Array) -> tuple[float, int]:
    share = np.linspace(0.0, 1.0, FINE)
    s = marks[:-1, None] + np.diff(marks)[:, None] * share
    curve = geometry.sample(s.ravel())[0].reshape(len(s), FINE, -1)
    start, chord = points[:-1, None], np.diff(points, axis=0)[:, None]
    along = ((curve - start) * chord).sum(axis=2) / np.maximum((chord**2).sum(axis=2), SAME**2)
    nearest = start + np.clip(along, 0.0, 1.0)[:, :, None] * chord
    distance = np.linalg.norm(curve - nearest, axis=2).max(axis=1)
    worst = int(np.argmax(distance))
    return float(distance[worst]), int(kept[worst + 1])  # past a dwell
