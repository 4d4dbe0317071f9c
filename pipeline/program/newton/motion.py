"""Cost, path error and all their derivatives of many motions at once: what a Newton step is made of.

    sum_i dt_i L(q_i, (q_i - q_(i-1)) / dt_i),   L = a T + c |qd|^2,   x(q_i) = x_ref,i  (`program.py`, `lagrangian.py`)

With M, P, Q the second derivatives of L by (qd, qd), (qd, q), (q, q), interval i adds dt Q + P + P' + M/dt at its end,
M/dt at its beginning, and -P - M/dt between the two.
"""

from __future__ import annotations

from dataclasses import dataclass, fields, replace
from typing import Any, Protocol, Self

import numpy as np

from pipeline.common.arrays import Array
from pipeline.model.kernel.chain import Chain, Places
from pipeline.model.kernel.energy import energy
from pipeline.model.kernel.rows import TaskRows
from pipeline.model.task import Task
from pipeline.problem.objective import Objective
from pipeline.program.newton import triangular
from pipeline.program.newton.knots import Blocks, Knots
from pipeline.program.newton.stencils import By


class PerStart:
    """A dataclass whose arrays, or tuples of arrays, have the starts first."""

    def take(self, rows: Any) -> Self:
        """Only these starts."""
        return replace(self, **{f.name: _each(getattr(self, f.name), lambda a: a[rows]) for f in fields(self)})  # type: ignore[type-var, arg-type]

    def put(self, rows: Any, other: Self) -> None:
        """Overwrite these starts."""
        for field in fields(self):  # type: ignore[arg-type]
            mine, theirs = getattr(self, field.name), getattr(other, field.name)
            for a, b in zip(mine, theirs, strict=True) if isinstance(mine, tuple) else [(mine, theirs)]:
                a[rows] = b


def _each(value: Any, change: Any) -> Any:
    return tuple(map(change, value)) if isinstance(value, tuple) else change(value)


@dataclass
class Point(PerStart):
    """At unknowns x (S, U, n): cost (S,), gradient (S, U, n), blocks of the Hessian and of the stiffness M/dt alone,
    error (S, U, m); J' = Y R with null space Z; columns for the curvature of the path (`rows.py`); kept (S, U, R), what
    must not be negative (`Rows`), and its derivatives by (`stencils.py`).
    """

    cost: Array
    gradient: Array
    hessian: Blocks
    stiff: Blocks
    error: Array
    Y: Array
    Z: Array
    R: Array
    columns: tuple[Array, ...]
    kept: Array
    by: By


class Rows(Protocol):
    """Inequalities c(x) >= 0, `count` (R) for each knot, which know of `reach` unknowns before its own."""

    count: int
    reach: int

    def values(self, x: Array, begin: Array) -> Array:
        """c (S, U, R)."""

    def differentiate(self, x: Array, begin: Array) -> tuple[Array, By]:
        """c and its derivatives."""

    def curvature(self, x: Array, begin: Array, z: Array) -> Blocks:
        """Blocks of the sum of -z (S, U, R) times the second derivatives of c."""


class Nothing:
    """No such rows."""

    count = reach = 0

    def values(self, x: Array, begin: Array) -> Array:
        return np.empty((*x.shape[:2], 0))

    def differentiate(self, x: Array, begin: Array) -> tuple[Array, By]:
        return self.values(x, begin), ()

    def curvature(self, x: Array, begin: Array, z: Array) -> Blocks:
        return ()


NOTHING = Nothing()


