"""Problem -> lifted MathematicalProgram, and back to a Trajectory. The only place where its scaling lives.

Unknowns are the positions at all knots and, for every interval, the velocity whitened by the mass matrix of the guess:

    y_i = POSITION_SCALE q_i,   w_i = sqrt(dt_i / E) L_i' qd_i,   qd_i = (q_i - q_(i-1)) / dt_i,   M(q_guess,i) = L_i L_i'.

The kinetic-energy integral sum_i 1/2 qd_i' M(q_i) qd_i dt_i (PMKE paper eq. (4), Global paper eq. (5); backward
differences), divided by its value E at the guess, then has nearly the identity for a Hessian in w: what IPOPT's
limited-memory approximation starts from. The links between q and w are linear, and positions that are scaled small do
not weigh in that start. With E of the guess divided out, the number of iterations does not depend on POSITION_SCALE.
"""

from __future__ import annotations

from typing import Any

import numpy as np
import scipy.sparse as sp
from numpy.typing import NDArray
from pydrake.solvers import MathematicalProgram

from pipeline import ipopt
from pipeline.arrays import Array
from pipeline.differentiable import DifferentiableConstraint, DifferentiableCost
from pipeline.problem import Boundary, Problem

POSITION_SCALE = 0.01
KNOTS_PER_BINDING = 10  # a Python binding pays for its size squared: more, smaller bindings are cheaper up to a point


class Transcription:
    """The program of `problem` on the knots `times` (N + 1,), scaled for a solve that starts at `guess` (N + 1, n)."""

    def __init__(self, problem: Problem, times: Array, guess: Array) -> None:
        self.problem, self.times, self.q_guess = problem, times, guess
        self.arm = problem.task.arm
        self.n, self.intervals = self.arm.n, len(times) - 1
        self.dt = np.diff(times)
        self.x_ref = problem.reference.position(times)
        self._tracking_rows: list[DifferentiableConstraint] = []

        velocity = np.diff(guess, axis=0) / self.dt[:, None]
        mass = self.arm.mass_matrix(guess[1:])
        energy = 0.5 * float(np.einsum("ki,kij,kj->k", velocity, mass, velocity) @ self.dt)
        self.energy = energy if energy > 0 else 1.0
        factor = np.sqrt(self.energy / self.dt)[:, None, None]
        self.to_velocity = factor * np.linalg.inv(np.linalg.cholesky(mass)).transpose(
            0, 2, 1
        )  # qd_i = to_velocity_i w_i

        self.program = MathematicalProgram()
        split = (self.intervals + 1) * self.n
        unknowns = self.program.NewContinuousVariables(split + self.intervals * self.n, "x")
        self.y = unknowns[:split].reshape(-1, self.n)
        self.w = unknowns[split:].reshape(-1, self.n)
        self._link()
        self._bound()
        for first in range(0, self.intervals, KNOTS_PER_BINDING):
            block = np.arange(first, min(first + KNOTS_PER_BINDING, self.intervals))
            self._add_kinetic_energy(block)
            self._add_tracking(block + 1)

    def solve(self, **options: Any) -> tuple[Array, ipopt.Outcome, int]:
        """Solve from the guess: positions (N + 1, n) [rad], IPOPT's outcome, its iterations."""
        velocity = np.diff(self.q_guess, axis=0) / self.dt[:, None]
        w = np.linalg.solve(self.to_velocity, velocity[:, :, None])
        outcome = ipopt.solve(
            self.program, np.concatenate([POSITION_SCALE * self.q_guess.ravel(), w.ravel()]), **options
        )
        q = outcome.x[: self.y.size].reshape(self.y.shape) / POSITION_SCALE
        return q, outcome, self._tracking_rows[0].iterations

    # --- rows that Drake handles natively -----------------------------------------------------------------------

    def _link(self) -> None:
        """y_i - y_(i-1) = POSITION_SCALE dt_i qd_i, as one sparse linear binding."""
        count, n = self.intervals, self.n
        difference = sp.kron(
            sp.diags_array([-np.ones(count), np.ones(count)], offsets=[0, 1], shape=(count, count + 1)), sp.eye_array(n)
        )
        step = sp.block_diag(list(POSITION_SCALE * self.dt[:, None, None] * self.to_velocity))
        rows = sp.csc_matrix(sp.hstack([difference, -step]))
        self.program.AddLinearEqualityConstraint(
            rows, np.zeros(count * n), np.concatenate([self.y.ravel(), self.w.ravel()])
        )

    def _bound(self) -> None:
        if self.problem.boundary is not Boundary.FIXED:
            raise ValueError("this transcription serves a fixed initial configuration")
        start = POSITION_SCALE * self.problem.q_init
        self.program.AddBoundingBoxConstraint(start, start, self.y[0])

    # --- nonlinear terms, KNOTS_PER_BINDING knots each ----------------------------------------------------------

    def _add_kinetic_energy(self, block: NDArray[np.int_]) -> None:
        shape, dt, to_velocity = (len(block), self.n), self.dt[block], self.to_velocity[block]
        split = len(block) * self.n

        def energy(x: Array) -> tuple[float, Array]:
            q = x[:split].reshape(shape) / POSITION_SCALE
            velocity = np.einsum("kij,kj->ki", to_velocity, x[split:].reshape(shape))
            value, by_q, by_velocity = self.arm.kinetic_energy_gradient(q, velocity)
            weight = dt / self.energy
            by_y = by_q * weight[:, None] / POSITION_SCALE
            by_w = np.einsum("kij,ki->kj", to_velocity, by_velocity) * weight[:, None]
            return float(value @ weight), np.concatenate([by_y.ravel(), by_w.ravel()])

        self.program.AddCost(
            DifferentiableCost(energy), vars=np.concatenate([self.y[block + 1].ravel(), self.w[block].ravel()])
        )

    def _add_tracking(self, knots: NDArray[np.int_]) -> None:
        task, count, n, m = self.problem.task, len(knots), self.n, self.problem.task.m
        diagonal = np.arange(count)

        def position(x: Array) -> tuple[Array, Array]:
            value, jacobian = task.value_and_jacobian(x.reshape(count, n) / POSITION_SCALE)
            rows = np.zeros((count, m, count, n))
            rows[diagonal, :, diagonal] = jacobian / POSITION_SCALE
            return value.ravel(), rows.reshape(count * m, count * n)

        rows = DifferentiableConstraint(position)
        target = self.x_ref[knots].ravel()
        binding = self.program.AddConstraint(rows, lb=target, ub=target, vars=self.y[knots].ravel())
        pattern = [(k * m + i, k * n + j) for k in range(count) for i in range(m) for j in range(n)]
        binding.evaluator().SetGradientSparsityPattern(pattern)
        self._tracking_rows.append(rows)
