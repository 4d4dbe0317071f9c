"""The documents' integrals of a motion on its knots, by backward differences, from the stacked arm.

Methods use these to rank and scale; reported numbers come from `evaluation.py`, which shares nothing with them.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from pipeline.common.arrays import Array
from pipeline.model.arm import Arm
from pipeline.problem.integrals import INTEGRALS, Integral
from pipeline.problem.lagrangian import Lagrangian
from pipeline.problem.objective import Objective
from pipeline.problem.problem import Boundary, Problem


@dataclass(frozen=True)
class Costs:
    """integrals: of the whole motion, by the names in the catalogue; zero where the base has none. gain: of k0 w.

    tau (N + 1, n) [N m], zero at the first knot; before the joints' the forces and torques on the base.
    """

    integrals: Mapping[str, float]
    gain: float
    tau: Array

    def value(self, objective: Objective) -> float:
        """The weighted sum, each term by its size: what a program is scaled by."""
        return abs(self.gain) + sum(weight * self.integrals[name] for name, weight in objective.weights.items())


def velocities(problem: Problem, times: Array, q: Array) -> Array:
    """qd (..., N + 1, n) of motions q (..., N + 1, n): qd_i = (q_i - q_(i-1)) / dt_i.

    qd_0 is problem.qd_init if that is given, zero for a motion from rest, qd_N for a cyclic one, and qd_1 for a path
    that is entered at speed.
    """
    step = np.diff(q, axis=-2) / np.diff(times)[:, None]
    if problem.boundary is Boundary.CYCLIC:
        first = _entering(problem, q[..., 0, :], step[..., -1, :])[..., None, :]
    elif problem.qd_init is not None:
        first = np.broadcast_to(problem.qd_init, step[..., :1, :].shape)
    else:
        first = np.zeros_like(step[..., :1, :]) if problem.reference.timing.at_rest else step[..., :1, :]
    return np.concatenate([first, step], axis=-2)


def _entering(problem: Problem, q: Array, last: Array) -> Array:
    """The velocity (..., n) with which a cycle is entered: the joints' last one, and what it gives a floating base."""
    arm = problem.task.arm
    return arm.follow(q.reshape(-1, arm.n), last.reshape(-1, arm.n)).reshape(last.shape)


def row_kinds(arm: Arm) -> list[str]:
    """The integral to which each of the n generalized forces of an arm belongs."""
    nb = arm.base.count
    forces = nb - 1 if nb == 3 else nb // 2
    return ["reaction_force"] * forces + ["reaction_torque"] * (nb - forces) + ["torque"] * (arm.n - nb)


def squares(arm: Arm, tau: Array, weights: Mapping[str, float]) -> Array:
    """The weighted sum of squares (...) of generalized forces tau (..., n)."""
    return np.asarray((tau**2 * [weights.get(kind, 0.0) for kind in row_kinds(arm)]).sum(axis=-1))


def integrals(problem: Problem, times: Array, q: Array) -> Costs:
    """All integrals of one motion q (N + 1, n)."""
    dt = np.diff(times)
    qd = velocities(problem, times, q)
    qdd = np.diff(qd, axis=0) / dt[:, None]
    task, arm = problem.task, problem.task.arm
    tau = arm.inverse_dynamics(q[1:], qd[1:], qdd)

    def total(integral: Integral) -> float:
        only = {integral.name: 1.0}
        if integral.order == 2:
            return float(squares(arm, tau, only) @ dt)
        return float(Lagrangian(task, Objective(only)).quadratic(q[1:], qd[1:]) @ dt)

    gain = float(Lagrangian(task, problem.objective).gain_integrals(times, q[None])[0])
    values = {name: total(integral) for name, integral in INTEGRALS.items()}
    return Costs(values, gain, np.vstack([np.zeros(arm.n), tau]))


def objective_values(problem: Problem, times: Array, motions: Array) -> Array:
    """The problem's objective (K,) of motions (K, N + 1, n)."""
    dt = np.diff(times)
    qd = velocities(problem, times, motions)
    count, knots, n = motions.shape
    arm, objective = problem.task.arm, problem.objective
    flat_q, flat_qd = motions[:, 1:].reshape(-1, n), qd[:, 1:].reshape(-1, n)
    lagrangian = Lagrangian(problem.task, objective)
    total = -lagrangian.gain_integrals(times, motions)
    if lagrangian.is_quadratic:
        total += lagrangian.quadratic(flat_q, flat_qd).reshape(count, knots - 1) @ dt
    if objective.second_order:
        qdd = np.diff(qd, axis=1) / dt[:, None]
        tau = arm.inverse_dynamics(flat_q, flat_qd, qdd.reshape(-1, n))
        total += squares(arm, tau, objective.weights).reshape(count, knots - 1) @ dt
    return total
