"""Problem -> lifted MathematicalProgram, and back to joint positions. The only place where its scaling lives.

Every quantity that is penalised or limited is an unknown of its own, tied to the others by equality constraints:

    y_i = POSITION_SCALE q_i                                          at all knots,
    w_i = S_i qd_i,     qd_i = (q_i - q_(i-1)) / dt_i                 for every interval (linear),
    u_i = s_i tau_i,    tau_i = M(q_i) qdd_i + n(q_i, qd_i)           of those forces and torques that count,

with backward differences throughout: qdd_i = (qd_i - qd_(i-1)) / dt_i (PMKE paper eq. (4), Global paper eqs (3)-(6)).
For the kinetic energy and the velocity norm, 1/2 qd' G qd (`lagrangian.py`), S_i = sqrt(dt_i / C) L_i' with
G(q_guess,i) = L_i L_i' and C the cost of the guess: divided by C, the objective then has nearly the identity for a
Hessian in w, which is what IPOPT's limited-memory approximation starts from. A secondary criterion is integrated by the
trapezoidal rule: with the velocity norm the program is then of second order in the step. The squared torques are a plain |u|^2. Positions scaled small do not weigh in that start. Position and
torque limits are bounds; velocity limits are bounds or linear rows; power limits are bilinear rows. A bounded
integral (epsilon-constraint, Global paper eqs (21), (22)) is a row over sums of a few knots each.
"""

from __future__ import annotations

from collections.abc import Callable, Collection
from typing import Any

import numpy as np
import scipy.sparse as sp
from numpy.typing import NDArray
from pydrake.solvers import LinearConstraint, MathematicalProgram, QuadraticConstraint

from pipeline.common.arrays import Array
from pipeline.model.base import FloatingArm
from pipeline.model.clearance import Clearance, Obstacles
from pipeline.problem.costs import Costs, integrals, row_kinds, velocities
from pipeline.problem.lagrangian import Lagrangian, trapezoid_weights
from pipeline.problem.objective import INTEGRALS
from pipeline.problem.problem import Boundary, Problem
from pipeline.program import ipopt
from pipeline.program.differentiable import DifferentiableConstraint, DifferentiableCost
from pipeline.program.terms import base

POSITION_SCALE = 0.03


VELOCITY_SCALE = 0.03  # for objectives without kinetic energy: small, like the positions


KNOTS_PER_BINDING = 10  # a Python binding pays for its size squared: more, smaller bindings are cheaper up to a point


NEGLIGIBLE = 1e-4


SHARE = 0.1  # of the energy in the scaling of an objective to which not all velocities count


Block = NDArray[np.int_]


Rate = Callable[[Array, Array], tuple[Array, Array, Array]]  # of an integral, with its derivatives by q and qd


