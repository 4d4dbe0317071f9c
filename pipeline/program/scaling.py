"""The units of a lifted program's unknowns, chosen from the guess so that the objective there is 1.

For the kinetic energy and the velocity norm, 1/2 qd' G qd (`lagrangian.py`), S_i = sqrt(dt_i / C) L_i' with
G(q_guess,i) = L_i L_i' and C the cost of the guess: divided by C, the objective then has nearly the identity for a
Hessian in w, which is what IPOPT's limited-memory approximation starts from. The squared torques are a plain |u|^2.
Positions scaled small do not weigh in that start.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from pipeline.common.arrays import Array
from pipeline.problem.costs import Costs, integrals, row_kinds, velocities
from pipeline.problem.integrals import of_order
from pipeline.problem.lagrangian import Lagrangian, trapezoid_weights
from pipeline.problem.problem import Problem

POSITION_SCALE = 0.03


VELOCITY_SCALE = 0.03  # for objectives without kinetic energy: small, like the positions


NEGLIGIBLE = 1e-4


SHARE = 0.1  # of the energy in the scaling of an objective to which not all velocities count


@dataclass(frozen=True)
class Forces:
    """The generalized forces that are unknowns: their `rows` among all n, the integrals `kinds` that they belong to,
    and the `weights` of these in the objective.
    """

    rows: list[int]
    kinds: list[str]
    weights: Array

    def __len__(self) -> int:
        return len(self.rows)

    def of(self, kind: str) -> list[int]:
        """The columns of the forces that count to the integral `kind`."""
        return [column for column, own in enumerate(self.kinds) if own == kind]


def lifted(problem: Problem) -> Forces:
    """The forces that are penalised or limited."""
    arm, limits, objective = problem.task.arm, problem.bounds, problem.objective
    limited = bool(np.isfinite(limits.torque).any() or np.isfinite(limits.power).any())
    kinds = row_kinds(arm)
    counted = {*objective.weights, *problem.bounds_of_integrals}
    rows = [row for row, kind in enumerate(kinds) if kind in counted or (limited and row >= arm.base.count)]
    own = [kinds[row] for row in rows]
    return Forces(rows, own, np.array([objective.weight(kind) for kind in own]))


@dataclass(frozen=True)
class Guess:
    """The motion that a solve starts at: q, qd (N + 1, n), by backward differences, and its integrals."""

    q: Array
    qd: Array
    costs: Costs

    @classmethod
    def of(cls, problem: Problem, times: Array, q: Array) -> Guess:
        return cls(q, velocities(problem, times, q), integrals(problem, times, q))


@dataclass(frozen=True)
class Sums:
    """Where integrals are summed up: positions q (S, n) and weights (S,) [s] of the energy, forces tau (K, n) and
    weights (K,) [s] of their squares.
    """

    q: Array
    weights: Array
    tau: Array
    force_weights: Array


@dataclass(frozen=True)
class Scaling:
    """to_velocity (N, n, n): qd_i = to_velocity_i w_i; force (N, forces): u_i = force_i tau_i.

    cost: what costs are divided by. diagonal: whether a w is a joint's velocity by itself.
    """

    cost: float
    to_velocity: Array
    diagonal: bool
    force: Array

    def to_w(self, qd: Array) -> Array:
        """w (N, n) of the intervals' velocities qd (N, n)."""
        return np.linalg.solve(self.to_velocity, qd[:, :, None])[:, :, 0]


@dataclass(frozen=True)
class Prices:
    """What leaving the path is worth: by how much the objective, 1 at its guess, falls per meter, and per radian, and
    second at each of `times` (K,): rates (K, 2) [1/(m s), 1/(rad s)].
    """

    times: Array
    rates: Array

    def at(self, times: Array) -> Array:
        """At the knots of other times (N + 1, 2) [1/m, 1/rad]."""
        found = np.transpose([np.interp(times, self.times, rate) for rate in self.rates.T])
        return np.asarray(found * trapezoid_weights(times)[:, None])


def scale(problem: Problem, sums: Sums, costs: Costs, forces: Forces) -> Scaling:
    """Choose S_i and s_i from the guess, so that the objective there is 1."""
    objective = problem.objective
    # A guess without any base rotation has a cost near zero; its size is then seen from the joints' motion.
    least = NEGLIGIBLE * objective.weight("base_rotation") * costs.integrals["velocity_norm"]
    cost = max(costs.value(objective), least) or 1.0
    to_velocity = _energy_units(problem, sums, costs, cost)
    diagonal = to_velocity is None
    if to_velocity is None:
        to_velocity = np.tile(np.eye(problem.task.arm.n) / VELOCITY_SCALE, (len(sums.weights), 1, 1))
    return Scaling(cost, to_velocity, diagonal, _force_units(problem, sums, costs, forces, cost))


def _energy_units(problem: Problem, sums: Sums, costs: Costs, cost: float) -> Array | None:
    """The inverse S_i (S, n, n), by which the energy is half |w|^2; None where no velocity counts."""
    arm, lagrangian, q = problem.task.arm, Lagrangian(problem.task, problem.objective), sums.q
    if not (lagrangian.is_quadratic or of_order(problem.bounds_of_integrals, 1)):
        return None
    nb, energy = arm.base.count, costs.integrals["kinetic_energy"]
    energy = energy if energy > 0 else 1.0
    # Half |w|^2 is the energy's share of the cost, or its ratio to the guess's where it is only bounded.
    share = 1 / cost if lagrangian.is_quadratic else 1 / energy
    metric = lagrangian.metric(q) if lagrangian.is_quadratic else arm.mass_matrix(q)
    if arm.base.kind == "held":
        # Coordinates that are held need no metric, and a base without mass has none.
        metric[:, :nb], metric[:, :, :nb] = 0.0, 0.0
        metric[:, range(nb), range(nb)] = 1.0
    elif nb and lagrangian.inertia == 0:
        # Not all velocities count: a share of the energy makes it regular.
        metric = metric + SHARE * cost / energy * arm.mass_matrix(q)
    root = np.linalg.cholesky(metric)
    factor = 1 / np.sqrt(share * sums.weights)[:, None, None]
    return factor * np.linalg.inv(root).transpose(0, 2, 1)


def _force_units(problem: Problem, sums: Sums, costs: Costs, forces: Forces, cost: float) -> Array:
    """s_i (K, forces): a penalised force's squares add up to its share of the cost, a bounded one's to 1."""
    tau, own = sums.tau[:, forces.rows], sums.force_weights
    size = float(np.sqrt(np.mean(tau**2))) if forces else 1.0
    units = np.full(tau.shape, 0.1 / ((size or 1.0) * np.sqrt(len(own))))
    for column, (kind, weight) in enumerate(zip(forces.kinds, forces.weights, strict=True)):
        total = costs.integrals[kind]
        if weight > 0:
            units[:, column] = np.sqrt(weight * own / cost)
        elif kind in problem.bounds_of_integrals:
            units[:, column] = np.sqrt(own / (total if total > 0 else 1.0))
    return units
