"""The small program of one PMKE prediction: h knots ahead, only the h n whitened velocities unknown.

    q_k = q_(k-1) + dt qd_k,    qd_k = sqrt(E / dt) L_k^-T w_k,    G(q_guess,k) = L_k L_k',

with G the inertia matrix for the kinetic energy (`lagrangian.py`).

Positions are eliminated, so the program is smaller than the lifted one and, for the few knots of a window, faster. It
is built once; `solve` only exchanges the numbers behind it.
"""

from __future__ import annotations

from typing import Any
from weakref import proxy

import numpy as np
from pydrake.solvers import MathematicalProgram

from pipeline.common.arrays import Array
from pipeline.methods.pmke.presolve import quasi_newton
from pipeline.problem.lagrangian import Lagrangian
from pipeline.program import ipopt
from pipeline.program.differentiable import DifferentiableConstraint, DifferentiableCost


class Window:
    """Minimise the integral of a Lagrangian over h intervals of `dt` [s] with the end effector on its path.

    PMKE paper eq. (4): backward differences, the mass matrix at the end of each interval.
    """

    def __init__(self, lagrangian: Lagrangian, horizon: int, dt: float) -> None:
        self.lagrangian, self.task, self.horizon, self.dt = lagrangian, lagrangian.task, horizon, dt
        task = self.task
        self.n = task.arm.n
        self._weights = dt * np.append(np.ones(horizon - 1), 0.5)  # of k0 w: trapezoidal, the first knot being given
        self._earlier = np.tri(horizon)[:, :, None, None]
        self.program = MathematicalProgram()
        w = self.program.NewContinuousVariables(horizon * self.n, "w")
        here = proxy(self)  # what Drake is given must not keep us alive: Python sees no circle through Drake
        self._rows = DifferentiableConstraint(lambda w: here._tracking(w))
        self._cost = DifferentiableCost(lambda w: here._energy(w))
        self.program.AddCost(self._cost, vars=w)
        self.program.AddConstraint(self._rows, lb=np.zeros(horizon * task.m), ub=np.zeros(horizon * task.m), vars=w)

    def solve(
        self, q_start: Array, x_ref: Array, guess: Array, *, tolerance: float = 1e-8, **options: Any
    ) -> tuple[Array, float, ipopt.Outcome, int]:
        """From q_start (n,) through x_ref (h, m), started at guess (h, n): q (h, n), objective, outcome, iterations."""
        self._rows.forget()
        self._cost.forget()
        velocity = np.diff(np.vstack([q_start, guess]), axis=0) / self.dt
        metric = self.lagrangian.metric(guess)
        energy = 0.5 * self.dt * float(np.einsum("ki,kij,kj->", velocity, metric, velocity))
        # A window at rest (the path has not begun) has no energy to scale by.
        self._scale = (energy + abs(float(self.lagrangian.gain(guess)[0] @ self._weights))) or 1.0
        self._q_start, self._x_ref = q_start, x_ref
        self._to_velocity: Array = np.sqrt(self._scale / self.dt) * np.linalg.inv(np.linalg.cholesky(metric)).transpose(
            0, 2, 1
        )
        start = np.linalg.solve(self._to_velocity, velocity[:, :, None]).ravel()
        w = quasi_newton(self._energy, self._tracking, start, tolerance=0.1 * tolerance)
        outcome = ipopt.solve(self.program, w, tolerance=tolerance, **options)
        q, qd = self._motion(outcome.x)
        value = self.dt * float(self.lagrangian.quadratic(q, qd).sum()) - float(
            self.lagrangian.gain(q)[0] @ self._weights
        )
        return q, value, outcome, self._rows.iterations

    def _motion(self, w: Array) -> tuple[Array, Array]:
        velocity = (self._to_velocity @ w.reshape(self.horizon, self.n, 1))[:, :, 0]
        return self._q_start + self.dt * velocity.cumsum(axis=0), velocity

    def _energy(self, w: Array) -> tuple[float, Array]:
        q, qd = self._motion(w)
        value, by_q, by_velocity = self.lagrangian.quadratic_gradient(q, qd)
        gain, gain_by_q = self.lagrangian.gain(q)
        by_q = self.dt * by_q - self._weights[:, None] * gain_by_q
        # qd_k moves q_k and every later knot.
        total = self.dt * (by_velocity + by_q[::-1].cumsum(axis=0)[::-1])
        cost = self.dt * float(value.sum()) - float(gain @ self._weights)
        return cost / self._scale, (total[:, None, :] @ self._to_velocity).ravel() / self._scale

    def _tracking(self, w: Array) -> tuple[Array, Array]:
        error, jacobian = self.task.error_and_jacobian(self._motion(w)[0], self._x_ref)
        rows = self.dt * (jacobian[:, None] @ self._to_velocity) * self._earlier  # by knot, earlier interval, m, n
        return error.ravel(), rows.swapaxes(1, 2).reshape(self.horizon * self.task.m, -1)
