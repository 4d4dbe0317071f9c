"""The least clearance of a motion, between its knots too, with a bound that never lies above the truth.

On a piece of the curve a solid that joints a + 1 .. b move against another one moves by at most

    sum over j of rho_j integral |qd_j| dt,    j = a + 1 .. b,

against it, with rho_j the reach of the solid from joint j's axis in any configuration (1 for a sliding joint). So a
distance at one moment bounds those of the piece around it. So does a plane between them that stands still against the
first one: the second one's points leave the straight line along which they move now, within t, by at most

    1/2 t^2 (sum over j of rho_j max |qdd_j| + sum over j, k of rho_max(j,k) max |qd_j| max |qd_k|),

and of those that go straight the one nearest to the plane at any time is so at an end of the piece. That is the sharper
one of the two on small pieces. Pieces whose bound is below the least distance found are halved, the lowest first, until
the bound is within `tolerance` of it. |qd_j| and |qdd_j| are at most their largest values on a piece, which are exact:
the derivatives of a cubic are a parabola and a line.
"""

from __future__ import annotations

import heapq
from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from pipeline.common.arrays import Array
from pipeline.evaluation.clearance import Clearance, Pair
from pipeline.problem.curve import whole
from pipeline.problem.problem import Problem
from pipeline.problem.solution import Trajectory

FINE = 5e-5  # [m] where that does not tell whether a margin is kept, or by how much a motion falls short of it
TOLERANCE = 1.5e-4  # [m] of the bound below a distance that the motion has
MOST = 4_000  # distances of one motion: where they do not suffice the bound stays lower, and true


@dataclass(frozen=True)
class Closest:
    """A motion's least clearance: `bound` [m] is never above it and `distance` [m], at `time` [s], never below. Between
    the links or obstacles `first` and `second`; infinite where there is nothing to be clear of.
    """

    bound: float = np.inf
    distance: float = np.inf
    time: float = 0.0
    first: str = ""
    second: str = ""


def said(closest: Closest) -> str:
    """Who comes how near to whom, and when."""
    return f"{closest.first} and {closest.second} are {closest.distance:.3g} m apart at t = {closest.time:.3g} s"


@dataclass(frozen=True)
class Near:
    """What a motion comes nearest to: obstacles, and the arm itself."""

    obstacles: Closest = Closest()
    own: Closest = Closest()


@dataclass(frozen=True)
class Piece:
    """A part of the curve from knot `begin` to `end`, or of one interval from `begin` to `end` of it (in shares)."""

    pair: int
    begin: float
    end: float


