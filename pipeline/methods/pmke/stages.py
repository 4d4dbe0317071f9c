"""A window with limits and obstacles, on its stages: quadratic programs with the exact Hessian of the energy.

Each linearisation serves all knots with one call of the kernels: cost and path (`model/kernel/few.py`), torques and
powers (`program/newton/forces.py`), clearance (`program/newton/clear.py`); what is linear is made once (`linear.py`).
The step onto the path is fixed per knot (J' = Y R), what is left of the unknowns, h r of them, is found by a
primal-dual interior point for quadratic programs (`quadratic.py`) from the multipliers of the window before. Curvature
of torques and distances is left out: rows that are not active have none.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from pipeline.common.arrays import Array
from pipeline.methods.pmke.linear import linear_rows
from pipeline.methods.pmke.quadratic import Quadratic, minimise
from pipeline.model.clearance import Clearance
from pipeline.model.kernel.chain import Chain
from pipeline.model.kernel.few import Few, Second
from pipeline.model.kernel.few_rows import FewRows
from pipeline.model.kernel.rows import Rows
from pipeline.problem.problem import Boundary, Problem
from pipeline.program.newton import stencils
from pipeline.program.newton.clear import Clear
from pipeline.program.newton.forces import Forces
from pipeline.program.newton.knots import Knots
from pipeline.program.newton.motion import Terms
from pipeline.program.newton.stencils import By

LARGEST = 400  # unknowns: beyond, dense matrices are the wrong ones
LONGEST = 0.7  # [rad] of a step at any joint and knot
CONVERGED = 1e-5  # [rad] that may be left to go
MOST = 12  # programs, if not told otherwise
ON_PATH = 1e-12  # [m, rad]
REACHED = 1e-9  # [m, rad]
KEPT = 1e-9  # of its bound: by how much a row may be exceeded
INSIDE = 1e-8  # of its bound: how far inside of it a program stays, for the last step onto the path
NEARBY = 0.3  # of its bound: rows farther off are looked at after the step
FADING = (1.0, 0.7, 0.4, 0.2, 0.0)  # how much of an indefinite Hessian is kept beside the stiffness


def why_not(problem: Problem, unknowns: int) -> str | None:
    """What this window does not serve; None: it does."""
    objective = problem.objective
    first = objective.weight("kinetic_energy") + objective.weight("velocity_norm") > 0
    if objective.second_order or objective.secondary is not None or not first:
        return "terms beside the kinetic energy and the velocity norm"
    if problem.task.arm.base.count:
        return "a base that moves"
    if problem.bounds_of_integrals:
        return "bounds on integrals"
    return f"more than {LARGEST} unknowns" if unknowns > LARGEST else None


@dataclass(frozen=True)
class Answer:
    """q (U + 1, n), its cost [J s], whether all rows hold and the step was one of the last, and why not; how many
    programs, and the rows' multipliers (U, R) at the knots `times` (U,), where the next window starts from.
    """

    q: Array
    cost: float
    converged: bool
    status: str
    iterations: int
    times: Array
    multipliers: Array


class Stages:
    """Windows of one problem; their knots and where they begin change."""

    def __init__(self, problem: Problem) -> None:
        self.problem, self.task = problem, problem.task
        self.chain, self.n, self.m = Chain.of(problem.task.arm), problem.task.arm.n, problem.task.m
        around = problem.obstacles, problem.own
        self.clearance = Clearance(problem.task.arm, *around).rows() if problem.keeps_clear else None
        self.kernels: dict[int, tuple[Few, FewRows]] = {}

    def solve(self, window: Problem, guess: Array, before: Answer | None, most: int | None = None) -> Answer:
        """The motion on window.times (U + 1,) from window.q_init, qd_init and qdd_init.

        Started at the guess (U + 1, n) and the multipliers of the window `before`. most: exactly so many programs;
        None: until it has converged.
        """
        stage = _Window(self, window)
        x = guess[1:].copy()
        z = np.zeros((stage.U, stage.count))
        if before is not None:
            nearest = np.searchsorted(before.times, window.times[1:] - 1e-9).clip(max=len(before.times) - 1)
            z = before.multipliers[nearest]
        size, fine, count, status = np.inf, False, 0, "no program"
        for count in range(1, (MOST if most is None else most) + 1):
            found = stage.step(x, z)
            if found is None:
                return Answer(guess, np.nan, False, "no step keeps the limits", count, window.times[1:], z)
            d, z = found
            last, size = size, float(np.abs(d).max())
            x += d * min(1.0, LONGEST / max(size, 1e-300))
            # Steps that shrink by a factor leave that much of the last one.
            left = size if count == 1 else size * min(1.0, size / last)
            if count == most or (most is None and left < CONVERGED):
                x, fine, status = stage.judge(x)
                if fine or count == most:
                    break
        else:
            status = f"steps of {size:.1e} after {count} programs"
        q = np.vstack([window.q_init, x])
        return Answer(q, stage.cost(x), fine, status, count, window.times[1:], z)

    def kernel(self, count: int) -> tuple[Few, FewRows]:
        """For so many knots."""
        if count not in self.kernels:
            few = Few(self.chain, count)
            self.kernels[count] = few, FewRows(few, self.task)
        return self.kernels[count]


class _Window:
    """One window: cost, path and rows c(x) >= 0, each relative to its bound, at unknowns x (U, n)."""

    def __init__(self, stages: Stages, window: Problem) -> None:
        self.n, self.m, self.window, self.U = stages.n, stages.m, window, len(window.times) - 1
        self.knots = Knots(Boundary.FIXED, window.times)
        self.dt = self.knots.dt[:, None]
        self.few, self.path = stages.kernel(self.U)
        self.targets = window.reference.position(window.times[1:])
        self.begin = window.q_init[None, None]
        weights = window.objective
        self.inertia, self.norm = weights.weight("kinetic_energy"), 2 * weights.weight("velocity_norm")
        bounds = window.bounds
        self.terms: list[Terms] = []
        if np.isfinite(bounds.torque).any() or np.isfinite(bounds.power).any():
            self.terms.append(Forces(stages.chain, window, self.knots))
        if stages.clearance is not None:
            self.terms.append(Clear(stages.clearance))
        self.linear = linear_rows(window)
        self.count = self.linear[1].shape[1] + sum(term.count for term in self.terms)

    def rows(self, x: Array) -> Array:
        """c (U, R)."""
        linear = self._linear_values(x)
        others = [term.values(x[None], self.begin)[1][0] for term in self.terms]
        return np.concatenate([linear, *others], axis=1)

    def cost(self, x: Array) -> float:
        """[J s]."""
        return self._energy(x)[0]

    def judge(self, x: Array) -> tuple[Array, bool, str]:
        """x put onto the path, whether it keeps path and rows, and that in words."""
        x, missed = self.onto_path(x)
        exceeded = -min(float(self.rows(x).min(initial=0.0)), 0.0)
        if missed < REACHED and exceeded < KEPT:
            return x, True, "newton"
        return x, False, f"{missed:.1e} off the path, limits exceeded by {exceeded:.1e}"

    def onto_path(self, x: Array) -> tuple[Array, float]:
        """x moved onto the path by least joint displacements, and how far off it is then."""
        for _ in range(4):
            self.few.place(x)
            found = self.path.evaluate(self.targets)
            missed = float(np.abs(found.error).max())
            if missed < ON_PATH:
                break
            jacobian = found.jacobian
            square = jacobian @ jacobian.swapaxes(1, 2)
            x = x - (jacobian.swapaxes(1, 2) @ np.linalg.solve(square, found.error[:, :, None]))[:, :, 0]
        return x, missed

    def step(self, x: Array, z: Array) -> tuple[Array, Array] | None:
        """The step (U, n) of one quadratic program, and the rows' multipliers (U, R); None: no step keeps the rows."""
        U, n, m = self.U, self.n, self.m
        cost, gradient, hessian, stiff, rows = self._energy_second(x)
        scale = 1.0 / max(cost, 1e-12)
        c, by = self._rows_by(x)
        C = stencils.dense(self.knots, by)[0]
        Q, R = np.linalg.qr(rows.jacobian.swapaxes(1, 2), mode="complete")
        Y, Z, R = Q[:, :, :m], Q[:, :, m:], R[:, :m]
        onto = -(Y @ np.linalg.solve(R.swapaxes(1, 2), rows.error[:, :, None]))[:, :, 0]
        driven = scale * gradient - (C.T @ z.ravel()).reshape(U, n)
        multipliers = np.linalg.solve(R, -(Y.swapaxes(1, 2) @ driven[:, :, None]))[:, :, 0]
        bent, basis = _diagonal(self.path.curvature(rows, multipliers)), _diagonal(Z)
        flat = onto.ravel()
        full, positive = scale * hessian, scale * stiff
        for share in FADING:
            matrix = positive + share * (full + bent - positive)
            reduced = basis.T @ matrix @ basis
            lower = _cholesky(reduced)
            if lower:
                break
        if not lower:
            return None
        slope = basis.T @ (scale * gradient.ravel() + matrix @ flat)
        c, z = c.ravel() + C @ flat - INSIDE, z.ravel()
        felt = (c < NEARBY) | (z > NEARBY)
        while True:
            answer = minimise(Quadratic(reduced, slope, C[felt] @ basis, c[felt]), z[felt])
            if answer is None:
                return None
            d = basis @ answer[0]
            passed = (c + C @ d < 0) & ~felt
            if not passed.any():
                break
            felt |= passed
        new = np.zeros_like(z)
        new[felt] = answer[1]
        return (flat + d).reshape(U, n), new.reshape(U, -1)

    def _energy(self, x: Array) -> tuple[float, Array, Second]:
        """The cost, velocities (U, n) and the kinetic energy's derivatives."""
        qd = self.knots.steps(x[None], self.begin)[0] / self.dt
        self.few.place(x)
        found = self.few.energy(qd)
        lagrangian = 0.5 * self.inertia * (qd * found.by_qd).sum(axis=1) + 0.5 * self.norm * (qd * qd).sum(axis=1)
        return float(self.dt[:, 0] @ lagrangian), qd, found

    def _energy_second(self, x: Array) -> tuple[float, Array, Array, Array, Rows]:
        """Cost, gradient (U, n), Hessian and stiffness (U n, U n), and the path's rows."""
        U, n, dt = self.U, self.n, self.dt
        cost, qd, found = self._energy(x)
        a, c = self.inertia, self.norm
        M = a * found.mass + c * np.eye(n)
        P, by_q, by_qd = a * found.mixed, a * found.by_q, a * found.by_qd + c * qd
        stiff = M / dt[:, :, None]
        curved = dt[:, :, None] * a * found.by_q_q + P + P.swapaxes(1, 2) + stiff
        gradient = dt * by_q + by_qd
        gradient[:-1] -= by_qd[1:]
        hessian, stiffness = (np.zeros((U, n, U, n)) for _ in range(2))
        k = np.arange(U)
        for out, own, off in ((hessian, curved, -P - stiff), (stiffness, stiff, -stiff)):
            out[k, :, k] = own
            out[k[:-1], :, k[:-1]] += stiff[1:]
            out[k[:-1], :, k[1:]] = off[1:]
            out[k[1:], :, k[:-1]] = off[1:].swapaxes(1, 2)
        rows = self.path.evaluate(self.targets)
        return cost, gradient, hessian.reshape(U * n, -1), stiffness.reshape(U * n, -1), rows

    def _linear_values(self, x: Array) -> Array:
        offset, by = self.linear[0], self.linear[1:]
        return offset + stencils.change(self.knots, tuple(g[None] for g in by), x[None])[0]

    def _rows_by(self, x: Array) -> tuple[Array, By]:
        """c (U, R) and its derivatives, of the starts' one."""
        values, parts = [self._linear_values(x)], [self.linear[1:]]
        for term in self.terms:
            kept, by = term.differentiate(x[None], self.begin)[3:]
            values.append(kept[0])
            parts.append(tuple(g[0] for g in by))
        reach = max(map(len, parts))
        whole = [
            np.concatenate([part[s] if s < len(part) else np.zeros_like(part[0]) for part in parts], axis=1)[None]
            for s in range(reach)
        ]
        return np.concatenate(values, axis=1), tuple(whole)


def _diagonal(blocks: Array) -> Array:
    """(U a, U b) of blocks (U, a, b)."""
    count, a, b = blocks.shape
    out = np.zeros((count, a, count, b))
    each = np.arange(count)
    out[each, :, each] = blocks
    return out.reshape(count * a, count * b)


def _cholesky(matrix: Array) -> bool:
    """Whether it is positive definite."""
    try:
        np.linalg.cholesky(matrix)
    except np.linalg.LinAlgError:
        return False
    return True
