"""The documents' integrals of a motion on its knots, by backward differences, from the stacked arm.

Methods use these to rank and scale; reported numbers come from `evaluation.py`, which shares nothing with them.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from pipeline.arrays import Array
from pipeline.lagrangian import Lagrangian
from pipeline.problem import Boundary, Problem


@dataclass(frozen=True)
class Costs:
    """kinetic_energy [J s], torque [N^2 m^2 s], velocity_norm [rad^2/s]: the integrals; gain: of k0 w.

    tau (N + 1, n) [N m], zero at the first knot.
    """

    kinetic_energy: float
    torque: float
    velocity_norm: float
    gain: float
    tau: Array


def velocities(problem: Problem, times: Array, q: Array) -> Array:
    """qd (..., N + 1, n) of motions q (..., N + 1, n): qd_i = (q_i - q_(i-1)) / dt_i.

    qd_0 is problem.qd_init if that is given, zero for a motion from rest, qd_N for a cyclic one, and qd_1 for a path that
    is entered at speed.
    """
    step = np.diff(q, axis=-2) / np.diff(times)[:, None]
    if problem.boundary is Boundary.CYCLIC:
        first = step[..., -1:, :]
    elif problem.qd_init is not None:
        first = np.broadcast_to(problem.qd_init, step[..., :1, :].shape)
    else:
        first = np.zeros_like(step[..., :1, :]) if problem.reference.timing.at_rest else step[..., :1, :]
    return np.concatenate([first, step], axis=-2)


def integrals(problem: Problem, times: Array, q: Array) -> Costs:
    """All integrals of one motion q (N + 1, n)."""
    dt = np.diff(times)
    qd = velocities(problem, times, q)
    qdd = np.diff(qd, axis=0) / dt[:, None]
    arm = problem.task.arm
    tau = arm.inverse_dynamics(q[1:], qd[1:], qdd)
    energy = arm.kinetic_energy(q[1:], qd[1:])
    gain = float(Lagrangian(problem.task, problem.objective).gain_integrals(times, q[None])[0])
    squares = [float((values**2).sum(axis=1) @ dt) for values in (tau, qd[1:])]
    return Costs(float(energy @ dt), squares[0], squares[1], gain, np.vstack([np.zeros(arm.n), tau]))


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
    if weights.torque > 0:
        qdd = np.diff(qd, axis=1) / dt[:, None]
        tau = arm.inverse_dynamics(flat_q, flat_qd, qdd.reshape(-1, n))
        total += weights.torque * ((tau**2).sum(axis=1).reshape(count, knots - 1) @ dt)
    return total
