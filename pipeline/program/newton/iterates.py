"""What Newton's method for many motions keeps of each start: its iterate, its direction, and where it ended."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pipeline.common.arrays import Array
from pipeline.program.newton.motion import PerStart, Point

Mask = NDArray[np.bool_]


@dataclass
class Answer:
    """Per start: motions q (S, N + 1, n), cost (S,), converged, iterations (S,), the largest error of the path (S,),
    whether it was given up as too dear (S,), whether one that did not converge was nearly there, and wall_time [s] of
    all.
    """

    q: Array
    cost: Array
    converged: Mask
    iterations: NDArray[np.int_]
    residual: Array
    dear: Mask
    nearly: Mask
    wall_time: float = 0.0


@dataclass
class State(PerStart):
    """One iterate of every start: unknowns, slacks and multipliers of limits, the barrier, the filter."""

    number: NDArray[np.int_]
    x: Array
    begin: Array
    scale: Array
    slack: Array
    excess: Array
    z: Array
    mu: Array
    nu: Array
    seen_theta: Array
    seen_phi: Array
    short: NDArray[np.int_]
    point: Point

    def take(self, rows: NDArray[Any]) -> State:
        point, self.point = self.point, self.number  # type: ignore[assignment]
        part = super().take(rows)
        part.point, self.point = point.take(rows), point
        return part


@dataclass
class Step(PerStart):
    """A direction: d (S, U, n), changes of slack, excess and multipliers (S, L), the predicted decrease; and of the
    iterate the merit phi with its slope, and what is missed of path and slacks, theta.
    """

    d: Array
    slack: Array
    excess: Array
    z: Array
    nu: Array
    decrement: Array
    slope: Array
    theta: Array
    phi: Array
