"""A bound from below for every motion on given knots, at redundancy degree 1, and what is left to look at.

Every knot's self-motion loops are divided into cells; a motion goes from cell to cell. With any functions W_i of the
place on the loops of knot i its cost is W_0(q_0) + sum_i g_i, W_N = 0, where
    g_i(a, b) = c_i(a, b) + W_(i+1)(b) - W_i(a)
telescopes (the dual of Bellman's recursion). W_i is the cost to go, by that recursion from the end, a quadratic in each
cell. In a pair of cells c_i is a quadratic too, up to an error of third order in their width, and a quadratic's least
value on a square has a closed form: less the error it bounds g_i there. A recursion over cells adds the bounds up: what
exceeds an incumbent is dropped, what is left is halved.
A cycle ends in the cell where it began: one group of cells for each such cell, with W_N = l (t - s), the place at the
end less that at the beginning, which vanishes for a cycle whatever l is.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from pipeline.common.arrays import Array
from pipeline.problem.problem import Boundary, Problem
from pipeline.search.cells import Cells, Curves, Index
from pipeline.search.pairs import Pairs, Steps, pairs_of
from pipeline.search.quadratics import ENDS, FIT_NINE, THROUGH, lowest, lowest_on_square

WELL = 0.5  # times the incumbent: what a cycle pays that ends elsewhere, while its multiplier is sought


@dataclass(frozen=True)
class Graph:
    """Which cells of neighbouring knots motions go through: states (S,), each a cell of a group, ordered by layer; and
    links (L,) from state to state, ordered by `begin`.
    """

    cell: Index
    group: Index
    begin: Index
    end: Index

    @property
    def groups(self) -> int:
        return int(self.group.max(initial=-1)) + 1


class Cover:
    """The cells and links that may hold a motion cheaper than an incumbent; refined round by round."""

    def __init__(self, problem: Problem, times: Array, count: int) -> None:
        self.last = len(times) - 1
        dt = np.diff(times)
        limit = dt[:, None] * problem.bounds.velocity
        self.steps = Steps(dt, limit, np.zeros_like(limit))
        self.cells: Cells = Curves(problem, times).cells(count)
        self.cycle, self.closed = problem.boundary is Boundary.CYCLIC, False
        cell = np.flatnonzero(self.cells.allowed)
        at = np.searchsorted(self.cells.layer[cell], np.arange(self.last + 2))
        sizes = np.diff(at)
        begin = [np.repeat(np.arange(at[i], at[i + 1]), sizes[i + 1]) for i in range(self.last)]
        end = [np.tile(np.arange(at[i + 1], at[i + 2]), sizes[i]) for i in range(self.last)]
        self.graph = Graph(cell, np.zeros_like(cell), np.concatenate(begin), np.concatenate(end))

    def price(self, of_limits: Array) -> None:
        """What velocity limits cost (N, n), from now on (`prices.py`)."""
        self.steps = replace(self.steps, price=of_limits)

    @property
    def finished(self) -> bool:
        """Whether `bound` speaks of the problem itself, and not of cycles that need not close."""
        return self.closed or not self.cycle

    def bound(self, incumbent: float) -> None:
        """Find `through` (L,), the least cost of a motion through each link, and of all `least_cost`, infinite if there
        is no link; incumbent: the size of the costs that matter.
        """
        pairs = self._pairs()
        layer = self.layer
        first, last = layer == 0, layer == self.last
        cost_to_go = np.zeros((len(layer), 3))
        if self.closed:
            slope = self._multipliers(pairs, incumbent)
            cost_to_go[last, 1] = slope[self.graph.group[last]]
        self._to_go(pairs, cost_to_go)
        before = cost_to_go.copy()
        before[first] = 0.0
        if self.closed:
            before[first, 1] = slope[self.graph.group[first]]
        change = pairs.cost
        change[[0, 2, 5]] += cost_to_go[self.graph.end].T
        change[[0, 1, 3]] -= before[self.graph.begin].T
        self.least = lowest_on_square(change) - pairs.error
        self.arrive = self._recursion(np.where(first, 0.0, np.inf)[:, None])[:, 0]
        self.leave = self._recursion(np.where(last, 0.0, np.inf)[:, None], back=True)[:, 0]
        self.through = self.arrive[self.graph.begin] + self.least + self.leave[self.graph.end]
        self.least_cost = float(self.through.min(initial=np.inf))

    @property
    def layer(self) -> Index:
        """Of every state."""
        return self.cells.layer[self.graph.cell]

    def left(self, incumbent: float) -> int:
        """The number of links through which a motion cheaper than the incumbent may go."""
        return int((self.through <= incumbent).sum())

    def expected(self, incumbent: float) -> int:
        """The number of links of the next round, before the impossible are dropped."""
        return self.left(incumbent) * (8 if self.closed else 4)

    def refine(self, incumbent: float) -> None:
        """Drop what holds no motion cheaper than the incumbent, and halve the rest."""
        graph, keep = self.graph, self.through <= incumbent
        states, ends = np.unique(np.r_[graph.begin[keep], graph.end[keep]], return_inverse=True)
        begin, end = np.split(ends, 2)
        kept, cell = np.unique(graph.cell[states], return_inverse=True)
        layer, group = self.layer[states], graph.group[states]
        self.cells = self.cells.halved(kept)
        parts = 2 if self.closed else 1  # a group's cell is halved too: two groups
        exists = np.repeat(self.cells.allowed[2 * cell[:, None] + [0, 1]][:, None], parts, axis=1)
        if self.closed:
            exists[(layer == 0) | (layer == self.last)] &= np.eye(2, dtype=bool)
        number = np.where(exists.ravel(), np.cumsum(exists) - 1, -1).reshape(exists.shape)
        state, part, half = np.nonzero(exists)
        ways = [(p, a, b) for p in range(parts) for a in (0, 1) for b in (0, 1)]
        begin = np.concatenate([number[begin, p, a] for p, a, _ in ways])
        end = np.concatenate([number[end, p, b] for p, _, b in ways])
        _, groups = np.unique(parts * group[state] + part, return_inverse=True)
        self.graph = _ordered(2 * cell[state] + half, groups, begin, end, (begin >= 0) & (end >= 0))

    def close(self, incumbent: float, most: int) -> bool:
        """From motions that may end anywhere to cycles: one group for each cell where one begins and ends. Nothing is
        done, and False returned, if that makes more than `most` links.
        """
        graph, cells = self.graph, self.cells
        place = [(int(cells.loop[c]), float(cells.low[c])) for c in graph.cell]
        layer = self.layer
        begins = {place[s]: s for s in np.flatnonzero(layer == 0)}
        ends = {place[s]: s for s in np.flatnonzero(layer == self.last)}
        both = [(begins[p], ends[p]) for p in begins if p in ends]
        count = len(both)
        at_begin, at_end = np.full((2, len(layer), count), np.inf)
        for number, (start, stop) in enumerate(both):
            at_begin[start, number] = at_end[stop, number] = 0.0
        arrive, leave = self._recursion(at_begin), self._recursion(at_end, back=True)
        links: list[Index] = []
        groups: list[Index] = []
        for first in range(0, len(graph.begin), 1024):
            part = slice(first, first + 1024)
            through = arrive[graph.begin[part]] + self.least[part, None] + leave[graph.end[part]]
            some, of_group = np.nonzero(through <= incumbent)
            links.append(some + first)
            groups.append(of_group)
            if sum(map(len, links)) > most:
                return False
        link, of_link = np.concatenate(links), np.concatenate(groups)
        begin, end = graph.begin[link] * count + of_link, graph.end[link] * count + of_link
        states = np.unique(np.r_[begin, end])
        _, numbers = np.unique(states % max(1, count), return_inverse=True)
        begin, end = np.searchsorted(states, begin), np.searchsorted(states, end)
        self.graph = _ordered(graph.cell[states // max(1, count)], numbers, begin, end, np.ones(len(begin), bool))
        self.closed = True
        return True

    def motions(self, incumbent: float) -> tuple[Array, Array]:
        """Through every cell that is left at some knots, the motion (P, N + 1, n) along the cells' middles for which
        the bound is least, and that bound (P,).
        """
        graph, layer = self.graph, self.layer
        size = len(layer)
        before = _best(graph.end, self.arrive[graph.begin] + self.least, graph.begin, size)
        after = _best(graph.begin, self.leave[graph.end] + self.least, graph.end, size)
        bounds = self.arrive + self.leave
        found, costs = [], []
        for knot in np.unique(np.linspace(0, self.last, 5).astype(int)):
            states = np.flatnonzero((layer == knot) & (bounds <= incumbent))
            columns = {knot: states}
            for i in range(knot, 0, -1):
                columns[i - 1] = before[columns[i]]
            for i in range(knot, self.last):
                columns[i + 1] = after[columns[i]]
            found.append(np.stack([columns[i] for i in range(self.last + 1)], axis=1))
            costs.append(bounds[states])
        paths, first = np.unique(np.concatenate(found), axis=0, return_index=True)
        q = self.cells.q[graph.cell[paths], 2]
        change = np.diff(q, axis=1)
        change -= np.where(self.cells.curves.turning, 2 * np.pi, 0.0) * np.rint(change / (2 * np.pi))
        motions = np.concatenate([q[:, :1], q[:, :1] + np.cumsum(change, axis=1)], axis=1)
        return motions, np.concatenate(costs)[first]

    def _pairs(self) -> Pairs:
        """Of all links; those that are impossible are dropped."""
        graph, cells = self.graph, self.cells
        first, second = graph.cell[graph.begin], graph.cell[graph.end]
        numbers, link = np.unique(first * len(cells.layer) + second, return_inverse=True)
        first, second = np.divmod(numbers, len(cells.layer))
        pairs = pairs_of(cells, first, second, self.steps)
        possible = pairs.possible[link]
        self.graph = Graph(graph.cell, graph.group, graph.begin[possible], graph.end[possible])
        return pairs.take(link[possible])

    def _to_go(self, pairs: Pairs, cost: Array) -> None:
        """Bellman's recursion from the last layer's costs (S, 3), coefficients by place, into those of the others."""
        graph = self.graph
        cut = np.searchsorted(self.layer[graph.begin], np.arange(self.last + 1))
        for i in range(self.last - 1, -1, -1):
            part = slice(cut[i], cut[i + 1])
            begin, beyond, of_layer = graph.begin[part], cost[graph.end[part]].T, pairs.take(part)
            if not len(begin):
                continue
            heads = _heads(begin)
            least = [np.minimum.reduceat(_to_go(of_layer, s, beyond), heads) for s in ENDS]
            cost[begin[heads]] = np.stack(least, axis=1) @ THROUGH

    def _recursion(self, values: Array, *, back: bool = False) -> Array:
        """From values (S, K) at the first layer's states, infinite elsewhere, the least sums to arrive at every state;
        `back`: from the last layer's.
        """
        graph, values = self.graph, values.copy()
        source, target = (graph.end, graph.begin) if back else (graph.begin, graph.end)
        order = np.argsort(target, kind="stable")
        source, target, least = source[order], target[order], self.least[order]
        cut = np.searchsorted(self.layer[target], np.arange(self.last + 2))
        for i in range(self.last - 1, -1, -1) if back else range(1, self.last + 1):
            part = slice(cut[i], cut[i + 1])
            if cut[i] == cut[i + 1]:
                continue
            heads = _heads(target[part])
            sums = values[source[part]] + least[part, None]
            values[target[part][heads]] = np.minimum.reduceat(sums, heads, axis=0)
        return values

    def _multipliers(self, pairs: Pairs, incumbent: float) -> Array:
        """l (groups,): where the cost K(s, t) from s to t in a group's cell is least for s = t, l = dK/ds = -dK/dt."""
        graph, layer = self.graph, self.layer
        first, last = layer == 0, layer == self.last
        between = np.zeros((graph.groups, 3, 3))
        for column, t in enumerate(ENDS):
            cost = np.zeros((len(layer), 3))
            cost[last] = WELL * incumbent * np.array([t * t, -2 * t, 1.0])
            self._to_go(pairs, cost)
            between[graph.group[first], :, column] = cost[first] @ np.vander(ENDS, increasing=True).T
        k = (between.reshape(-1, 9) @ FIT_NINE).T
        slope, bend = k[1] + k[2], k[3] + k[4] + k[5]
        with np.errstate(all="ignore"):
            bottom = np.clip(-slope / (2 * bend), 0, 1)
        place = np.where(bend > 0, bottom, np.where(slope + bend < 0, 1.0, 0.0))
        by_begin, by_end = k[1] + (2 * k[3] + k[4]) * place, k[2] + (2 * k[5] + k[4]) * place
        return np.asarray((by_begin - by_end) / 2)


def _to_go(pairs: Pairs, s: float, beyond: Array) -> Array:
    """Of a pair's cost from place s, plus what is `beyond` (3, P) of the place in the second cell, the least (P,)."""
    k = pairs.cost
    return lowest(k[0] + s * (k[1] + s * k[3]) + beyond[0], k[2] + s * k[4] + beyond[1], k[5] + beyond[2])


def _heads(ordered: Index) -> Index:
    """Where a new number begins."""
    return np.flatnonzero(np.r_[True, np.diff(ordered) != 0])


def _best(key: Index, value: Array, other: Index, size: int) -> Index:
    """For every key below `size` the `other` of least value; -1 where there is none."""
    order = np.lexsort((value, key))
    best = np.full(size, -1, dtype=np.intp)
    if len(order):
        heads = order[_heads(key[order])]
        best[key[heads]] = other[heads]
    return best


def _ordered(cell: Index, group: Index, begin: Index, end: Index, keep: NDArray[np.bool_]) -> Graph:
    begin, end = begin[keep], end[keep]
    order = np.argsort(begin, kind="stable")
    return Graph(cell, group, begin[order], end[order])
