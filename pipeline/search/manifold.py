"""Configurations on the self-motion manifolds of a path's points, many at once on the kernel, for any redundancy."""

from __future__ import annotations

import numpy as np

from pipeline.common.arrays import Array
from pipeline.model.clearance import Clearance
from pipeline.model.kernel.chain import Chain
from pipeline.model.kernel.energy import energy, mass_matrix
from pipeline.model.kernel.rows import TaskRows
from pipeline.problem.problem import Boundary, Problem
from pipeline.problem.turns import endless, full_turns

BLOCK = 512  # configurations per call of the kernel: more leave the processor's cache
ARRIVED = 1e-8  # [m, rad]
LONGEST = 0.5  # [rad] of a projection's step
DAMPING = 1e-3  # times the squared error: quadratic at the end, harmless at a singular configuration
TRIES = 6
DRAWN = 1.4  # how many more are drawn than are lacking
INSIDE = 1e-9  # [rad]


class Manifold:
    """What a search needs of a problem: projection, limits, metric and cost. The arm's base has no coordinates; one
    that has is `floating.py`'s.
    """

    def __init__(self, problem: Problem) -> None:
        self.problem, self.chain = problem, Chain.of(problem.task.arm)
        self.rows, self.n = TaskRows(self.chain, problem.task), self.chain.n
        bounds, objective = problem.bounds, problem.objective
        self.lower, self.upper = bounds.lower, bounds.upper
        self.joints = problem.task.arm.joints
        # Only joints without limits come round again.
        self.period = np.where(endless(problem), 2 * np.pi, 0.0)
        self.inertia, self.norm = objective.weight("kinetic_energy"), objective.weight("velocity_norm")
        if not self.inertia and not self.norm:
            self.inertia = 1.0
        around = problem.obstacles, problem.own
        self.clearance = Clearance(problem.task.arm, *around) if problem.keeps_clear else None

    def wrap(self, difference: Array) -> Array:
        """Differences (..., n) by the shorter way round."""
        return np.asarray(difference - self.period * np.rint(difference / (2 * np.pi)))

    def home(self, q: Array) -> Array:
        """Configurations (..., n) with the joints that come round again in (-pi, pi]."""
        return np.asarray(q - self.period * np.ceil((q - np.pi) / (2 * np.pi)))

    def metric(self, q: Array) -> Array:
        """G (K, n, n) of the objective's L = 1/2 qd'G qd (`lagrangian.py`); M if the objective is of second order."""
        mass = np.concatenate([mass_matrix(self.chain, q[k : k + BLOCK]) for k in range(0, len(q), BLOCK)])
        return np.asarray(self.inertia * mass + 2 * self.norm * np.eye(self.n))

    def cost(self, times: Array, motions: Array) -> Array:
        """sum_i dt_i L(q_i, qd_i) (P,) of motions (P, N + 1, n), qd_i by backward differences."""
        dt = np.diff(times)
        q = motions[:, 1:].reshape(-1, self.n)
        qd = (np.diff(motions, axis=1) / dt[:, None]).reshape(-1, self.n)
        return np.asarray(self.rate(q, qd).reshape(len(motions), -1) @ dt)

    def rate(self, q: Array, qd: Array) -> Array:
        """L (K,)."""
        parts = [slice(k, k + BLOCK) for k in range(0, len(q), BLOCK)]
        value = np.concatenate([energy(self.chain, q[k], qd[k], second=False).value for k in parts])
        return np.asarray(self.inertia * value + self.norm * (qd[:, self.joints] ** 2).sum(axis=1))

    def allowed(self, q: Array) -> Array:
        """(K,): within position limits, and clear of obstacles and of the arm itself."""
        inside = np.all((q >= self.lower - INSIDE) & (q <= self.upper + INSIDE), axis=1)
        if self.clearance is not None and inside.any():
            inside[inside] = self.clearance.clear(q[inside])
        return np.asarray(inside)

    def project(
        self, q: Array, target: Array, metric: Array | None = None, *, steps: int = 25, tolerance: float = ARRIVED
    ) -> tuple[Array, Array]:
        """q (K, n) moved onto their targets by damped Newton steps of least length (`metric`), which arrived (K,)."""
        q, arrived = q.copy(), np.zeros(len(q), bool)
        rows = np.arange(len(q))  # those that are not there yet
        for step in range(steps + 1):
            error, jacobian = self._error_and_jacobian(q[rows], target[rows])
            squared = (error * error).sum(axis=1)
            far = ~(squared <= tolerance**2)
            arrived[rows[~far]] = True
            rows, error, jacobian, squared = rows[far], error[far], jacobian[far], squared[far]
            if not len(rows) or step == steps:
                break
            right = jacobian.swapaxes(1, 2)
            if metric is not None:
                right = np.linalg.solve(metric[rows], right)
            inner = jacobian @ right
            m = inner.shape[1]
            damping = (1e-12 + DAMPING * squared) * np.trace(inner, axis1=1, axis2=2) + 1e-300
            inner[:, range(m), range(m)] += damping[:, None]
            move = -(right @ np.linalg.solve(inner, error[:, :, None]))[:, :, 0]
            short = np.minimum(1.0, LONGEST / np.maximum(np.linalg.norm(move, axis=1, keepdims=True), 1e-300))
            q[rows] = self.moved(q[rows], move * short)
        return q, arrived

    def moved(self, q: Array, move: Array) -> Array:
        """q (K, n) after a move of the joints (K, joints)."""
        return q + move

    def wait(self, q: Array, dt: float) -> Array:
        """q (K, n) after dt [s], later or earlier, in which no joint moves."""
        return q

    def along(self, grid: Array, wished: Array) -> tuple[Array, Array]:
        """Motions (P, N + 1, n) like the `wished` ones, on the path at the knots `grid`; and whether they are (P,)."""
        count, q = len(wished), wished.reshape(-1, self.n)
        target = np.tile(self.problem.reference.position(grid), (count, 1))
        flat, arrived = self.project(q, target, steps=12, tolerance=1e-7)
        motions = flat.reshape(wished.shape)
        if self.problem.boundary is Boundary.FIXED:
            motions[:, 0] = self.problem.q_init
        if self.problem.boundary is Boundary.CYCLIC:
            motions[:, -1] = motions[:, 0] + full_turns(self.problem, motions[:, 0], motions[:, -1])
        return motions, np.asarray(arrived.reshape(count, -1)[:, 1:].all(axis=1))

    def draw(self, target: Array, count: int, rng: np.random.Generator) -> Array:
        """At most `count` allowed configurations (K, n) at one target (m,): uniform joint angles, projected."""
        kept = np.empty((0, self.n))
        for _ in range(TRIES):
            lacking = max(8, int(DRAWN * (count - len(kept))))
            q, arrived = self.project(self.uniform(lacking, rng), np.tile(target, (lacking, 1)))
            q = self.home(q[arrived])
            kept = np.concatenate([kept, q[self.allowed(q)]])
            if len(kept) >= count:
                break
        return kept[:count]

    def first(self, target: Array, count: int, rng: np.random.Generator) -> Array:
        """The same, where a motion begins."""
        return self.draw(target, count, rng)

    def uniform(self, count: int, rng: np.random.Generator) -> Array:
        """Uniform coordinates (count, n) within their limits, half a turn to both sides where there are none."""
        low = np.where(np.isfinite(self.lower), self.lower, -np.pi)
        high = np.where(np.isfinite(self.upper), self.upper, np.pi)
        return rng.uniform(low, high, (count, self.n))

    def _error_and_jacobian(self, q: Array, target: Array) -> tuple[Array, Array]:
        parts = [slice(k, k + BLOCK) for k in range(0, max(1, len(q)), BLOCK)]
        found = [self.rows.evaluate(self.chain.places(q[k]), target[k]) for k in parts]
        return np.concatenate([f.error for f in found]), np.concatenate([f.jacobian for f in found])
