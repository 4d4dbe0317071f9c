"""Cheapest paths through a layered graph (Bellman 1957): nodes (n_i,) in layers 0 .. L, edge costs (n_i, n_(i+1))."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from pipeline.common.arrays import Array

Edges = list[NDArray[np.float32]]
ROWS = 8  # of a min-plus product at a time


def through_every_node(edges: Edges) -> tuple[NDArray[np.int_], Array]:
    """For every node of every layer the cheapest path through it, each once: node numbers (P, L + 1), costs (P,)."""
    forth, before = _sweep(edges)
    back, after = _sweep([edge.T for edge in reversed(edges)])
    back, after = back[::-1], after[::-1]
    paths, costs = [], []
    for layer in range(len(edges) + 1):
        total = forth[layer] + back[layer]
        nodes = np.flatnonzero(np.isfinite(total))
        columns = {layer: nodes}
        for j in range(layer, 0, -1):
            columns[j - 1] = before[j - 1][columns[j]]
        for j in range(layer, len(edges)):
            columns[j + 1] = after[j][columns[j]]
        paths.append(np.stack([columns[j] for j in range(len(edges) + 1)], axis=1))
        costs.append(total[nodes])
    every, first = np.unique(np.concatenate(paths), axis=0, return_index=True)
    return every, np.concatenate(costs)[first].astype(float)


def closed_paths(edges: Edges) -> tuple[NDArray[np.int_], Array]:
    """For every node of layer 0 the cheapest path that ends in it again, as node numbers (P, L + 1), and costs (P,)."""
    reach = [edges[0]]
    for edge in edges[1:]:
        reach.append(_min_plus(reach[-1], edge))
    costs = np.diag(reach[-1])
    begin = np.flatnonzero(np.isfinite(costs))
    columns = [begin]
    for i in range(len(edges) - 1, 0, -1):
        columns.insert(0, (reach[i - 1][begin] + edges[i][:, columns[0]].T).argmin(axis=1))
    return np.stack([begin, *columns], axis=1), costs[begin].astype(float)


def _sweep(edges: Edges) -> tuple[list[Array], list[NDArray[np.int_]]]:
    """The least cost to come to every node of every layer, and from which node of the layer before."""
    cost, before = [np.zeros(len(edges[0]), np.float32)], []
    for edge in edges:
        total = cost[-1][:, None] + edge
        best = total.argmin(axis=0)
        before.append(best)
        cost.append(total[best, np.arange(total.shape[1])])
    return cost, before


def _min_plus(a: Array, b: Array) -> NDArray[np.float32]:
    out = np.empty((len(a), b.shape[1]), np.float32)
    for k in range(0, len(a), ROWS):
        out[k : k + ROWS] = (a[k : k + ROWS, :, None] + b[None]).min(axis=1)
    return out