class Motion:
    """A curve and how far each joint goes on any part of it, at most."""

    def __init__(self, clearance: Clearance, pairs: list[Pair], curve: Callable[..., Array], knots: Array) -> None:
        self.clearance, self.curve, self.knots = clearance, curve, knots
        middle = (knots[1:] + knots[:-1]) / 2
        ends, half = curve(knots, 1), curve(middle, 1)
        # the parabola through begin, middle and end of each interval: a s^2 + b s + c on s in [0, 1]
        first, last = ends[:-1], ends[1:]
        self.a, self.b, self.c = 2 * (first + last) - 4 * half, 4 * half - 3 * first - last, first
        dt = np.diff(knots)[:, None]
        self.most = every = self._most(np.arange(len(middle)), np.zeros(len(middle)), np.ones(len(middle)))
        self.bend = np.maximum(np.abs(self.b), np.abs(2 * self.a + self.b)) / dt  # max |qdd| of each interval
        self.gone = np.vstack([np.zeros(every.shape[1]), np.cumsum(every * dt, axis=0)])
        most = np.abs(curve(knots)).max(axis=0) + np.diff(self.gone, axis=0).max(axis=0)
        clearance.at(np.zeros(len(most)))
        self.reach = np.array([reaches(clearance, pair, most) for pair in pairs])

    def _most(self, i: NDArray[np.intp], begin: Array, end: Array) -> Array:
        """max |qd| (K, n) between the shares begin and end (K,) of the intervals i (K,)."""
        a, b, c = self.a[i], self.b[i], self.c[i]
        begin, end = begin[:, None], end[:, None]
        turn = np.clip(np.divide(-b, 2 * a, out=np.zeros_like(a), where=a != 0), begin, end)
        return np.asarray(np.max([np.abs((a * s + b) * s + c) for s in (begin, end, turn)], axis=0))

    def way(self, begin: float, end: float) -> Array:
        """How far (n,) [rad or m] every joint goes at most from knot `begin` to `end`, or parts of one interval."""
        if begin.is_integer() and end.is_integer():
            return np.asarray(self.gone[int(end)] - self.gone[int(begin)])
        i = int(begin)
        most = self._most(np.array([i]), np.array([begin - i]), np.array([end - i]))[0]
        return np.asarray(most * (end - begin) * (self.knots[i + 1] - self.knots[i]))

    def bent(self, piece: Piece) -> float:
        """Of the pair's second solid against its first: how much [m/s^2] its points' velocities change, at most."""
        rho, run = self.reach[piece.pair], slice(int(piece.begin), int(np.ceil(piece.end)))
        most, bend = self.most[run].max(axis=0) * (rho > 0), self.bend[run].max(axis=0)
        return float(rho @ (bend + most * (2 * np.cumsum(most) - most)))

    def bound(self, pair: Pair, piece: Piece, cut: float, apart: tuple[float, float, Array]) -> float:
        """What the distance on all of a piece is at least [m], by that at its place `cut`, where the arm is."""
        ways = (self.way(*ends) for ends in ((piece.begin, cut), (cut, piece.end)))
        by_way = apart[0] - max(float(self.reach[piece.pair] @ way) for way in ways)
        now = self.time(cut)
        spans = self.time(piece.begin) - now, self.time(piece.end) - now
        straight = self.clearance.going(pair, apart[2], self.curve(now, 1), spans)
        return max(by_way, straight - self.bent(piece) * max(span * span for span in spans) / 2)

    def time(self, place: float) -> float:
        """Of a place between knots."""
        return float(np.interp(place, np.arange(len(self.knots)), self.knots))

    def go(self, place: float) -> None:
        """Put the arm there."""
        self.clearance.at(self.curve(self.time(place)))


def near(problem: Problem, clearance: Clearance, curve: Callable[..., Array], knots: Array) -> Near:
    """Both along `curve(moment, order)`, a cubic between `knots` (N + 1,), with the margins of a problem."""
    around, own = problem.obstacles, problem.own
    return Near(
        _known(clearance, clearance.obstacles, curve, knots, 0.0 if around is None else around.margin),
        _known(clearance, clearance.own, curve, knots, 0.0 if own is None else own.margin),
    )


def _known(
    clearance: Clearance, pairs: list[Pair], curve: Callable[..., Array], knots: Array, margin: float
) -> Closest:
    """The least clearance, which is not said to fall short of a margin that `lacking` knows to be kept."""
    found = closest(clearance, pairs, curve, knots, margin)
    if not found.bound < margin <= found.distance:
        return found
    kept = min(margin, closest(clearance, pairs, curve, knots, margin, margin).bound)
    return replace(found, bound=max(found.bound, kept))


def lacking(problem: Problem, clearance: Clearance, trajectory: Trajectory) -> float:
    """By how much [m] the exported curve of a trajectory falls short of a margin that it has to keep, at most."""
    curve, short = whole(problem, trajectory), 0.0
    for pairs, margin in margins(problem, clearance):
        found = closest(clearance, pairs, curve, trajectory.time, margin, margin)
        short = max(short, margin - found.bound)
    return short


def margins(problem: Problem, clearance: Clearance) -> list[tuple[list[Pair], float]]:
    """The pairs that have to keep a margin, and it [m]."""
    around, own = problem.obstacles, problem.own
    both = [] if around is None else [(clearance.obstacles, around.margin)]
    return both if own is None or not own.kept else [*both, (clearance.own, own.margin)]


