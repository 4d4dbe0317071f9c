"""The part of the objective that depends on positions and velocities: 1/2 qd' G qd - k0 w(q) (`lagrangian.py`).

The secondary criterion is integrated by the trapezoidal rule: with the velocity norm the program is then of second
order in the step.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pipeline.common.arrays import Array
from pipeline.problem.lagrangian import trapezoid_weights
from pipeline.program.program import Block, Lifted, Program, Rate, blocks
from pipeline.program.scaling import POSITION_SCALE


def quadratic(program: Program) -> None:
    """The sum of 1/2 qd_i' G(q_i) qd_i dt_i over the ends of all intervals."""
    if not program.lagrangian.is_quadratic or program.elastic:
        return
    for block in blocks(0, program.intervals):
        add_sum(program, program.y[block + 1], block)


def add_sum(program: Lifted, places: NDArray[Any], stations: Block) -> None:
    """The same over some stations, by their positions and w."""
    weight = program.weights[stations] / program.scaling.cost
    energy = weighted_sum(program, program.lagrangian.quadratic_gradient, stations, weight)
    program.add_cost(energy, np.concatenate([places.ravel(), program.w[stations].ravel()]))


def weighted_sum(program: Lifted, rate: Rate, block: Block, weight: Array) -> Callable[[Array], tuple[float, Array]]:
    """The sum of weight_i T_i over a block, by (y, w), for T (K,) with its gradients by q and qd."""
    shape, to_velocity = (len(block), program.n), program.scaling.to_velocity[block]
    split = len(block) * program.n

    def energy(x: Array) -> tuple[float, Array]:
        q = x[:split].reshape(shape) / POSITION_SCALE
        velocity = (to_velocity @ x[split:].reshape(*shape, 1))[:, :, 0]
        value, by_q, by_velocity = rate(q, velocity)
        by_y = by_q * weight[:, None] / POSITION_SCALE
        by_w = (by_velocity[:, None, :] @ to_velocity)[:, 0] * weight[:, None]
        return float(value @ weight), np.concatenate([by_y.ravel(), by_w.ravel()])

    return energy


def secondary(program: Lifted) -> None:
    """-k0 w(q_i) with the trapezoidal rule's weights."""
    if program.problem.objective.secondary is None or program.elastic:
        return
    for knots in blocks(0, program.intervals + 1):
        _secondary(program, knots)


def _secondary(program: Lifted, knots: Block) -> None:
    weight = trapezoid_weights(program.times)[knots] / program.scaling.cost

    def loss(x: Array) -> tuple[float, Array]:
        value, by_q = program.lagrangian.gain(x.reshape(len(knots), program.n) / POSITION_SCALE)
        return -float(value @ weight), -(by_q * weight[:, None] / POSITION_SCALE).ravel()

    program.add_cost(loss, program.y[knots].ravel())
