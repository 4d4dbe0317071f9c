"""The self-motion manifolds of an arm on a base with coordinates: joints are chosen, and the base follows them.

Where a floating base is depends on the way of the joints (`pipeline.model.floating`). Every move of the joints takes
it along at a constant momentum; a configuration that is drawn is the one to which the joints' straight way from the
start leads, and an edge costs what the joints' own metric B'G B says. A path through the layers is walked once more on
the first grid, knot by knot, since the base is only there where that way takes it.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from pipeline.common.arrays import Array
from pipeline.model.kernel.system import KernelSystem
from pipeline.problem.limits import Limits
from pipeline.problem.problem import Boundary, Problem
from pipeline.problem.turns import full_turns
from pipeline.search.manifold import Manifold

WAY = 4  # steps of the straight way to a configuration that is drawn
ROUNDS = 3
SHARE = 0.1  # of the energy in the metric of an objective to which not all velocities count


class OnMovingBase(Manifold):
    """Configurations (K, n) have the base's coordinates first; moves, Jacobians and metrics are the joints' alone."""

    def __init__(self, problem: Problem) -> None:
        super().__init__(problem)
        self.base, self.system = problem.task.arm.base, KernelSystem(problem.task.arm, self.chain)
        self.rotation = problem.objective.weight("base_rotation")
        if self.rotation:
            self.inertia = problem.objective.weight("kinetic_energy")

    def metric(self, q: Array) -> Array:
        """B'G B (K, joints, joints); where only the base's turning counts, with a share of the energy in it."""
        spread = self.base.motion_map(self.system, q)
        energy = spread.swapaxes(1, 2) @ self.system.mass_matrix(q) @ spread
        total = self.inertia * energy + 2 * self.norm * np.eye(spread.shape[2])
        if self.rotation:
            turning = 2 * self.rotation * spread.swapaxes(1, 2) @ self.base.turning_metric(q) @ spread
            total = total + turning
            if not self.inertia and not self.norm:
                trace = np.trace(turning, axis1=1, axis2=2).mean() / np.trace(energy, axis1=1, axis2=2).mean()
                total += SHARE * trace * energy
        return np.asarray(total)

    def rate(self, q: Array, qd: Array) -> Array:
        value = super().rate(q, qd)
        return value + self.rotation * self.base.turning(q, qd)[0] if self.rotation else value

    def moved(self, q: Array, move: Array) -> Array:
        """The joints moved by `move` (K, joints), the base with them as in the middle of the way."""
        middle = q.copy()
        middle[:, self.joints] += 0.5 * move
        return np.asarray(q + (self.base.motion_map(self.system, middle) @ move[:, :, None])[:, :, 0])

    def wait(self, q: Array, dt: float) -> Array:
        return np.asarray(q + dt * self.base.drift(self.system, q))

    def uniform(self, count: int, rng: np.random.Generator) -> Array:
        """Uniform joints, and the base where their straight way from the start takes it."""
        wished = super().uniform(count, rng)[:, self.joints]
        q = np.tile(self.problem.q_init, (count, 1))
        for step in range(WAY):
            q = self.moved(q, (wished - q[:, self.joints]) / (WAY - step))
        return q

    def first(self, target: Array, count: int, rng: np.random.Generator) -> Array:
        """Before the motion begins the base stands where it stands."""
        problem, task, bounds, joints = self.problem, self.problem.task, self.problem.bounds, self.joints
        free = Limits.none(self.n - self.base.count)
        standing = replace(
            problem,
            task=replace(task, arm=task.arm.on_fixed_base),
            q_init=problem.q_init[joints],
            limits=replace(free, lower=bounds.lower[joints], upper=bounds.upper[joints]),
            qd_init=None,
        )
        q = Manifold(standing).draw(target, count, rng)
        return np.hstack([np.tile(problem.q_init[: self.base.count], (len(q), 1)), q])

    def along(self, grid: Array, wished: Array) -> tuple[Array, Array]:
        """Knot by knot: as `wished` for the joints, the base with them, and then onto the path; in `ROUNDS`, since the
        base follows the whole of a step and not its parts.
        """
        targets, good = self.problem.reference.position(grid), np.ones(len(wished), bool)
        walked = wished.copy()
        for knot, dt in enumerate(np.diff(grid), 1):
            before, q, target = walked[:, knot - 1], walked[:, knot], np.tile(targets[knot], (len(wished), 1))
            for _ in range(ROUNDS):
                q = self.wait(self.moved(before, q[:, self.joints] - before[:, self.joints]), dt)
                q, arrived = self.project(q, target, steps=12, tolerance=1e-7)
            good &= arrived
            walked[:, knot] = q
        return (self._closed(grid, walked) if self.problem.boundary is Boundary.CYCLIC else walked), good

    def _closed(self, grid: Array, motions: Array) -> Array:
        """The gap of the joints spread over all knots, and the base where they take it: the path is the solver's."""
        joints = motions[:, :, self.joints]
        gap = joints[:, -1] - joints[:, 0] - full_turns(self.problem, joints[:, 0], joints[:, -1])
        joints = joints - np.linspace(0.0, 1.0, len(grid))[:, None] * gap[:, None]
        out = motions.copy()
        for knot, dt in enumerate(np.diff(grid), 1):
            out[:, knot] = self.wait(self.moved(out[:, knot - 1], joints[:, knot] - joints[:, knot - 1]), dt)
        return out

    def _error_and_jacobian(self, q: Array, target: Array) -> tuple[Array, Array]:
        error, jacobian = super()._error_and_jacobian(q, target)
        return error, jacobian @ self.base.motion_map(self.system, q)
