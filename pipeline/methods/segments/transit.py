"""From rest to rest through joint space, within position limits and clear of obstacles: between two pieces of a path.

Two trees grow from both ends towards random configurations and each other (RRT-Connect, Kuffner and LaValle 2000); the
way found is then shortened where a straight line will do. Along every straight leg s(t) is the quintic from rest to
rest, in the least time that the limits of velocity, acceleration, jerk, torque and power allow.
"""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from itertools import pairwise

import numpy as np

from pipeline.common.arrays import Array
from pipeline.path.timing import Quintic
from pipeline.problem.problem import Problem
from pipeline.problem.solution import Trajectory
from pipeline.search.manifold import Manifold

STEP = 0.05  # [rad] between the configurations of a leg that are looked at
LEG = 0.5  # [rad] by which a tree grows at most
ROOM = 0.9  # of the margin: where a piece ends it may just be kept
MOST = 2000  # configurations drawn
SHORTCUTS = 60
SAMPLES = 40  # of every leg
PEAKS = 1.875, 10 / np.sqrt(3), 60.0  # of a quintic's derivatives, where distance and time are 1
BORNE = 0.99  # of torque and power limits, at so many moments of a leg: there may be more between them
MOMENTS = 100
NEARLY = 1.005  # times the least time of a leg
USUAL = 1.0  # [rad/s] where nothing limits the velocity


class Transits:
    """Transits of one problem."""

    def __init__(self, problem: Problem, rng: np.random.Generator) -> None:
        obstacles = problem.obstacles and replace(problem.obstacles, margin=ROOM * problem.obstacles.margin)
        own = problem.own and replace(problem.own, margin=ROOM * problem.own.margin)
        self.problem, self.rng = problem, rng
        self.manifold = Manifold(replace(problem, obstacles=obstacles, own=own))

    def __call__(self, start: Array, end: Array) -> Trajectory | None:
        """From the configuration `start` (n,) to `end` (n,); None: no way was found."""
        way = [start, end] if self._free(start, end) else self._grown(start, end)
        return None if way is None else self._timed(self._shortened(way))

    def _free(self, a: Array, b: Array) -> bool:
        count = max(2, int(np.ceil(np.abs(b - a).max() / STEP)) + 1)
        return bool(self.manifold.allowed(a + np.linspace(0.0, 1.0, count)[:, None] * (b - a)).all())

    def _grown(self, start: Array, end: Array) -> list[Array] | None:
        own, other = _Tree([start]), _Tree([end])
        for _ in range(MOST):
            wished = self.manifold.uniform(1, self.rng)[0]
            if self._grow(own, wished) and self._connect(other, own.nodes[-1]):
                there, back = own.way(), other.way()
                whole = [*there, *back[::-1][1:]]
                return whole if np.array_equal(whole[0], start) else whole[::-1]
            own, other = other, own
        return None

    def _grow(self, tree: _Tree, wished: Array) -> bool:
        """One leg towards it; whether there is one."""
        nearest = tree.nearest(wished)
        move = wished - tree.nodes[nearest]
        move = move * min(1.0, LEG / max(float(np.abs(move).max()), 1e-12))
        reached = tree.nodes[nearest] + move
        if not self._free(tree.nodes[nearest], reached):
            return False
        tree.add(reached, nearest)
        return True

    def _connect(self, tree: _Tree, wished: Array) -> bool:
        """Leg by leg as far as it goes; whether it arrives."""
        while self._grow(tree, wished):
            if np.abs(tree.nodes[-1] - wished).max() < 1e-9:
                return True
        return False

    def _shortened(self, way: list[Array]) -> list[Array]:
        for _ in range(SHORTCUTS):
            if len(way) < 3:
                break
            first, last = np.sort(self.rng.choice(len(way), 2, replace=False))
            if last - first > 1 and self._free(way[first], way[last]):
                way = [*way[: first + 1], *way[last:]]
        return way

    def _timed(self, way: list[Array]) -> Trajectory | None:
        times, rows = [0.0], [way[0]]
        for a, b in pairwise(way):
            span = self._least(a, b)
            if not np.isfinite(span):
                return None
            t = np.linspace(0.0, span, SAMPLES + 1)[1:]
            share = Quintic(span).sample(t, 1.0)[0]
            rows += list(a + share[:, None] * (b - a))
            times += list(times[-1] + t)
        return Trajectory(np.array(times), np.array(rows))

    def _least(self, a: Array, b: Array) -> float:
        """The least time [s] of a leg; infinite: already to hold the arm there takes more than it has."""
        bounds, own, distance = self.problem.bounds, self.problem.task.arm.description.velocity, np.abs(b - a)
        velocity = np.where(np.isfinite(own) & (own > 0), own, USUAL)
        velocity = np.where(np.isfinite(bounds.velocity), bounds.velocity, velocity)
        rates = zip(PEAKS, (velocity, bounds.acceleration, bounds.jerk), (1, 2, 3), strict=True)
        short = max(1e-3, *(float((peak * distance / most).max() ** (1 / order)) for peak, most, order in rates))
        if self._bears(a, b, short):
            return short
        if not self._bears(a, b, np.inf):
            return np.inf
        long = 2 * short
        while not self._bears(a, b, long):
            short, long = long, 2 * long
        while long > NEARLY * short:
            middle = (short + long) / 2
            short, long = (short, middle) if self._bears(a, b, middle) else (middle, long)
        return long

    def _bears(self, a: Array, b: Array, span: float) -> bool:
        """Whether a leg in the time `span` [s] keeps the limits of torque and power."""
        bounds = self.problem.bounds
        if not (np.isfinite(bounds.torque).any() or np.isfinite(bounds.power).any()):
            return True
        s, sd, sdd = (row[:, None] * (b - a) for row in Quintic(1.0).sample(np.linspace(0.0, 1.0, MOMENTS + 1), 1.0))
        v = sd / span
        tau = self.problem.task.arm.inverse_dynamics(a + s, v, sdd / span**2)
        borne = (np.abs(tau) <= BORNE * bounds.torque) & (np.abs(tau * v) <= BORNE * bounds.power)
        return bool(borne.all())


@dataclass
class _Tree:
    nodes: list[Array]
    before: list[int] = field(default_factory=lambda: [-1])

    def nearest(self, q: Array) -> int:
        return int(np.linalg.norm(np.array(self.nodes) - q, axis=1).argmin())

    def add(self, q: Array, before: int) -> None:
        self.nodes.append(q)
        self.before.append(before)

    def way(self) -> list[Array]:
        """From the root to the node that was added last."""
        at, way = len(self.nodes) - 1, list[Array]()
        while at >= 0:
            way.insert(0, self.nodes[at])
            at = self.before[at]
        return way