class Motions:
    """Motions of one task on one grid, and what they must keep besides (`kept`)."""

    def __init__(
        self, chain: Chain, task: Task, objective: Objective, knots: Knots, x_ref: Array, kept: Rows = NOTHING
    ) -> None:
        self.chain, self.knots, self.rows, self.kept = chain, knots, TaskRows(chain, task), kept
        self.n, self.m = chain.n, task.m
        self.inertia, self.norm = objective.weight("kinetic_energy"), objective.weight("velocity_norm")
        self.target = x_ref[knots.first : knots.first + knots.count]

    def _flat(self, x: Array, begin: Array) -> tuple[Array, Array, Array]:
        """Positions, velocities (S U, n) and targets of all knots."""
        qd = self.knots.steps(x, begin) / self.knots.dt[:, None]
        return x.reshape(-1, self.n), qd.reshape(-1, self.n), np.tile(self.target, (len(x), 1))

    def value(self, x: Array, begin: Array) -> tuple[Array, Array, Array]:
        """Cost (S,), path error (S, U, m), what is kept (S, U, R)."""
        q, qd, target = self._flat(x, begin)
        at = self.chain.places(q)
        value = self.norm * (qd * qd).sum(axis=1)
        if self.inertia:
            value = value + self.inertia * energy(self.chain, q, qd, second=False, at=at).value
        error = self.rows.error(at, target)
        cost = value.reshape(len(x), -1) @ self.knots.weight
        return cost, error.reshape(len(x), -1, self.m), self.kept.values(x, begin)

    def differentiate(self, x: Array, begin: Array) -> Point:
        """Everything at x (S, U, n)."""
        knots, n, S, U = self.knots, self.n, len(x), self.knots.count
        q, qd, target = self._flat(x, begin)
        at = self.chain.places(q)
        value, by_q, by_qd, M, P, Q = self._lagrangian(q, qd, at)
        M, P, Q = (a.reshape(S, U, n, n) for a in (M, P, Q))
        by_q, by_qd = by_q.reshape(S, U, n), by_qd.reshape(S, U, n)
        owns = (knots.weight > 0).astype(float)
        weight, on = knots.weight[:, None], owns[:, None, None]
        stiff, P = M * (owns / knots.dt)[:, None, None], P * on
        found = self.rows.evaluate(at, target)
        R, Q_of_rows = triangular.split(np.ascontiguousarray(found.jacobian.transpose(2, 1, 0)))
        basis = np.ascontiguousarray(Q_of_rows.transpose(2, 0, 1)).reshape(S, U, n, n)
        kept, by = self.kept.differentiate(x, begin)
        curved = knots.spread(weight[:, :, None] * Q + P + P.swapaxes(-1, -2) + stiff, stiff)
        return Point(
            cost=value.reshape(S, U) @ knots.weight,
            gradient=knots.spread(weight * by_q + owns[:, None] * by_qd, -owns[:, None] * by_qd),
            hessian=(curved, knots.between(-P - stiff)),
            stiff=(knots.spread(stiff, stiff), knots.between(-stiff)),
            error=found.error.reshape(S, U, self.m),
            Y=basis[..., : self.m],
            Z=basis[..., self.m :],
            R=np.ascontiguousarray(R.transpose(2, 0, 1)).reshape(S, U, self.m, self.m),
            columns=tuple(a.reshape(S, U, n, 3) for a in found.columns),
            kept=kept,
            by=by,
        )

    def _lagrangian(self, q: Array, qd: Array, at: Places) -> tuple[Array, ...]:
        """L (K,), dL/dq, dL/dqd (K, n), M, P, Q (K, n, n)."""
        found = energy(self.chain, q, qd, at=at)
        parts = (found.value, found.by_q, found.by_qd, found.mass, found.mixed, found.by_q_q)
        if self.inertia == 1.0 and not self.norm:
            return parts
        value, by_q, by_qd, M, P, Q = (self.inertia * part for part in parts)
        value, by_qd = value + self.norm * (qd * qd).sum(axis=1), by_qd + 2 * self.norm * qd
        return value, by_q, by_qd, M + 2 * self.norm * np.eye(self.n), P, Q

    @property
    def reach(self) -> int:
        """How far apart unknowns are that know of each other."""
        return max(1, self.kept.reach)

    def bent(self, x: Array, begin: Array, z: Array) -> Blocks:
        """What the rows' curvature adds to the Hessian, by their multipliers z (S, U, R)."""
        return self.kept.curvature(x, begin, z)

    def curvature(self, point: Point, multipliers: Array) -> Array:
        """multipliers (S, U, m) . d2x/dq2: (S, U, n, n)."""
        columns = tuple(a.reshape(-1, self.n, 3) for a in point.columns)
        blocks = self.rows.curvature(columns, multipliers.reshape(-1, self.m))
        return blocks.reshape(*multipliers.shape[:2], self.n, self.n)
