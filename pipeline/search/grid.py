"""The grid that dynamic programming runs on: every knot's self-motion manifold sampled, and the cost of each step.

A step from node a to node b costs 1/2 d' G(q_b) d / dt with d = q_b - q_a: for G = M the kinetic-energy integral of one
interval by backward differences (PMKE paper eq. (4), Global paper eq. (5)); a secondary criterion adds its part of the
trapezoidal rule (`lagrangian.py`).
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from pipeline.common.arrays import Array
from pipeline.model.clearance import Clearance
from pipeline.problem.lagrangian import Lagrangian
from pipeline.problem.problem import Boundary, Problem
from pipeline.search.self_motion import manifolds

Index = NDArray[np.intp]


PAIRS = 2**16  # node pairs per batch: what stays in the processor's cache


@dataclass(frozen=True)
class Layer:
    """The nodes of one knot: q (K, n) [rad], L (K, n, n) with G = L L', the gain k0 w (K,), whether they are within
    limits (K,), loop sizes.
    """

    q: Array
    root: Array
    gain: Array
    allowed: NDArray[np.bool_]
    loops: tuple[int, ...]

    def thin(self) -> Layer:
        """Every other node of every loop; a single node stays."""
        if self.loops == (1,):
            return self
        sizes = tuple(size // 2 for size in self.loops)
        return Layer(self.q[::2], self.root[::2], self.gain[::2], self.allowed[::2], sizes)


@dataclass(frozen=True)
class Grid:
    """The layers of all knots; `turning` (n,) are the joints whose differences are taken to the nearest turn."""

    times: Array
    layers: list[Layer]
    turning: NDArray[np.bool_]
    step_limit: Array  # (N, n) [rad] largest joint difference
    spacing: float  # [rad] between nodes

    def thin_nodes(self) -> Grid:
        return replace(self, layers=[layer.thin() for layer in self.layers], spacing=2 * self.spacing)

    def thin_intervals(self) -> Grid:
        """Two intervals as one (an odd one at the end stays)."""
        keep = np.unique([*range(0, len(self.times), 2), len(self.times) - 1])
        limit = np.add.reduceat(self.step_limit, keep[:-1], axis=0)
        return replace(self, times=self.times[keep], layers=[self.layers[i] for i in keep], step_limit=limit)

    def steps(self, i: int, nodes: Index | None = None) -> Iterator[tuple[slice, Array]]:
        """Costs (R, A) [J s] of interval i to R nodes at its end (all, or the given ones) from all A at its start."""
        before, after = self.layers[i], self.layers[i + 1]
        chosen = slice(None) if nodes is None else nodes
        q, root, gain, allowed = after.q[chosen], after.root[chosen], after.gain[chosen], after.allowed[chosen]
        dt = self.times[i + 1] - self.times[i]
        factor = root / np.sqrt(2 * dt)
        start = np.where(before.allowed, -dt / 2 * before.gain, np.inf)
        rows = max(1, PAIRS // len(before.q))
        for first in range(0, len(q), rows):
            part = slice(first, min(first + rows, len(q)))
            difference = [
                _difference(q[part, j, None], before.q[:, j], bool(turns)) for j, turns in enumerate(self.turning)
            ]
            cost = np.zeros((part.stop - part.start, len(before.q)))
            for k in range(len(difference)):
                whitened = sum(factor[part, j, k, None] * difference[j] for j in range(k, len(difference)))
                cost += whitened * whitened
            for j in np.flatnonzero(np.isfinite(self.step_limit[i])):
                cost[np.abs(difference[j]) > self.step_limit[i, j]] = np.inf
            cost += start - dt / 2 * gain[part, None]
            cost[~allowed[part]] = np.inf
            yield part, cost


def _difference(end: Array, start: Array, turning: bool) -> Array:
    gap = end - start
    if turning:
        gap -= 2 * np.pi * np.rint(gap * (0.5 / np.pi))
    return np.asarray(gap)


def make_grid(problem: Problem, times: Array, nodes: int, velocity_slack: float = 0.0) -> Grid:
    """Trace the manifolds of all knots `times` (N + 1,) and evaluate M at their nodes, once each, stacked.

    A joint whose position limits leave at most a turn is represented within them and cannot jump across the gap; one
    that is centred in its range is represented half a turn to either side of the centre.
    """
    task, bounds = problem.task, problem.bounds
    fixed, cyclic = problem.boundary is Boundary.FIXED, problem.boundary is Boundary.CYCLIC
    x = problem.reference.position(times)
    wanted = x[1:] if fixed else x[:-1] if cyclic else x
    all_loops = manifolds(task, wanted, np.random.default_rng(0), nodes=nodes, seeds=problem.q_init[None])
    q = [np.concatenate([loop.q for loop in loops]) for loops in all_loops]
    sizes = [tuple(len(loop.q) for loop in loops) for loops in all_loops]
    if fixed:
        q.insert(0, problem.q_init[None])
        sizes.insert(0, (1,))

    revolute = task.arm.description.revolute
    held = revolute & (bounds.upper - bounds.lower <= 2 * np.pi)
    lowest = np.where(held, bounds.lower, 0.0)
    secondary = problem.objective.secondary
    if secondary is not None and "joint_centering" in secondary.criteria:
        centred = revolute & ~held & np.isfinite(secondary.upper - secondary.lower)
        lowest = np.where(centred, (secondary.upper + secondary.lower) / 2 - np.pi, lowest)
        held |= centred
    turning = revolute & ~held
    flat = np.concatenate(q)
    turns = np.floor((flat - lowest + 1e-9) / (2 * np.pi))
    flat = flat - np.where(held, 2 * np.pi * turns, 0.0)
    within = np.all(turning | ((flat <= bounds.upper + 1e-9) & (flat >= bounds.lower - 1e-9)), axis=1)
    if problem.keeps_clear:
        within[within] = Clearance(task.arm, problem.obstacles, problem.own).clear(flat[within])
    lagrangian = Lagrangian(task, problem.objective)
    root, gain = np.linalg.cholesky(lagrangian.metric(flat)), lagrangian.gain(flat)[0]
    ends = np.cumsum([len(of_knot) for of_knot in q])[:-1]
    parts = zip(*(np.split(values, ends) for values in (flat, root, gain, within)), sizes, strict=True)
    layers = [Layer(*part) for part in parts]
    if cyclic:
        layers.append(layers[0])
    spacing = max(loop.length / len(loop.q) for loop in all_loops[0])
    limit = np.diff(times)[:, None] * bounds.velocity * (1 + 1e-9) + velocity_slack * spacing
    return Grid(times, layers, turning, limit, spacing)
