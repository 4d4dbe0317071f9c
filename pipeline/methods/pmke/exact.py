"""A PMKE window by Newton's method with the exact Hessian: all guesses of one update in one batch, in dense numpy.

    min sum_k dt L(q_k, (q_k - q_(k-1)) / dt),   x(q_k) = x_ref,k,   k = 1 .. h   (PMKE paper eq. (4)),

L = a T + c |qd|^2 (`problem/lagrangian.py`). With M, P, Q the second derivatives of L by (qd, qd), (qd, q), (q, q),
interval k adds dt Q + P + P' + M/dt at its end, M/dt at its beginning and -P - M/dt between the two; the multipliers
add the path's curvature. For a dozen unknowns the number of numpy's calls is the time, so there is no null space and no
line search: where the steps of no guess shrink, the planner's own method (`program/newton`) is for it, and after that
IPOPT's window (`window.py`).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.lib.stride_tricks import as_strided
from numpy.typing import NDArray

from pipeline.common.arrays import Array
from pipeline.model.kernel.chain import Chain
from pipeline.model.kernel.few import Few
from pipeline.model.kernel.few_rows import FewRows
from pipeline.problem.lagrangian import Lagrangian
from pipeline.problem.limits import Limits
from pipeline.problem.objective import Objective
from pipeline.problem.problem import Boundary
from pipeline.program.newton.knots import Knots
from pipeline.program.newton.motion import Motions
from pipeline.program.newton.newton import Newton

LARGEST = 300  # unknowns and multipliers of a guess: beyond, a dense matrix is the wrong one
LONGEST = 0.7  # [rad] of a step at any joint and knot
STILL = 1e-9  # [rad]: nothing moves any more
FIRST = 0.0  # that stands for the step before the first, of which nothing follows
SURE = 0.3  # a step so much shorter than the last one is taken for one of quadratic convergence
MOST_STEPS = 12
RESIDUAL = 1e-7  # [rad] that may remain
GROWN = 5  # steps after which one that is longer than the last ends a guess
ROLLOUT_LONGEST = 0.5  # [rad]: near a singular configuration a step can be arbitrarily long


def why_not(lagrangian: Lagrangian, horizon: int) -> str | None:
    """What this window does not serve; None: it does."""
    n, m = lagrangian.arm.n, lagrangian.task.m
    if lagrangian.secondary is not None or lagrangian.rotation:
        return "terms beside the kinetic energy and the velocity norm"
    if lagrangian.arm.base.count:
        return "a base that moves"
    return f"more than {LARGEST} unknowns" if horizon * (n + m) > LARGEST else None


@dataclass(frozen=True)
class Found:
    """Per guess (S): q (S, h, n), cost [J s], whether it converged, and its residual [rad]: how far the knots still are
    from the optimum, as the quadratic convergence of the steps tells. steps: of all guesses.
    """

    q: Array
    cost: Array
    converged: NDArray[np.bool_]
    residual: Array
    steps: int

    @property
    def best(self) -> int:
        """The cheapest guess that converged."""
        return int(np.argmin(np.where(self.converged, self.cost, np.inf)))


class ExactWindow:
    """Windows of h knots, `dt` [s] apart, of one Lagrangian; nothing but numbers changes from one to the next."""

    def __init__(self, lagrangian: Lagrangian, horizon: int, dt: float) -> None:
        objective = Objective({"kinetic_energy": lagrangian.inertia, "velocity_norm": lagrangian.norm})
        self.task, self.horizon, self.dt = lagrangian.task, horizon, dt
        self.n, self.m = lagrangian.arm.n, lagrangian.task.m
        self.coordinates = self.task.value(np.zeros((1, self.n))).shape[1]
        self.inertia, self.norm = lagrangian.inertia, 2 * lagrangian.norm
        self.chain = Chain.of(lagrangian.arm)
        self.one = Few(self.chain, 1)
        self.at_start = FewRows(self.one, self.task)
        self.systems: dict[int, _System] = {}
        knots = Knots(Boundary.FIXED, dt * np.arange(horizon + 1))
        motions = Motions(self.chain, self.task, objective, knots, np.zeros((horizon + 1, self.coordinates)))
        self.careful = Newton(motions, Limits.none(self.n))

    def rollout(self, q: Array, x_ref: Array) -> Array:
        """The inertia-weighted pseudoinverse's motion (h, n) from q (n,) through x_ref (h, m), one step to a knot and
        one more onto the path: least qd'M qd with J qd given, as one small system.
        """
        n, few = self.n, self.one
        system, right = np.zeros((n + self.m, n + self.m)), np.zeros(n + self.m)
        out = np.empty((len(x_ref), n))
        for k, target in enumerate(x_ref):
            for _ in range(1):
                few.place(q[None])
                found = self.at_start.evaluate(target[None])
                system[:n, :n] = few.mass_matrix()[0]
                system[n:, :n] = found.jacobian[0]
                system[:n, n:] = found.jacobian[0].T
                right[n:] = -found.error[0]
                step = np.linalg.solve(system, right)[:n]
                q = q + step * min(1.0, ROLLOUT_LONGEST / max(float(np.abs(step).max()), STILL))
            out[k] = q
        return out

    def solve(self, q_start: Array, x_ref: Array, guesses: Array) -> Found:
        """From q_start (n,) through x_ref (h, m), started at all guesses (S, h, n) at once.

        By full steps or, where no guess converges, with the planner's care.
        """
        count = len(guesses)
        if count not in self.systems:
            self.systems[count] = _System(self, count)
        try:
            found = self.systems[count].solve(q_start, x_ref, guesses)
        except np.linalg.LinAlgError:  # a guess is singular
            found = None
        return found if found is not None and found.converged.any() else self._carefully(q_start, x_ref, guesses)

    def _carefully(self, q_start: Array, x_ref: Array, guesses: Array) -> Found:
        """The same by `program/newton`, which searches along its steps and fades where the Hessian is indefinite."""
        start = np.broadcast_to(q_start, (len(guesses), 1, self.n))
        self.careful.motions.target = x_ref
        answer = self.careful.solve(np.concatenate([start, guesses], axis=1))
        steps = int(answer.iterations.max())
        return Found(answer.q[:, 1:], answer.cost, answer.converged, answer.residual, steps)


class _System:
    """The optimality conditions of S guesses of a window, and views of their blocks."""

    def __init__(self, window: ExactWindow, count: int) -> None:
        h, n, m = window.horizon, window.n, window.m
        self.window, self.shape, self.unknowns = window, (count, h, n), h * n
        self.few = Few(window.chain, count * h)
        self.rows = FewRows(self.few, window.task)
        size = h * (n + m)
        self.matrix, self.right = np.zeros((count, size, size)), np.zeros((count, size, 1))
        self.diagonal = self._blocks(0, 0, (n, n), (n, n), h)
        self.above = self._blocks(0, n, (n, n), (n, n), h - 1)
        self.below = self._blocks(n, 0, (n, n), (n, n), h - 1)
        self.jacobian = self._blocks(h * n, 0, (m, n), (m, n), h)
        self.transposed = self._blocks(0, h * n, (n, m), (n, m), h)
        self.whole = np.empty((count, h + 1, n))
        self.q, self.step, self.slope = np.empty((3, count * h, n))
        self.multipliers = np.zeros((count * h, m))
        self.targets = np.empty((count * h, window.coordinates))
        self.dt = window.dt
        # views of these, which take a tenth of the time to make
        self.before, self.ahead = self.whole[:, :-1], self.whole[:, 1:]
        self.q_of, self.step_of, self.slope_of = (a.reshape(self.shape) for a in (self.q, self.step, self.slope))
        self.steps = self.step.reshape(count, -1)
        right = self.right[:, :, 0]
        self.downhill = as_strided(right, self.shape, (right.strides[0], n * right.strides[1], right.strides[1]))
        self.missing = right[:, h * n :]
        self.inner = self.diagonal[:, :-1]

    def _blocks(self, row: int, column: int, apart: tuple[int, int], size: tuple[int, int], count: int) -> Array:
        """A view (S, count, *size) of the blocks from (row, column) on, each so far from the one before."""
        matrix = self.matrix[:, row:, column:]
        of_start, of_row, of_column = matrix.strides
        strides = (of_start, apart[0] * of_row + apart[1] * of_column, of_row, of_column)
        return as_strided(matrix, (len(matrix), count, *size), strides)

    def solve(self, q_start: Array, x_ref: Array, guesses: Array) -> Found:
        (count, h, _), unknowns, whole, right = self.shape, self.unknowns, self.whole, self.right[:, :, 0]
        whole[:, 0], self.ahead[:] = q_start, guesses
        self.targets.reshape(count, h, -1)[:] = x_ref
        self.multipliers[:] = 0.0
        last = [FIRST] * count
        for steps in range(1, MOST_STEPS + 1):
            energies = self._linearize()
            answer = np.linalg.solve(self.matrix, self.right)[:, :, 0]
            self.multipliers[:] = answer[:, unknowns:].reshape(count * h, -1)
            # H d + J'y = -g and J d = -e: what the quadratic model says the step saves
            saved = 0.5 * np.vecdot(answer, right)
            d = answer[:, :unknowns]
            size = np.abs(d).max(axis=1).tolist()
            if max(size) > LONGEST:
                d = d * np.minimum(1.0, LONGEST / np.array(size))[:, None]
            self.ahead += d.reshape(self.shape)
            # errors e, c e^2, c^3 e^4, ..: what is left after a step is (size / last)^2 times its size
            left = [s * min(1.0, s / b) ** 2 if s < SURE * b else s for s, b in zip(size, last, strict=True)]
            near = [rest < RESIDUAL for rest in left]
            if all(near) or (steps > GROWN and all(s > before for s, before in zip(size, last, strict=True))):
                break
            last = size
        return Found(self.ahead.copy(), (energies - saved) / self.dt, np.array(near), np.array(left), steps)

    def _linearize(self) -> Array:
        """Fill the system at the motions; the sum (S,) of L at the knots. The unit of time is dt: qd is a step."""
        (count, h, n), window, few = self.shape, self.window, self.few
        np.subtract(self.ahead, self.before, out=self.step_of)
        self.q_of[:] = self.ahead
        few.place(self.q)
        found = few.energy(self.step)
        by_q, by_qd, M, P, Q = found.by_q, found.by_qd, found.mass, found.mixed, found.by_q_q
        if window.inertia != 1.0:
            by_q, by_qd, M, P, Q = (window.inertia * part for part in (by_q, by_qd, M, P, Q))
        if window.norm:
            by_qd, M = by_qd + window.norm * self.step, M + window.norm * np.eye(n)
        rows = self.rows.evaluate(self.targets)
        mixed = P + M
        Q += mixed
        Q += P.swapaxes(1, 2)
        Q += self.rows.curvature(rows, self.multipliers)
        self.diagonal[:] = Q.reshape(count, h, n, n)
        if h > 1:
            self.inner += M.reshape(count, h, n, n)[:, 1:]
            np.negative(mixed.reshape(count, h, n, n)[:, 1:], out=self.above)
            self.below[:] = self.above.swapaxes(2, 3)
        jacobian = rows.jacobian.reshape(count, h, -1, n)
        self.jacobian[:], self.transposed[:] = jacobian, jacobian.swapaxes(2, 3)
        by_qd_of = by_qd.reshape(self.shape)
        np.add(by_q, by_qd, out=self.slope)
        np.negative(self.slope_of, out=self.downhill)
        if h > 1:
            self.downhill[:, :-1] += by_qd_of[:, 1:]
        np.negative(rows.error.reshape(count, -1), out=self.missing)
        return np.vecdot(self.steps, by_qd.reshape(count, -1)) / 2
