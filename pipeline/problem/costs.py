"""The documents' integrals of a motion on its knots, by backward differences, from the stacked arm.

Methods use these to rank and scale; reported numbers come from `evaluation.py`, which shares nothing with them.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from pipeline.common.arrays import Array
from pipeline.model.arm import Arm
from pipeline.problem.lagrangian import Lagrangian
from pipeline.problem.objective import Objective
from pipeline.problem.problem import Boundary, Problem

SECOND_ORDER = ("torque", "reaction_force", "reaction_torque")


@dataclass(frozen=True)
class Costs:
    """kinetic_energy [J s], torque [N^2 m^2 s], velocity_norm [rad^2/s]: the integrals; gain: of k0 w.

    base_rotation [rad^2/s] of a floating base; reaction_force [N^2 s], reaction_torque [N^2 m^2 s] of one that is held.
    tau (N + 1, n) [N m], zero at the first knot; before the joints' the forces and torques on the base.
    """

    kinetic_energy: float
    torque: float
    velocity_norm: float
    gain: float
    base_rotation: float
    reaction_force: float
    reaction_torque: float
    tau: Array

    def value(self, objective: Objective) -> float:
        """The weighted sum, each term by its size: what a program is scaled by."""
        names = ("kinetic_energy", "torque", "velocity_norm", "base_rotation", "reaction_force", "reaction_torque")
        return abs(self.gain) + sum(getattr(objective, name) * getattr(self, name) for name in names)


def velocities(problem: Problem, times: Array, q: Array) -> Array:
    """qd (..., N + 1, n) of motions q (..., N + 1, n): qd_i = (q_i - q_(i-1)) / dt_i.

    qd_0 is problem.qd_init if that is given, zero for a motion from rest, qd_N for a cyclic one, and qd_1 for a path that
    is entered at speed.
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
    arm = problem.task.arm
    tau = arm.inverse_dynamics(q[1:], qd[1:], qdd)
    energy = arm.kinetic_energy(q[1:], qd[1:])
    gain = float(Lagrangian(problem.task, problem.objective).gain_integrals(times, q[None])[0])
    forces = {kind: float(squares(arm, tau, {kind: 1.0}) @ dt) for kind in SECOND_ORDER}
    joints = qd[1:, arm.joints]
    turning = arm.base.turning(q[1:], qd[1:])[0] @ dt
    return Costs(
        kinetic_energy=float(energy @ dt),
        velocity_norm=float((joints**2).sum(axis=1) @ dt),
        gain=gain,
        base_rotation=float(turning),
        tau=np.vstack([np.zeros(arm.n), tau]),
        **forces,
    )


def objective_values(problem: Problem, times: Array, motions: Array) -> Array:
    """The problem's objective (K,) of motions (K, N + 1, n)."""
    dt = np.diff(times)
    qd = velocities(problem, times, motions)
    count, knots, n = motions.shape
    arm, weights = problem.task.arm, problem.objective
    flat_q, flat_qd = motions[:, 1:].reshape(-1, n), qd[:, 1:].reshape(-1, n)
    lagrangian = Lagrangian(problem.task, weights)
    total = -lagrangian.gain_integrals(times, motions)
    if lagrangian.is_quadratic:
        total += lagrangian.quadratic(flat_q, flat_qd).reshape(count, knots - 1) @ dt
    if weights.second_order:
        qdd = np.diff(qd, axis=1) / dt[:, None]
        tau = arm.inverse_dynamics(flat_q, flat_qd, qdd.reshape(-1, n))
        by_kind = {kind: getattr(weights, kind) for kind in SECOND_ORDER}
        total += squares(arm, tau, by_kind).reshape(count, knots - 1) @ dt
    return total