def closest(
    clearance: Clearance,
    pairs: list[Pair],
    curve: Callable[..., Array],
    knots: Array,
    margin: float = 0.0,
    enough: float = np.inf,
) -> Closest:
    """The least clearance of `pairs` along `curve(moment, order)`, a cubic between `knots` (N + 1,).

    margin [m]: whether that is kept is told to FINE. enough [m]: what need not be known better than that it is more.
    """
    if not pairs:
        return Closest()
    motion = Motion(clearance, pairs, curve, knots)
    best, heap = _survey(motion, pairs, enough)
    count, left = len(heap), MOST
    while True:
        bound, _, fresh, piece = heapq.heappop(heap) if heap else (np.inf, 0, True, Piece(0, 0.0, 1.0))
        floor = min(bound, best.bound)
        tolerance = FINE if floor < margin <= max(best.bound, enough) else TOLERANCE
        if floor >= min(best.bound - tolerance, enough) or left == 0:
            return replace(best, bound=floor)
        cut = middle(piece)
        if fresh:
            left -= 1
            motion.go(cut)
            pair = pairs[piece.pair]
            apart = clearance.apart(pair)
            best = nearer(best, pair, apart, motion.time(cut))
            bound = max(bound, motion.bound(pair, piece, cut, apart))
            count += 1
            heapq.heappush(heap, (bound, count, False, piece))
            continue
        for begin, end in ((piece.begin, cut), (cut, piece.end)):
            count += 1
            heapq.heappush(heap, (bound, count, True, Piece(piece.pair, begin, end)))


def nearer(best: Closest, pair: Pair, apart: tuple[float, float, Array], time: float) -> Closest:
    """The nearer one of what was known and a pair's distance, between its two bounds."""
    low, high, _ = apart
    return Closest(low, high, time, pair.first.name, pair.second.name) if low < best.bound else best


def _survey(motion: Motion, pairs: list[Pair], enough: float) -> tuple[Closest, list[tuple[float, int, bool, Piece]]]:
    """A first least distance, and the pieces between knots that may hold a smaller one, by the balls around solids.

    Each pair's distance is taken at the knot where its balls are nearest.
    """
    clearance, count = motion.clearance, len(motion.knots)
    balls = np.empty((count, len(pairs)))
    for k, q in enumerate(motion.curve(motion.knots)):
        clearance.at(q)
        balls[k] = clearance.bounds(pairs)
    best, nearest = Closest(), balls.argmin(axis=0)
    for p in np.argsort(balls.min(axis=0)):
        if balls[nearest[p], p] >= min(best.bound, enough):
            break
        motion.go(float(nearest[p]))
        best = nearer(best, pairs[p], clearance.apart(pairs[p]), float(motion.knots[nearest[p]]))
    ways = np.diff(motion.gone, axis=0) @ motion.reach.T
    bounds = (balls[1:] + balls[:-1] - ways) / 2  # of two ends that the way between them joins
    heap, order = [], 0
    for p in range(len(pairs)):
        may = np.flatnonzero(bounds[:, p] < min(best.bound, enough))
        for run in np.split(may, np.flatnonzero(np.diff(may) > 1) + 1) if len(may) else ():
            order += 1
            piece = Piece(p, float(run[0]), float(run[-1] + 1))
            heap.append((float(bounds[run, p].min()), order, True, piece))
    heapq.heapify(heap)
    return best, heap


def middle(piece: Piece) -> float:
    """Where a piece is cut: at a knot, or halfway within an interval."""
    inner = piece.end - piece.begin
    return piece.begin + (float(int(inner) // 2) if inner > 1 else inner / 2)


def reaches(clearance: Clearance, pair: Pair, most: Array) -> Array:
    """rho (n,) of the pair's second solid for motions in which no sliding joint goes beyond `most` (n,); zero for
    joints that do not move it against the first. The arm is at zero.
    """
    begin, end = pair.first.joints, pair.second.joints
    origins, ball, out = clearance.origins(), clearance.balls([pair.second])[0], np.zeros(len(most))
    for joint in range(begin, end):
        if clearance.slides(joint):
            out[joint] = 1.0
            continue
        # from the axis to the next place on the chain at right angles, from there on as far as the places are apart
        axis, steps = clearance.axis(joint), np.diff([*origins[joint:end], ball], axis=0)
        across = steps[0] - (steps[0] @ axis) * axis
        further = np.linalg.norm(steps[1:], axis=1).sum()
        slack = sum(most[k] for k in range(joint + 1, end) if clearance.slides(k))
        out[joint] = np.linalg.norm(across) + further + slack + pair.second.radius
    return out