class Transcription:
    """The program of `problem` on the knots `times` (N + 1,), scaled for a solve that starts at `guess` (N + 1, n).

    elastic: kinds of limits (position, velocity, torque, power, clearance) that may all be exceeded by the same fraction;
    that fraction is then what is minimised. keep_off: [m] by how much more than the margin obstacles are kept off.
    """

    position_scale = POSITION_SCALE

    def __init__(
        self, problem: Problem, times: Array, guess: Array, *, elastic: Collection[str] = (), keep_off: float = 0.0
    ) -> None:
        self.elastic, self.keep_off = elastic, keep_off
        self.problem, self.times, self.q_guess = problem, times, guess
        self.arm, self.objective, self.limits = problem.task.arm, problem.objective, problem.bounds
        self.n, self.intervals = self.arm.n, len(times) - 1
        self.dt = np.diff(times)
        self.x_ref = problem.reference.position(times)
        self.integral_bounds = problem.integral_bounds
        self.lagrangian = Lagrangian(problem.task, self.objective)
        self.nb = self.arm.base_coordinates
        self.bounds_first_order = self.integral_bounds.bounds("kinetic_energy", "base_rotation")
        self.kinds = row_kinds(self.arm)
        limited = bool(np.isfinite(self.limits.torque).any() or np.isfinite(self.limits.power).any())
        # The generalized forces that are unknowns, and what their squares weigh in the objective.
        self.lifted = [row for row, kind in enumerate(self.kinds) if self._counts(kind) or (limited and row >= self.nb)]
        self.row_weights = np.array([getattr(self.objective, self.kinds[row]) for row in self.lifted])
        closed = problem.boundary is Boundary.CYCLIC
        # A cycle of a floating base begins with a base velocity that is no interval's: its last one has turned since.
        self.enters = bool(self.lifted) and closed and self.arm.floats
        self._tracking_rows: list[DifferentiableConstraint] = []
        self._sums: list[tuple[str, Any]] = []
        self._scale()

        self.program = MathematicalProgram()
        sizes = [(self.intervals + 1) * self.n, self.intervals * self.n, self.n * self.enters]
        unknowns = self.program.NewContinuousVariables(sum(sizes) + self.intervals * len(self.lifted), "x")
        y, w, entry, u = np.split(unknowns, np.cumsum(sizes))
        self.y, self.w, self.w_entry = (part.reshape(-1, self.n) for part in (y, w, entry))
        self.u = u.reshape(self.intervals, -1)

        if elastic:
            self.excess = self.program.NewContinuousVariables(1, "excess")
            self.program.AddBoundingBoxConstraint(0.0, np.inf, self.excess)
            self.program.AddLinearCost(np.ones(1), self.excess)
        self._link()
        self._bound_ends()
        self._limit()
        first_free = 1 if problem.boundary is Boundary.FIXED else 0
        # Closed joints close the path, unless the base has moved under them.
        turns = closed and isinstance(self.arm, FloatingArm) and self.arm.center_rests
        for block in self.blocks(first_free, self.intervals + (0 if turns or (closed and not self.arm.floats) else 1)):
            self._add_tracking(block)
        if turns and isinstance(self.arm, FloatingArm):
            base.close_path(self, self.arm)
        for block in self.blocks(0, self.intervals):
            if self.lagrangian.is_quadratic and not elastic:
                self._add_quadratic(block)
            if self.lifted:
                self._add_torque(block)
            if isinstance(self.arm, FloatingArm) and self.arm.floats:
                base.conserve_momentum(self, self.arm, block)
        if self.enters and isinstance(self.arm, FloatingArm):
            base.enter(self, self.arm)
        if np.isfinite(self.limits.attitude) and isinstance(self.arm, FloatingArm):
            base.limit_attitude(self, self.arm)
        if self.row_weights.any() and not elastic:
            flat = self.u[:, self.row_weights > 0].ravel()
            self.program.AddQuadraticCost(2 * np.eye(len(flat)), np.zeros(len(flat)), flat, is_convex=True)
        if self.objective.secondary is not None and not elastic:
            for block in self.blocks(0, self.intervals + 1):
                self._add_secondary(block)
        if problem.obstacles is not None:
            self._keep_clear(problem.obstacles, first_free)
        if not elastic:
            self._bound_integrals()

    def solve(self, **options: Any) -> tuple[Array, ipopt.Outcome, int]:
        """Solve from the guess: positions (N + 1, n) [rad], IPOPT's outcome, its iterations."""
        for rows in self._tracking_rows:
            rows.forget()
        parts = [POSITION_SCALE * self.q_guess, self._to_w(self.qd_guess)]
        if self.enters:
            parts.append(np.linalg.solve(self.to_velocity[-1], self.qd_entry))
        parts.append(self.torque_scale * self.tau_guess)
        if self.elastic:
            parts.append(np.ones(1))
        for _, sums in self._sums:
            parts.append(np.full(len(sums), 1.0 / len(sums)))
        outcome = ipopt.solve(self.program, np.concatenate([part.ravel() for part in parts]), **options)
        q = outcome.x[: self.y.size].reshape(self.y.shape) / POSITION_SCALE
        return q, outcome, self._tracking_rows[0].iterations

    # --- scaling ------------------------------------------------------------------------------------------------

    def _counts(self, kind: str) -> bool:
        return getattr(self.objective, kind) > 0 or self.integral_bounds.bounds(kind)

    def _scale(self) -> None:
        """Choose S_i and s_i from the guess, so that the objective there is 1."""
        q, dt = self.q_guess, self.dt
        qd = velocities(self.problem, self.times, q)
        self.qd_entry, self.qd_guess = qd[0], qd[1:]
        costs: Costs = integrals(self.problem, self.times, q)
        self.tau_guess = costs.tau[1:, self.lifted]
        # A guess without any base rotation has a cost near zero; its size is then seen from the joints' motion.
        least = NEGLIGIBLE * self.objective.base_rotation * costs.velocity_norm
        self.cost = max(costs.value(self.objective), least) or 1.0
        self.energy = costs.kinetic_energy if costs.kinetic_energy > 0 else 1.0
        if self.lagrangian.is_quadratic or self.bounds_first_order:
            # Half |w|^2 is the energy's share of the cost, or its ratio to the guess's where it is only bounded.
            share = 1 / self.cost if self.lagrangian.is_quadratic else 1 / self.energy
            metric = self.lagrangian.metric(q[1:]) if self.lagrangian.is_quadratic else self.arm.mass_matrix(q[1:])
            if self.nb and not self.arm.floats:
                # Coordinates that are held need no metric, and a base without mass has none.
                metric[:, : self.nb], metric[:, :, : self.nb] = 0.0, 0.0
                metric[:, range(self.nb), range(self.nb)] = 1.0
            elif self.nb and self.lagrangian.inertia == 0:
                # Not all velocities count: a share of the energy makes it regular.
                metric = metric + SHARE * self.cost / self.energy * self.arm.mass_matrix(q[1:])
            root = np.linalg.cholesky(metric)
            factor = 1 / np.sqrt(share * dt)[:, None, None]
            self.to_velocity = factor * np.linalg.inv(root).transpose(0, 2, 1)  # qd_i = to_velocity_i w_i
            self.diagonal = False
        else:
            self.to_velocity = np.tile(np.eye(self.n) / VELOCITY_SCALE, (self.intervals, 1, 1))
            self.diagonal = True
        size = float(np.sqrt(np.mean(self.tau_guess**2))) if self.lifted else 1.0
        self.torque_scale = np.full((self.intervals, len(self.lifted)), 0.1 / ((size or 1.0) * np.sqrt(self.intervals)))
        for column, row in enumerate(self.lifted):
            weight, total = self.row_weights[column], getattr(costs, self.kinds[row])
            if weight > 0:
                self.torque_scale[:, column] = np.sqrt(weight * dt / self.cost)
            elif self.integral_bounds.bounds(self.kinds[row]):
                self.torque_scale[:, column] = np.sqrt(dt / (total if total > 0 else 1.0))

    def _to_w(self, qd: Array) -> Array:
        return np.linalg.solve(self.to_velocity, qd[:, :, None])[:, :, 0]

    # --- rows that Drake handles natively -----------------------------------------------------------------------

    def _link(self) -> None:
        """y_i - y_(i-1) = POSITION_SCALE dt_i qd_i, as one sparse linear binding."""
        count, n = self.intervals, self.n
        pairs = sp.diags_array([-np.ones(count), np.ones(count)], offsets=[0, 1], shape=(count, count + 1))
        steps = sp.block_diag(list(POSITION_SCALE * self.dt[:, None, None] * self.to_velocity))
        rows = sp.csc_matrix(sp.hstack([sp.kron(pairs, sp.eye_array(n)), -steps]))
        rows.eliminate_zeros()
        unknowns = np.concatenate([self.y.ravel(), self.w.ravel()])
        self.program.AddLinearEqualityConstraint(rows, np.zeros(count * n), unknowns)

    def _bound_ends(self) -> None:
        start, nb = POSITION_SCALE * self.problem.q_init, self.nb
        if self.problem.boundary is Boundary.FIXED:
            self.program.AddBoundingBoxConstraint(start, start, self.y[0])
        elif nb:
            self.program.AddBoundingBoxConstraint(start[:nb], start[:nb], self.y[0, :nb])
        if nb and not self.arm.floats:
            still = np.tile(start[:nb], self.intervals)
            self.program.AddBoundingBoxConstraint(still, still, self.y[1:, :nb].ravel())
        if self.problem.boundary is Boundary.CYCLIC:
            joints = self.n - nb
            closing = np.hstack([np.eye(joints), -np.eye(joints)])
            ends = np.concatenate([self.y[0, nb:], self.y[-1, nb:]])
            self.program.AddLinearEqualityConstraint(closing, np.zeros(joints), ends)

    def _limit(self) -> None:
        limits, count = self.limits, self.intervals
        first = 1 if self.problem.boundary is Boundary.FIXED else 0
        if np.isfinite(limits.lower).any() or np.isfinite(limits.upper).any():
            low, high = (np.tile(POSITION_SCALE * bound, count + 1 - first) for bound in (limits.lower, limits.upper))
            self.keep_within("position", low, high, self.y[first:].ravel(), (high - low) / 2)
        if np.isfinite(limits.velocity).any():
            # Scaled so that a row's coefficients are of order one.
            size = np.abs(self.to_velocity).max(axis=(1, 2))
            bound = (limits.velocity / size[:, None]).ravel()
            rows = None if self.diagonal else sp.block_diag(list(self.to_velocity / size[:, None, None]))
            self.keep_within("velocity", -bound, bound, self.w.ravel(), bound, rows)
        if np.isfinite(limits.torque).any():
            bound = (limits.torque[self.lifted] * self.torque_scale).ravel()
            self.keep_within("torque", -bound, bound, self.u.ravel(), bound)
        for joint in np.flatnonzero(np.isfinite(limits.power)):
            self._limit_power(int(joint), float(limits.power[joint]))

    def keep_within(self, kind: str, low: Array, high: Array, unknowns: Any, slack: Array, rows: Any = None) -> None:
        """low <= rows @ unknowns <= high; as bounds where it can be, and softened by excess * slack if elastic."""
        if kind not in self.elastic:
            if rows is None:
                self.program.AddBoundingBoxConstraint(low, high, unknowns)
            else:
                self.program.AddConstraint(LinearConstraint(sp.csc_matrix(rows), low, high), unknowns)
            return
        rows = sp.eye_array(len(unknowns)) if rows is None else rows
        # A joint with a limit on one side only gives way by a radian per unit of excess.
        give = sp.csc_matrix(np.where(np.isfinite(slack), slack, POSITION_SCALE)[:, None])
        both = sp.csc_matrix(sp.vstack([sp.hstack([rows, -give]), sp.hstack([-sp.csc_matrix(rows), -give])]))
        above = np.concatenate([high, -low])
        used = np.flatnonzero(np.isfinite(above))
        free = np.full(len(used), -np.inf)
        self.program.AddConstraint(
            LinearConstraint(both[used], free, above[used]), np.concatenate([unknowns, self.excess])
        )

    def _limit_power(self, joint: int, power: float) -> None:
        """|tau_j qd_j| <= P for one joint at all intervals: u_ij (to_velocity_i w_i)_j s_i^-1, relative to P."""
        for i in range(self.intervals):
            row = self.to_velocity[i, joint]
            used = np.flatnonzero(row)
            form = np.zeros((len(used) + 1, len(used) + 1))
            column = self.lifted.index(joint)
            form[0, 1:] = form[1:, 0] = row[used] / (self.torque_scale[i, column] * power)
            unknowns = np.concatenate([[self.u[i, column]], self.w[i, used]])
            indefinite = QuadraticConstraint.HessianType.kIndefinite
            if "power" not in self.elastic:
                constraint = QuadraticConstraint(form, np.zeros(len(form)), -1.0, 1.0, indefinite)
                self.program.AddConstraint(constraint, unknowns)
                continue
            form = np.pad(form, (0, 1))
            linear = np.append(np.zeros(len(used) + 1), -1.0)
            for sign in (1.0, -1.0):
                constraint = QuadraticConstraint(sign * form, linear, -np.inf, 1.0, indefinite)
                self.program.AddConstraint(constraint, np.concatenate([unknowns, self.excess]))

    # --- nonlinear terms, KNOTS_PER_BINDING knots each ----------------------------------------------------------

    def _energy(self, gradient: Rate, block: Block, weight: Array) -> Callable[[Array], tuple[float, Array]]:
        """The sum of weight_i T_i over a block, by (y, w), for T (K,) with its gradients by q and qd."""
        shape, to_velocity = (len(block), self.n), self.to_velocity[block]
        split = len(block) * self.n

        def energy(x: Array) -> tuple[float, Array]:
            q = x[:split].reshape(shape) / POSITION_SCALE
            velocity = (to_velocity @ x[split:].reshape(*shape, 1))[:, :, 0]
            value, by_q, by_velocity = gradient(q, velocity)
            by_y = by_q * weight[:, None] / POSITION_SCALE
            by_w = (by_velocity[:, None, :] @ to_velocity)[:, 0] * weight[:, None]
            return float(value @ weight), np.concatenate([by_y.ravel(), by_w.ravel()])

        return energy

    def _add_quadratic(self, block: Block) -> None:
        unknowns = np.concatenate([self.y[block + 1].ravel(), self.w[block].ravel()])
        energy = self._energy(self.lagrangian.quadratic_gradient, block, self.dt[block] / self.cost)
        self.program.AddCost(DifferentiableCost(energy), vars=unknowns)

    def _add_secondary(self, knots: Block) -> None:
        """-k0 w(q_i) with the trapezoidal rule's weights."""
        weight = trapezoid_weights(self.times)[knots] / self.cost

        def loss(x: Array) -> tuple[float, Array]:
            value, by_q = self.lagrangian.gain(x.reshape(len(knots), self.n) / POSITION_SCALE)
            return -float(value @ weight), -(by_q * weight[:, None] / POSITION_SCALE).ravel()

        self.program.AddCost(DifferentiableCost(loss), vars=self.y[knots].ravel())

    def _bound_integrals(self) -> None:
        """Sums of a few knots are unknowns of their own, bounded together: the rows stay sparse."""
        blocks = self.blocks(0, self.intervals)
        for kind in INTEGRALS:
            bound = getattr(self.integral_bounds, kind)
            if not np.isfinite(bound):
                continue
            sums = self.program.NewContinuousVariables(len(blocks), f"{kind}_sums")
            for block, total in zip(blocks, sums, strict=True):
                if kind == "kinetic_energy":
                    self._bound_first_order(self.arm.kinetic_energy_gradient, block, total, bound)
                elif kind == "base_rotation":
                    assert isinstance(self.arm, FloatingArm)
                    self._bound_first_order(self.arm.turning, block, total, bound)
                else:
                    self._bound_squares(kind, block, total, bound)
            # Scaled by the bound: the sums add up to at most 1.
            self.program.AddLinearConstraint(np.ones((1, len(sums))), [-np.inf], [1.0], sums)
            self._sums.append((kind, sums))

    def _bound_first_order(self, gradient: Rate, block: Block, total: Any, bound: float) -> None:
        energy = self._energy(gradient, block, self.dt[block] / bound)

        def excess(x: Array) -> tuple[Array, Array]:
            value, gradient = energy(x[:-1])
            return np.array([value - x[-1]]), np.append(gradient, -1.0)[None]

        unknowns = np.concatenate([self.y[block + 1].ravel(), self.w[block].ravel(), [total]])
        self.program.AddConstraint(DifferentiableConstraint(excess), lb=[-np.inf], ub=[0.0], vars=unknowns)

    def _bound_squares(self, kind: str, block: Block, total: Any, bound: float) -> None:
        # u = s tau, and the integral is the sum of tau'tau dt.
        own = [column for column, row in enumerate(self.lifted) if self.kinds[row] == kind]
        weight = (self.dt[block, None] / (self.torque_scale[block][:, own] ** 2 * bound)).ravel()
        form = np.diag(np.append(2 * weight, 0.0))
        linear = np.append(np.zeros(len(weight)), -1.0)
        convex = QuadraticConstraint.HessianType.kPositiveSemidefinite
        constraint = QuadraticConstraint(form, linear, -np.inf, 0.0, convex)
        self.program.AddConstraint(constraint, np.append(self.u[block][:, own].ravel(), total))

    def _add_tracking(self, knots: Block) -> None:
        """x(q_i) = x_ref,i, and for poses R(q_i) = R_ref,i."""
        task, count, n, m = self.problem.task, len(knots), self.n, self.problem.task.m
        diagonal, target = np.arange(count), self.x_ref[knots]

        def position(x: Array) -> tuple[Array, Array]:
            value, jacobian = task.error_and_jacobian(x.reshape(count, n) / POSITION_SCALE, target)
            rows = np.zeros((count, m, count, n))
            rows[diagonal, :, diagonal] = jacobian / POSITION_SCALE
            return value.ravel(), rows.reshape(count * m, count * n)

        pattern = [(k * m + i, k * n + j) for k in range(count) for i in range(m) for j in range(n)]
        self._tracking_rows.append(self.add_rows(position, np.zeros(count * m), self.y[knots].ravel(), pattern))

    def _keep_clear(self, obstacles: Obstacles, first: int) -> None:
        """Every link's distance from every obstacle, by Drake's smooth penalty: at most 1 (clearance.py)."""
        penalty = Clearance(self.arm, obstacles).rows(self.keep_off)
        soft = "clearance" in self.elastic
        for knots in self.blocks(first, self.intervals + 1):
            shape, split = (len(knots), self.n), len(knots) * self.n

            def rows(x: Array, shape: tuple[int, int] = shape, split: int = split) -> tuple[Array, Array]:
                value, by_q = penalty(x[:split].reshape(shape) / POSITION_SCALE)
                jacobian = np.zeros((shape[0], x.size))
                for k, row in enumerate(by_q):
                    jacobian[k, k * shape[1] : (k + 1) * shape[1]] = row / POSITION_SCALE
                jacobian[:, split:] = -1.0
                return value - x[split:].sum(), jacobian

            unknowns = np.concatenate([self.y[knots].ravel(), self.excess if soft else []])
            constraint = DifferentiableConstraint(rows)
            free = np.full(len(knots), -np.inf)
            binding = self.program.AddConstraint(
                constraint, lb=free, ub=np.full(len(knots), penalty.UPPER), vars=unknowns
            )
            pattern = [(k, k * self.n + j) for k in range(len(knots)) for j in range(self.n)]
            pattern += [(k, split) for k in range(len(knots)) if soft]
            binding.evaluator().SetGradientSparsityPattern(pattern)

    def _add_torque(self, block: Block) -> None:
        """u_i = s_i (M(q_i) qdd_i + n(q_i, qd_i)), with qd_(i-1) from the interval before."""
        count, n, lifted = len(block), self.n, self.lifted
        before = self._before(block[0])
        has_before = before is not None
        own = count + (1 if has_before else 0)
        step, scale, to_velocity = self.dt[block], self.torque_scale[block], self.to_velocity[block]
        intervals = block if before is None else np.concatenate([[before], block])
        rate = np.concatenate([self.to_velocity, self.to_velocity[-1:]])[intervals]
        given = self.problem.qd_init
        came_with = (np.zeros(n) if given is None else given)[None]
        at_speed = not has_before and given is None and not self.problem.reference.timing.at_rest
        diagonal = np.arange(count)
        offset = 1 if has_before else 0
        split_y, split_w = count * n, count * n + own * n

        def torque(x: Array) -> tuple[Array, Array]:
            q = x[:split_y].reshape(count, n) / POSITION_SCALE
            all_qd = (rate @ x[split_y:split_w].reshape(own, n, 1))[:, :, 0]
            qd = all_qd[offset:]
            first = all_qd[:1] if has_before else qd[:1] if at_speed else came_with
            previous = np.vstack([first, qd[:-1]])
            all_rows = self.arm.inverse_dynamics_gradient(q, qd, (qd - previous) / step[:, None])
            tau, by_q, by_qd, by_qdd = (values[:, lifted] for values in all_rows)
            by_qdd = by_qdd / step[:, None, None]
            rows = np.zeros((count, len(lifted), count + own, n))
            factor = scale[:, :, None]
            rows[diagonal, :, diagonal] = -factor * by_q / POSITION_SCALE
            rows[diagonal, :, count + offset + diagonal] = -factor * (by_qd + by_qdd) @ to_velocity
            if at_speed:
                rows[0, :, count] = -factor[0] * by_qd[0] @ to_velocity[0]
            late = diagonal if has_before else diagonal[1:]
            earlier = count + offset - 1 + late
            rows[late, :, earlier] += factor[late] * by_qdd[late] @ rate[offset - 1 + late]
            value = x[split_w:].reshape(count, -1) - scale * tau
            size = count * len(lifted)
            return value.ravel(), np.hstack([rows.reshape(size, -1), np.eye(size)])

        rates = np.concatenate([self.w, self.w_entry])[intervals]
        unknowns = np.concatenate([self.y[block + 1].ravel(), rates.ravel(), self.u[block].ravel()])
        pattern = []
        for k in range(count):
            columns = {k, count + offset + k, *([count + offset + k - 1] if k or has_before else [])}
            for i in range(len(lifted)):
                row = k * len(lifted) + i
                pattern += [(row, c * n + j) for c in sorted(columns) for j in range(n)]
                pattern.append((row, split_w + row))
        self.add_rows(torque, np.zeros(count * len(lifted)), unknowns, pattern)

    def _before(self, interval: int) -> int | None:
        """The interval whose velocity precedes this one's; None where the motion begins."""
        if interval > 0:
            return interval - 1
        if self.problem.boundary is not Boundary.CYCLIC:
            return None
        return self.intervals if self.enters else self.intervals - 1

    def add_rows(self, function: Any, target: Array, unknowns: Any, pattern: list[tuple[int, int]]) -> Any:
        rows = DifferentiableConstraint(function)
        binding = self.program.AddConstraint(rows, lb=target, ub=target, vars=unknowns)
        binding.evaluator().SetGradientSparsityPattern(pattern)
        return rows

    @staticmethod
    def blocks(first: int, end: int) -> list[Block]:
        """The numbers from `first` to before `end`, as many at a time as one binding serves."""
        starts = range(first, end, KNOTS_PER_BINDING)
        return [np.arange(start, min(start + KNOTS_PER_BINDING, end)) for start in starts]
