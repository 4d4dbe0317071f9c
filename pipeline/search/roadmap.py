"""Starts for any redundancy: a layered graph of configurations on the self-motion manifolds of some points of the path.

Half of each layer's nodes are uniform joint angles put onto the manifold, which reach every branch; the other half are
carried along the whole path from some layers by inertia-weighted steps, which stay on a branch. An edge costs
1/2 d'G d/dt with the objective's metric G at both ends. The cheapest path through every node is a start; cheap ones
that are far apart are priced on the first grid, and of those again the cheap ones that are far apart remain. Further
starts are the cheapest paths through a few random nodes of each layer: no two draws are alike, and none is far dearer
than it must be.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from pipeline.common.arrays import Array
from pipeline.config.steps import MOST_PLACES
from pipeline.model.kernel.chain import Chain
from pipeline.model.kinematics import wrap
from pipeline.problem.problem import Boundary, Problem
from pipeline.problem.turns import full_turns
from pipeline.search.floating import OnMovingBase
from pipeline.search.layers import Edges, closed_paths, through_every_node
from pipeline.search.manifold import Manifold
from pipeline.search.selection import diverse

SLACK = 1.15  # times the velocity limits: a coarse step's mean may be a little above them
PRICED = 3  # times as many starts are priced on the first grid as are kept
APART = 0.1  # [rad]: starts are not closer than half of this
CLOSED = 1e-6  # [rad]
TURN = np.deg2rad(20.0)  # of a cycle about the first joint, from layer to layer
FEW = 4  # nodes of a layer, at most, that a random motion may choose from: with 8 the cheap ones prevail


class Roadmap:
    """The graph of one problem, with `nodes` in each of the layers 1 .. `layers`, and its paths as motions on `grid`.

    All motions (P, N + 1, n) are on the path at every knot; P may be 0.
    """

    def __init__(
        self, problem: Problem, grid: Array, rng: np.random.Generator, *, nodes: int = 300, layers: int = 6
    ) -> None:
        self.problem, self.grid, self.rng = problem, grid, rng
        self.manifold = OnMovingBase(problem) if problem.task.arm.base.count else Manifold(problem)
        self.closed = problem.boundary is Boundary.CYCLIC
        self.times = _layers(problem, grid, layers, nodes) if self.closed else _spread(grid, layers)
        self.nodes = Sampler(self.manifold, self.times, nodes, rng).layers()
        self._more = 1  # times as many nodes of each layer as `random` would need without velocity limits
        self.edges: Edges = []
        if min(map(len, self.nodes)):
            self.edges = self._costs(problem.bounds.velocity[self.manifold.joints])

    def cheapest(self, most: int) -> Array:
        """At most `most` of the cheapest motions through every node, cheap and spread out."""
        if not self.edges:
            return self._none
        paths, costs = self._paths(self.edges)
        if not len(paths):  # too fast everywhere: what is nearest to the limits is for the solver to find
            self.edges = self._costs(np.full_like(self.problem.bounds.velocity[self.manifold.joints], np.inf))
            paths, costs = self._paths(self.edges)
        coarse, costs = self._unwound(paths, costs)
        if not len(coarse):
            return self._none
        revolute = self.problem.task.arm.description.revolute
        motions = self._on_grid(coarse[diverse(coarse, costs, PRICED * most, APART, revolute)])
        if not len(motions):
            return motions
        return motions[diverse(motions, self.manifold.cost(self.grid, motions), most, APART, revolute)]

    def random(self, count: int) -> Array:
        """About `count` motions through few random nodes of each layer: dearer ones, that end in other optima."""
        found: list[Array] = []
        for _ in range(count):
            if not self.edges or sum(map(len, found)) >= count:
                break
            size = self._more * int(self.rng.integers(2, FEW + 1))
            few = [np.sort(self.rng.choice(len(layer), min(size, len(layer)), replace=False)) for layer in self.nodes]
            if self.closed:
                few[-1] = few[0]
            paths, _ = self._paths([edge[np.ix_(*ends)] for edge, *ends in zip(self.edges, few, few[1:], strict=False)])
            if not len(paths):  # too fast, all of them
                self._more *= 2
                continue
            some = paths[self.rng.permutation(len(paths))[:FEW]]
            found.append(np.stack([nodes[column] for nodes, column in zip(few, some.T, strict=True)], axis=1))
        if not found:
            return self._none
        coarse, _ = self._unwound(np.concatenate(found), np.zeros(sum(map(len, found))))
        return self._on_grid(coarse)[:count]

    @property
    def _none(self) -> Array:
        return np.empty((0, len(self.grid), self.manifold.n))

    def _costs(self, velocity: Array) -> Edges:
        return edge_costs(self.manifold, self.times, self.nodes, velocity)

    def _paths(self, edges: Edges) -> tuple[NDArray[np.int_], Array]:
        return closed_paths(edges) if self.closed else through_every_node(edges)

    def _unwound(self, paths: NDArray[np.int_], costs: Array) -> tuple[Array, Array]:
        """The nodes (P, L + 1, n) of paths, every joint going the shorter way; without those that do not close."""
        coarse = np.stack([layer[column] for layer, column in zip(self.nodes, paths.T, strict=True)], axis=1)
        coarse[:, 1:] = coarse[:, :1] + np.cumsum(self.manifold.wrap(np.diff(coarse, axis=1)), axis=1)
        if self.closed:  # up to whole turns of those joints alone that nothing limits
            gap = coarse[:, -1] - coarse[:, 0]
            back = np.abs(gap - full_turns(self.problem, coarse[:, 0], coarse[:, -1])).max(axis=1) < CLOSED
            coarse, costs = coarse[back], costs[back]
        return coarse, costs

    def _on_grid(self, coarse: Array) -> Array:
        """The motions between layers, put onto the path at the knots `grid`; without those that lose it."""
        manifold, times, grid = self.manifold, self.times, self.grid
        if not len(coarse):
            return self._none
        at = np.clip(np.searchsorted(times, grid, side="right") - 1, 0, len(times) - 2)
        share = ((grid - times[at]) / (times[at + 1] - times[at]))[:, None]
        wished = np.clip(coarse[:, at] * (1 - share) + coarse[:, at + 1] * share, manifold.lower, manifold.upper)
        motions, arrived = manifold.along(grid, wished)
        return np.asarray(motions[arrived])


def _spread(grid: Array, layers: int) -> Array:
    """The times (layers + 1,) [s] of the layers, as even as the knots `grid`."""
    return np.interp(np.linspace(0, len(grid) - 1, layers + 1), np.arange(len(grid)), grid)


def _layers(problem: Problem, grid: Array, layers: int, nodes: int) -> Array:
    """The same for a cycle: more layers where it goes round the arm's first joint. Between layers every joint goes the
    shorter way, and the straight one that is priced; through large turns neither leads along the path.
    """
    turns = _turns(problem, grid)
    if abs(turns.sum()) < np.pi:
        return _spread(grid, layers)
    most = max(layers, int(np.sqrt(MOST_PLACES / nodes)))
    counts = (count for count in range(layers, most) if np.abs(_turns(problem, _spread(grid, count))).max() <= TURN)
    return _spread(grid, next(counts, most))


def _turns(problem: Problem, times: Array) -> Array:
    """By how much (K,) [rad] the path turns about the axis of the arm's first joint between `times` (K + 1,) [s]."""
    chain, axes = Chain.of(problem.task.arm), ["xyz".index(axis) for axis in problem.task.axes]
    frame = chain.turn[0]
    ray = np.zeros((len(times), 3))
    ray[:, axes] = problem.reference.position(times)[:, : len(axes)] - chain.shift[0][axes]
    angle = np.arctan2(ray @ frame[:, 1], ray @ frame[:, 0])
    return np.asarray(wrap(np.diff(angle), np.array(True)))


