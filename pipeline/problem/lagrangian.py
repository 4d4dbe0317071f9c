"""The part of an objective that depends on positions and velocities alone: L(q, qd) = 1/2 qd' G(q) qd - k0 w(q).

G = a M(q) + 2 c I + 2 d S(q) for a times the kinetic energy, c times the squared norm of the joint velocities and d
times that of a floating base's angular velocity: what the inertia matrix is to the kinetic energy, G is to L. All that
solves such problems (transcription, dynamic programming, calculus of variations, maximum principle, predictions) takes
G, w and their derivatives from here.
"""

from __future__ import annotations

import numpy as np

from pipeline.common.arrays import Array
from pipeline.model.task import Task
from pipeline.problem.objective import Objective


class Lagrangian:
    """L of an objective for one task. All arguments are stacked: q, qd (K, n)."""

    def __init__(self, task: Task, objective: Objective) -> None:
        self.task, self.arm = task, task.arm
        self.inertia, self.norm = objective.weight("kinetic_energy"), objective.weight("velocity_norm")
        self.rotation, self.secondary = objective.weight("base_rotation"), objective.secondary
        self._of_joints = np.zeros(self.arm.n)
        self._of_joints[self.arm.joints] = 1.0

    @property
    def is_quadratic(self) -> bool:
        """Whether velocities count at all."""
        return self.inertia > 0 or self.norm > 0 or self.rotation > 0

    def metric(self, q: Array) -> Array:
        """G (K, n, n); singular where only some of the coordinates of an arm on a moving base count."""
        total = np.tile(2 * self.norm * np.diag(self._of_joints), (len(q), 1, 1))
        if self.inertia:
            total += self.inertia * self.arm.mass_matrix(q)
        if self.rotation:
            total += 2 * self.rotation * self.arm.base.turning_metric(q)
        return total

    def quadratic(self, q: Array, qd: Array) -> Array:
        """1/2 qd' G qd (K,)."""
        value = self.norm * (qd * qd * self._of_joints).sum(axis=1)
        if self.inertia:
            value = value + self.inertia * self.arm.kinetic_energy(q, qd)
        if self.rotation:
            value = value + self.rotation * self.arm.base.turning(q, qd)[0]
        return value

    def quadratic_gradient(self, q: Array, qd: Array) -> tuple[Array, Array, Array]:
        """1/2 qd' G qd (K,), its derivatives by q and by qd (K, n)."""
        counted = qd * self._of_joints
        value, by_q, by_qd = self.norm * (qd * counted).sum(axis=1), np.zeros_like(q), 2 * self.norm * counted
        if self.inertia:
            energy, energy_by_q, momentum = self.arm.kinetic_energy_gradient(q, qd)
            value, by_q, by_qd = (
                value + self.inertia * energy,
                self.inertia * energy_by_q,
                by_qd + self.inertia * momentum,
            )
        if self.rotation:
            parts = zip((value, by_q, by_qd), self.arm.base.turning(q, qd), strict=True)
            value, by_q, by_qd = (total + self.rotation * part for total, part in parts)
        return value, by_q, by_qd

    def bias(self, q: Array, qd: Array) -> Array:
        """d/dt(dL/dqd) - dL/dq at qdd = 0 (K, n): Lagrange's equations read G qdd + bias = J' lambda."""
        total = self.inertia * self.arm.bias(q, qd) if self.inertia else np.zeros_like(q)
        return total + self.gain(q)[1]

    def gain(self, q: Array) -> tuple[Array, Array]:
        """k0 w (K,) and k0 dw/dq (K, n)."""
        if self.secondary is None:
            return np.zeros(len(q)), np.zeros_like(q)
        return self.secondary.gain(self.task, q)

    def gain_integrals(self, times: Array, motions: Array) -> Array:
        """The integrals (P,) of k0 w along motions (P, N + 1, n), by the trapezoidal rule."""
        if self.secondary is None:
            return np.zeros(len(motions))
        value = self.gain(motions.reshape(-1, motions.shape[-1]))[0]
        return np.asarray(np.trapezoid(value.reshape(motions.shape[:2]), times, axis=1))


def trapezoid_weights(times: Array) -> Array:
    """The weights (N + 1,) [s] of the trapezoidal rule."""
    dt = np.diff(times)
    return np.concatenate([dt, [0.0]]) / 2 + np.concatenate([[0.0], dt]) / 2
