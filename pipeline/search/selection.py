"""Which of many motions are kept: distinct optima, and cheap ones that are spread out."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from pipeline.common.arrays import Array
from pipeline.model.kinematics import wrap


def path_distance(a: Array, b: Array, revolute: NDArray[np.bool_]) -> float:
    """Largest joint difference [rad] between two motions (N + 1, n) on the same knots, full turns not counted."""
    return float(np.abs(wrap(a - b, revolute)).max())


def distinct(motions: Array, costs: Array, most: int, same: float, revolute: NDArray[np.bool_]) -> list[int]:
    """Indices of the cheapest motions, best first, no two closer than `same` [rad]; at most `most`."""
    return _pick([], motions, costs, most, same, revolute)


def diverse(motions: Array, costs: Array, most: int, same: float, revolute: NDArray[np.bool_]) -> list[int]:
    """Indices of `most` cheap motions that are spread out: first the best of those far apart, then nearer ones.

    The cheapest alone lie all around one optimum: on the Global paper's line the best 48 of 1521 lead to the same one.
    """
    kept: list[int] = []
    radius = 1.6  # [rad]
    while len(kept) < most and radius > same / 2:
        kept = _pick(kept, motions, costs, most, radius, revolute)
        radius /= 2
    return kept


def _pick(
    kept: list[int], motions: Array, costs: Array, most: int, apart: float, revolute: NDArray[np.bool_]
) -> list[int]:
    kept = list(kept)

    def distance(index: int) -> Array:
        return np.asarray(np.abs(wrap(motions - motions[index], revolute)).max(axis=(1, 2)))

    nearest = np.full(len(motions), np.inf)  # of those that are kept
    for index in kept:
        nearest = np.minimum(nearest, distance(index))
    for index in np.argsort(costs, kind="stable"):
        if len(kept) >= most:
            break
        if nearest[index] > apart:
            kept.append(int(index))
            nearest = np.minimum(nearest, distance(index))
    return kept
