"""Cost, path error and all their derivatives of many motions at once: what a Newton step is made of.

    sum_i dt_i L(q_i, (q_i - q_(i-1)) / dt_i),   L = a T + c |qd|^2,   x(q_i) = x_ref,i  (`program.py`, `lagrangian.py`)

With M, P, Q the second derivatives of L by (qd, qd), (qd, q), (q, q), interval i adds dt Q + P + P' + M/dt at its end,
M/dt at its beginning, and -P - M/dt between the two.
"""

from __future__ import annotations

from dataclasses import dataclass, fields, replace
from typing import Any, Self

import numpy as np

from pipeline.common.arrays import Array
from pipeline.model.kernel.chain import Chain, Places
from pipeline.model.kernel.energy import energy
from pipeline.model.kernel.rows import TaskRows
from pipeline.model.task import Task
from pipeline.problem.objective import Objective
from pipeline.program.newton import triangular
from pipeline.program.newton.knots import Knots


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
    """At unknowns x (S, U, n): cost (S,), gradient (S, U, n), Hessian blocks diagonal, off and those of the stiffness
    M/dt alone, error (S, U, m); J' = Y R with null space Z; columns for the curvature of the path (`rows.py`).
    """

    cost: Array
    gradient: Array
    diagonal: Array
    off: Array
    stiff: Array
    stiff_off: Array
    error: Array
    Y: Array
    Z: Array
    R: Array
    columns: tuple[Array, ...]


class Motions:
    """Motions of one task on one grid."""

    def __init__(self, chain: Chain, task: Task, objective: Objective, knots: Knots, x_ref: Array) -> None:
        self.chain, self.knots, self.rows = chain, knots, TaskRows(chain, task)
        self.n, self.m = chain.n, task.m
        self.inertia, self.norm = objective.weight("kinetic_energy"), objective.weight("velocity_norm")
        self.target = x_ref[knots.first : knots.first + knots.count]

    def _flat(self, x: Array, begin: Array) -> tuple[Array, Array, Array]:
        """Positions, velocities (S U, n) and targets of all knots."""
        qd = self.knots.steps(x, begin) / self.knots.dt[:, None]
        return x.reshape(-1, self.n), qd.reshape(-1, self.n), np.tile(self.target, (len(x), 1))

    def value(self, x: Array, begin: Array) -> tuple[Array, Array]:
        """Cost (S,), path error (S, U, m)."""
        q, qd, target = self._flat(x, begin)
        at = self.chain.places(q)
        value = self.norm * (qd * qd).sum(axis=1)
        if self.inertia:
            value = value + self.inertia * energy(self.chain, q, qd, second=False, at=at).value
        error = self.rows.error(at, target)
        return value.reshape(len(x), -1) @ self.knots.weight, error.reshape(len(x), -1, self.m)

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
        return Point(
            cost=value.reshape(S, U) @ knots.weight,
            gradient=knots.spread(weight * by_q + owns[:, None] * by_qd, -owns[:, None] * by_qd),
            diagonal=knots.spread(weight[:, :, None] * Q + P + P.swapaxes(-1, -2) + stiff, stiff),
            off=knots.between(-P - stiff),
            stiff=knots.spread(stiff, stiff),
            stiff_off=knots.between(-stiff),
            error=found.error.reshape(S, U, self.m),
            Y=basis[..., : self.m],
            Z=basis[..., self.m :],
            R=np.ascontiguousarray(R.transpose(2, 0, 1)).reshape(S, U, self.m, self.m),
            columns=tuple(a.reshape(S, U, n, 3) for a in found.columns),
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

    def curvature(self, point: Point, multipliers: Array) -> Array:
        """multipliers (S, U, m) . d2x/dq2: (S, U, n, n)."""
        columns = tuple(a.reshape(-1, self.n, 3) for a in point.columns)
        blocks = self.rows.curvature(columns, multipliers.reshape(-1, self.m))
        return blocks.reshape(*multipliers.shape[:2], self.n, self.n)
