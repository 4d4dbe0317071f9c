"""Bellman's recursion over the grid of the self-motion manifolds (r = 1): cheapest paths from node to node.

V_i(b) = min_a V_(i-1)(a) + c_i(a, b), the cost c_i of interval i by backward differences (`grid.py`), over all pairs of
nodes of neighbouring knots, so that it needs no assumption on how the manifold changes along the path.
"""

from __future__ import annotations

from itertools import pairwise

import numpy as np

from pipeline.common.arrays import Array
from pipeline.model.kinematics import wrap
from pipeline.problem.problem import Boundary, Problem
from pipeline.search.grid import Grid, Index, make_grid
from pipeline.search.selection import distinct

STRIDE = 8  # first spacing, in nodes, of the starts that a cyclic problem is solved from


def starts(problem: Problem, times: Array, nodes: int = 180, same_path: float = 0.2) -> Array:
    """Motions (K, N + 1, n) [rad] on the knots `times`, best first: one for each valley that the grid shows.

    A velocity limit may be exceeded by one node spacing per step: the solver that starts here will keep it.
    """
    motions, costs = paths(make_grid(problem, times, nodes, velocity_slack=1.0), problem.boundary)
    return motions[distinct_paths(problem, motions, costs, same_path)]


def distinct_paths(problem: Problem, motions: Array, costs: Array, same_path: float) -> list[int]:
    """Indices of distinct motions of finite cost, best first; shifted in place by full turns into the limits."""
    revolute, bounds = problem.task.arm.description.revolute, problem.bounds
    turns = np.where(revolute & np.isfinite(bounds.lower), 2 * np.pi, 0.0)
    lowest = motions.min(axis=1) - bounds.lower
    shift = np.where(turns > 0, np.floor((lowest + 1e-9) / (2 * np.pi)), 0.0)
    motions -= (turns * shift)[:, None]
    inside = np.all((motions <= bounds.upper + 1e-8) & (motions >= bounds.lower - 1e-8), axis=(1, 2))
    if problem.boundary is Boundary.FIXED:
        inside &= np.abs(motions[:, 0] - problem.q_init).max(axis=1, initial=0.0) < 1e-9
    usable = np.flatnonzero(np.isfinite(costs) & inside)
    return [int(usable[i]) for i in distinct(motions[usable], costs[usable], len(usable), same_path, revolute)]


def forward(grid: Grid, start: Array) -> tuple[Array, list[Index]]:
    """From values (K_0,) at the first knot: values (K_N,) at the last and the best predecessors of every interval."""
    value = start
    best: list[Index] = []
    for i in range(len(grid.layers) - 1):
        size = len(grid.layers[i + 1].q)
        after, chosen = np.empty(size), np.empty(size, dtype=np.intp)
        for rows, cost in grid.steps(i):
            cost += value
            chosen[rows] = cost.argmin(axis=1)
            after[rows] = cost[np.arange(len(cost)), chosen[rows]]
        value = after
        best.append(chosen)
    return value, best


def backward(grid: Grid) -> tuple[Array, list[Index]]:
    """The same from the end: least costs (K_0,) to go from the first knot, and the best successors."""
    value = np.zeros(len(grid.layers[-1].q))
    best: list[Index] = []
    for i in range(len(grid.layers) - 2, -1, -1):
        size = len(grid.layers[i].q)
        before, chosen = np.full(size, np.inf), np.zeros(size, dtype=np.intp)
        for rows, cost in grid.steps(i):
            cost += value[rows, None]
            row = cost.argmin(axis=0)
            least = cost[row, np.arange(size)]
            better = least < before
            before[better], chosen[better] = least[better], row[better] + rows.start
        value = before
        best.insert(0, chosen)
    return value, best


def round_trips(grid: Grid, starts: Index) -> Array:
    """Least costs (S,) of the closed paths through each of the nodes `starts` (S,) of the first and last knot."""
    value = np.full((len(starts), len(grid.layers[0].q)), np.inf)
    value[np.arange(len(starts)), starts] = 0.0
    last = len(grid.layers) - 2
    for i in range(last):
        after = np.empty((len(starts), len(grid.layers[i + 1].q)))
        for rows, cost in grid.steps(i):
            for s in range(len(starts)):
                after[s, rows] = (cost + value[s]).min(axis=1)
        value = after
    closing = np.concatenate([cost for _, cost in grid.steps(last, starts)])
    return np.asarray((closing + value).min(axis=1))