def edge_costs(manifold: Manifold, times: Array, nodes: list[Array], velocity: Array) -> Edges:
    """Of every pair of neighbours 1/2 d'G d/dt of the joints, G the mean of both ends' metrics; infinite beyond
    `velocity` (joints,).
    """
    roots = [np.linalg.cholesky(manifold.metric(layer)) for layer in nodes]
    n, edges = len(velocity), []
    for i, dt in enumerate(np.diff(times)):
        d = manifold.wrap(nodes[i + 1][None] - nodes[i][:, None])[..., manifold.joints]
        d = d.transpose(2, 0, 1).astype(np.float32)
        cost = np.zeros(d.shape[1:], np.float32)
        for column in range(n):  # |L'd|^2 for both ends' roots
            for root, axes in ((roots[i + 1], np.s_[None, :]), (roots[i], np.s_[:, None])):
                part = sum(d[j] * root[:, j, column].astype(np.float32)[axes] for j in range(column, n))
                cost += np.square(part)
        cost *= np.float32(0.25 / dt)
        for joint in np.flatnonzero(np.isfinite(velocity)):
            cost[np.abs(d[joint]) > SLACK * velocity[joint] * dt] = np.inf
        edges.append(cost)
    return edges


class Sampler:
    """The layers' nodes."""

    def __init__(self, manifold: Manifold, times: Array, count: int, rng: np.random.Generator) -> None:
        self.manifold, self.times, self.count, self.rng = manifold, times, count, rng
        self.x, self.last = manifold.problem.reference.position(times), len(times) - 1
        self.given = manifold.problem.q_init[None] if manifold.problem.boundary is Boundary.FIXED else None
        self.parts: list[list[Array]] = [[] for _ in times]

    def layers(self) -> list[Array]:
        closed = self.manifold.problem.boundary is Boundary.CYCLIC
        for layer in range(0 if self.given is None else 1, self.last if closed else self.last + 1):
            self.parts[layer].append(self._drawn(layer, self.count // 2))
        first = max(1, self.last // 4) if self.given is not None else 0
        bases = sorted({first, self.last // 2, self.last})
        for base in bases:
            drawn = self._drawn(base, max(1, self.count // 2 // len(bases)))
            self.parts[base].append(drawn)
            self._carry(drawn, base, 1)
            self._carry(drawn, base, -1)
        if self.given is not None:
            self._carry(self.given, 0, 1)
            self.parts[0] = [self.given]
        if closed:
            self.parts[-1] = self.parts[0]
        return [np.concatenate(part) for part in self.parts]

    def _drawn(self, layer: int, count: int) -> Array:
        draw = self.manifold.draw if layer else self.manifold.first
        return draw(self.x[layer], count, self.rng)

    def _carry(self, q: Array, layer: int, direction: int) -> None:
        """Along the path to its end, as far as the limits allow, in two steps from layer to layer."""
        # Where a motion begins, a base that moves stands where it stands.
        first = 1 if self.given is not None or self.manifold.problem.task.arm.base.count else 0
        end = self.last if direction > 0 else first
        while (end - layer) * direction > 0 and len(q):
            ahead = layer + direction
            half = 0.5 * (self.times[ahead] - self.times[layer])
            for time in (self.times[ahead] - half, self.times[ahead]):
                target = np.tile(self.manifold.problem.reference.position(np.array([time])), (len(q), 1))
                if len(q):
                    q = self.manifold.wait(q, half)
                    q, arrived = self.manifold.project(q, target, self.manifold.metric(q), steps=10)
                    q = q[arrived]
                    q = q[self.manifold.allowed(q)]
            layer = ahead
            self.parts[layer].append(self.manifold.home(q))
