"""With how much clearance a continuous motion can follow a path among obstacles: where r = 1, by the manifold grid.

Of all ways through the nodes the one whose nearest node to an obstacle is farthest off, found by halving: nodes that
are nearer than a distance are left out, and what remains leads from the path's start to its end or does not.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components
from scipy.spatial.distance import cdist

from pipeline.model.clearance import Clearance
from pipeline.problem.problem import Problem
from pipeline.search.continuity import NEAR, around, components

RESOLVED = 1e-5  # [m]


def widest(problem: Problem, count: int, nodes: int, rng: np.random.Generator) -> float | None:
    """The largest margin [m] from obstacles, at most the problem's, that leaves a way; below zero: it leads through
    them. None: there is none without them either. For r = 1, on a grid as that of `components`.
    """
    assert problem.obstacles is not None
    most = problem.obstacles.margin
    found = components(replace(problem, obstacles=None), count, nodes, rng)
    clearance = Clearance(problem.task.arm, problem.obstacles)
    off = [clearance.distances(q, most) for q in found.nodes]
    first = np.concatenate([[0], np.cumsum([len(q) for q in found.nodes])])
    ends = [np.empty((2, 0), int)]
    for i, q in enumerate(found.nodes):
        places = around(q, found.turning)
        ends.append(first[i] + np.array(np.nonzero(np.triu(cdist(places, places) <= NEAR * found.spacing))))
    for i, (here, there) in enumerate(found.steps):
        ends.append(np.array([first[i] + here, first[i + 1] + there]))
    edges, distances = np.concatenate(ends, axis=1), np.concatenate(off)
    begin, end = slice(first[0], first[1]), slice(first[-2], first[-1])

    def leads(margin: float) -> bool:
        kept = distances >= margin
        return _leads(edges[:, kept[edges].all(axis=0)], kept, begin, end)

    low, high = float(distances.min(initial=most)), most
    if not leads(low):
        return None
    while high - low > RESOLVED:
        middle = (low + high) / 2
        low, high = (middle, high) if leads(middle) else (low, middle)
    return low


def _leads(edges: NDArray[np.int_], kept: NDArray[np.bool_], begin: slice, end: slice) -> bool:
    size = len(kept)
    graph = coo_array((np.ones(edges.shape[1], np.int8), tuple(edges)), shape=(size, size))
    labels = connected_components(graph, directed=False)[1]
    return bool(np.intersect1d(labels[begin][kept[begin]], labels[end][kept[end]]).size)