def minima(value: Array, loops: tuple[int, ...], reach: int = 1) -> Index:
    """Nodes (P,) whose finite value is the least of all within `reach` nodes along their loop."""
    out, first = [], 0
    for size in loops:
        part = value[first : first + size]
        shifts = range(1, min(reach, size - 1) + 1)
        least = np.isfinite(part)
        for shift in shifts:
            least &= (part <= np.roll(part, shift)) & (part < np.roll(part, -shift))
        out.append(first + np.flatnonzero(least))
        first += size
    return np.concatenate(out)


def paths(grid: Grid, boundary: Boundary) -> tuple[Array, Array]:
    """Motions (P, N + 1, n) [rad] through the local minima of the value functions, and their costs (P,) [J s].

    Fixed and free: the minima of the least cost to reach a node of the last knot and, as a second valley may end where
    a better one does, of the least cost to go from a node of the first. Cyclic: of the closed paths by their start.
    """
    if boundary is Boundary.CYCLIC:
        return _cyclic_paths(grid)
    arrive, before = forward(grid, np.zeros(len(grid.layers[0].q)))
    chosen = _backtrack(before, minima(arrive, grid.layers[-1].loops))
    costs = arrive[chosen[:, -1]]
    if boundary is Boundary.FREE:
        leave, after = backward(grid)
        nodes = [minima(leave, grid.layers[0].loops)]
        for best in after:
            nodes.append(best[nodes[-1]])
        chosen = np.concatenate([chosen, np.stack(nodes, axis=1)])
        costs = np.concatenate([costs, leave[nodes[0]]])
    return _unwound(grid, chosen), costs


def _cyclic_paths(grid: Grid) -> tuple[Array, Array]:
    """Starts STRIDE nodes apart, then each local minimum of their costs refined by halving the distance."""
    layer = grid.layers[0]
    size = len(layer.q)
    cost = np.full(size, np.inf)
    first = np.arange(0, size, STRIDE)
    cost[first] = round_trips(grid, first)
    ends = np.cumsum((0, *layer.loops))
    pieces = tuple(int(((first >= low) & (first < high)).sum()) for low, high in pairwise(ends))
    best = first[minima(cost[first], pieces)]
    low = ends[np.searchsorted(ends, best, side="right") - 1]
    length = ends[np.searchsorted(ends, best, side="right")] - low
    tried = np.isin(np.arange(size), first)
    distance = STRIDE // 2
    while distance:
        around = low[:, None] + (best[:, None] - low[:, None] + np.array([-distance, 0, distance])) % length[:, None]
        new = np.unique(around[~tried[around]])
        if len(new):
            cost[new], tried[new] = round_trips(grid, new), True
        best = around[np.arange(len(best)), cost[around].argmin(axis=1)]
        distance //= 2
    chosen = []
    for node in np.unique(best):
        start = np.full(size, np.inf)
        start[node] = 0.0
        _, before = forward(grid, start)
        chosen.append(_backtrack(before, np.array([node])))
    nodes = np.concatenate(chosen) if chosen else np.empty((0, len(grid.layers)), dtype=np.intp)
    return _unwound(grid, nodes), cost[nodes[:, 0]]


def _backtrack(before: list[Index], last: Index) -> Index:
    nodes = [last]
    for best in reversed(before):
        nodes.append(best[nodes[-1]])
    return np.stack(nodes[::-1], axis=1)


def _unwound(grid: Grid, nodes: Index) -> Array:
    """Continuous joint motions (P, N + 1, n) through node numbers (P, N + 1)."""
    q = np.stack([layer.q[column] for layer, column in zip(grid.layers, nodes.T, strict=True)], axis=1)
    change = wrap(np.diff(q, axis=1), grid.turning)
    return np.concatenate([q[:, :1], q[:, :1] + np.cumsum(change, axis=1)], axis=1)
