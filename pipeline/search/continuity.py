"""Which stretches of a path one continuous motion can follow, however slowly.

At places along the path the configurations that reach it, within limits and clear of obstacles, fall into components:
within one of them the arm moves while the tool stands still. Components of neighbouring places are linked where a
configuration of the one, led along the path, comes to the other. For r = 1 the configurations are nodes along all
loops of the self-motion manifold, so that what is not linked is not connected, at the resolution of nodes and places;
for r > 1 they are samples, and what is not linked is only not known to be.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from scipy.sparse.csgraph import connected_components
from scipy.spatial.distance import cdist

from pipeline.common.arrays import Array
from pipeline.model.kernel.arm import on_kernel
from pipeline.path.timing import ConstantSpeed
from pipeline.problem.objective import Objective
from pipeline.problem.problem import Problem
from pipeline.search.grid import make_grid
from pipeline.search.layers import through_every_node
from pipeline.search.manifold import Manifold
from pipeline.search.roadmap import Sampler
from pipeline.search.selection import diverse

NEAR = 1.05  # node spacings between neighbours on a loop
APART = 0.6  # [rad] between neighbours among samples
LEAP = 0.5  # [rad] that following the path may take from place to place; more is another branch


@dataclass(frozen=True)
class Components:
    """places (P,): arc lengths [m]; nodes: of each place the configurations (K, n) that are allowed; labels: of each
    node its component; links: which components (A, B) of a place and the next are connected, steps: which nodes, in
    pairs; spacing [rad] of nodes along the loops, infinite where they are samples; turning (n,): the joints that come
    round again.
    """

    places: Array
    nodes: Sequence[Array]
    labels: Sequence[NDArray[np.int_]]
    links: Sequence[NDArray[np.bool_]]
    steps: Sequence[tuple[NDArray[np.int_], NDArray[np.int_]]]
    spacing: float
    turning: NDArray[np.bool_]

    def furthest(self, first: int) -> int:
        """The last place that a continuous motion from the place `first` can reach; -1: nothing is allowed there."""
        reached = np.ones(_count(self.labels[first]), bool)
        if not reached.any():
            return -1
        for place in range(first, len(self.links)):
            reached = np.asarray((self.links[place] & reached[:, None]).any(axis=0))
            if not reached.any():
                return place
        return len(self.places) - 1

    def earliest(self, last: int) -> int:
        """The first place from which a continuous motion can reach the place `last`."""
        reached = np.ones(_count(self.labels[last]), bool)
        for place in range(last - 1, -1, -1):
            reached = np.asarray((self.links[place] & reached).any(axis=1))
            if not reached.any():
                return place + 1
        return 0


def components(problem: Problem, count: int, nodes: int, rng: np.random.Generator) -> Components:
    """Of `count` intervals of the path, with `nodes` configurations on the longest manifold, or at every place."""
    length = problem.reference.geometry.length
    steady = replace(problem.reference, timing=ConstantSpeed(length))  # the time is the arc length
    places = np.linspace(0.0, length, count + 1)
    slow = replace(problem, task=on_kernel(problem.task), reference=steady, times=places, objective=Objective())
    manifold = Manifold(slow)
    if problem.task.redundancy == 1:
        grid = make_grid(slow, places, nodes)
        allowed, spacing = [layer.q[layer.allowed] for layer in grid.layers], grid.spacing
        turning, near = grid.turning, NEAR * grid.spacing
    else:
        allowed, spacing = Sampler(manifold, places, nodes, rng).layers(), np.inf
        turning, near = manifold.period > 0, APART
    labels = [_components(q, near, turning) for q in allowed]
    x = slow.reference.position(places)
    ahead = [_led(manifold, allowed[i], allowed[i + 1], x[i + 1], near, turning) for i in range(count)]
    back = [_led(manifold, allowed[i + 1], allowed[i], x[i], near, turning) for i in range(count)]
    links, steps = [], []
    for i in range(count):
        here, there = (np.concatenate([ahead[i][k], back[i][1 - k]]) for k in (0, 1))
        link = np.zeros((_count(labels[i]), _count(labels[i + 1])), bool)
        link[labels[i][here], labels[i + 1][there]] = True
        links.append(link)
        steps.append((here, there))
    return Components(places, allowed, labels, links, steps, spacing, turning)


def motions(found: Components, first: int, last: int, manifold: Manifold, most: int) -> Array:
    """At most `most` short ways (K, P, n) from node to linked node through the places from `first` to `last`, spread
    out; every joint goes the shorter way.
    """
    edges = []
    for i in range(first, last):
        here, there = found.steps[i]
        cost = np.full((len(found.nodes[i]), len(found.nodes[i + 1])), np.inf, np.float32)
        apart = manifold.wrap(found.nodes[i + 1][there] - found.nodes[i][here])
        cost[here, there] = (apart * apart).sum(axis=1)
        edges.append(cost)
    paths, costs = through_every_node(edges)
    q = np.stack([found.nodes[first + i][column] for i, column in enumerate(paths.T)], axis=1)
    q[:, 1:] = q[:, :1] + np.cumsum(manifold.wrap(np.diff(q, axis=1)), axis=1)
    return q[diverse(q, costs, most, APART, manifold.problem.task.arm.description.revolute)]


def fewest(found: Components) -> list[tuple[int, int]] | None:
    """Where the path must be cut so that there are fewest pieces: of each cut the first and the last place where it may
    be, if the others are where that allows it. None: at some place no configuration is allowed.
    """
    last, reach = len(found.places) - 1, 0
    latest: list[int] = []
    while (reach := found.furthest(reach)) < last:
        if reach < 0 or (latest and reach <= latest[-1]):
            return None
        latest.append(reach)
    first: list[int] = [last]
    for _ in latest:
        first.insert(0, found.earliest(first[0]))
    return list(zip(first[:-1], latest, strict=True))


def places_of(found: Components, cuts: Sequence[tuple[int, int]]) -> list[int]:
    """One place for each cut, in the middle of where it may be once those before it are chosen."""
    chosen: list[int] = []
    for first, _ in cuts:
        chosen.append((first + found.furthest(chosen[-1] if chosen else 0)) // 2)
    return chosen


def _count(labels: NDArray[np.int_]) -> int:
    return int(labels.max(initial=-1)) + 1


def around(q: Array, turning: NDArray[np.bool_]) -> Array:
    """Coordinates in which joints that turn for ever are on a circle, so that near is near."""
    return np.hstack([q[:, ~turning], np.cos(q[:, turning]), np.sin(q[:, turning])])


def _components(q: Array, near: float, turning: NDArray[np.bool_]) -> NDArray[np.int_]:
    if not len(q):
        return np.empty(0, int)
    flat = around(q, turning)
    return np.asarray(connected_components(cdist(flat, flat) <= near, directed=False)[1])


def _led(
    manifold: Manifold, q: Array, other: Array, target: Array, near: float, turning: NDArray[np.bool_]
) -> tuple[NDArray[np.int_], NDArray[np.int_]]:
    """Pairs of nodes q (K, n) and `other` (L, n): what is led to the path's next point, and what it comes to."""
    if not len(q) or not len(other):
        return np.empty(0, int), np.empty(0, int)
    moved, arrived = manifold.project(q, np.tile(target, (len(q), 1)), steps=10)
    follows = np.asarray(arrived & (np.abs(moved - q).max(axis=1) <= LEAP))
    pairs = (cdist(around(moved, turning), around(other, turning)) <= near) & follows[:, None]
    own, others = np.nonzero(pairs)
    return own, others
