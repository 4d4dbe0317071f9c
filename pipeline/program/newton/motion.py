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
from pipeline.program.newton.momentum import LOOSE, Ties
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
    must not be negative (`Terms`), and its derivatives by (`stencils.py`); tie (S, U, T), what must be zero besides,
    and its derivatives tied.
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
    tie: Array
    tied: By


class Terms(Protocol):
    """What a problem adds to energy and path: a share of the objective, and inequalities c(x) >= 0, `count` (R) for
    each knot, which know of `reach` unknowns before its own and cost `penalty` times what they lack. kinks: whether
    their derivatives may bend so that no second derivative describes them.
    """

    count: int
    reach: int
    penalty: float
    kinks: bool

    def values(self, x: Array, begin: Array) -> tuple[Array, Array]:
        """The share (S,) and c (S, U, R)."""

    def differentiate(self, x: Array, begin: Array) -> tuple[Array, Array, Blocks, Array, By]:
        """The share, its gradient (S, U, n), positive blocks of its Hessian; c and its derivatives."""

    def curvature(self, x: Array, begin: Array, z: Array, scale: Array) -> Blocks:
        """Blocks of what is missing: scale (S,) times the share's Hessian, less z (S, U, R) times that of c."""


class Nothing:
    """No such terms."""

    count = reach = 0
    penalty, kinks = 0.0, False

    def values(self, x: Array, begin: Array) -> tuple[Array, Array]:
        return np.zeros(len(x)), np.empty((*x.shape[:2], 0))

    def differentiate(self, x: Array, begin: Array) -> tuple[Array, Array, Blocks, Array, By]:
        return np.zeros(len(x)), np.zeros(()), (), np.empty((*x.shape[:2], 0)), ()

    def curvature(self, x: Array, begin: Array, z: Array, scale: Array) -> Blocks:
        return ()


NOTHING = Nothing()


class Motions:
    """Motions of one task on one grid; `terms`: what counts besides energy and path, `ties`: what is zero besides."""

    def __init__(
        self,
        chain: Chain,
        task: Task,
        objective: Objective,
        knots: Knots,
        x_ref: Array,
        terms: Terms = NOTHING,
        ties: Ties = LOOSE,
    ) -> None:
        self.chain, self.knots, self.rows, self.terms = chain, knots, TaskRows(chain, task), terms
        self.ties, self.counted = ties, np.where(np.arange(chain.n) < task.arm.base.count, 0.0, 1.0)
        self.n, self.m = chain.n, task.m
        self.inertia, self.norm = objective.weight("kinetic_energy"), objective.weight("velocity_norm")
        self.target = x_ref[knots.first : knots.first + knots.count]

    def _flat(self, x: Array, begin: Array) -> tuple[Array, Array, Array]:
        """Positions, velocities (S U, n) and targets of all knots."""
        qd = self.knots.steps(x, begin) / self.knots.dt[:, None]
        return x.reshape(-1, self.n), qd.reshape(-1, self.n), np.tile(self.target, (len(x), 1))

    def value(self, x: Array, begin: Array) -> tuple[Array, Array, Array, Array]:
        """Cost (S,), path error (S, U, m), what is kept (S, U, R) and what is tied (S, U, T)."""
        q, qd, target = self._flat(x, begin)
        at = self.chain.places(q)
        value = self.norm * (qd * qd) @ self.counted
        if self.inertia:
            value = value + self.inertia * energy(self.chain, q, qd, second=False, at=at).value
        error = self.rows.error(at, target)
        cost = value.reshape(len(x), -1) @ self.knots.weight
        share, kept = self.terms.values(x, begin)
        return cost + share, error.reshape(len(x), -1, self.m), kept, self.ties.values(x, begin)

    def missed(self, x: Array) -> Array:
        """The path error (S, U, m) alone."""
        at, target = self.chain.places(x.reshape(-1, self.n)), np.tile(self.target, (len(x), 1))
        return self.rows.error(at, target).reshape(len(x), -1, self.m)

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
        share, slope, more, kept, by = self.terms.differentiate(x, begin)
        tie, tied = self.ties.differentiate(x, begin)
        curved = knots.spread(weight[:, :, None] * Q + P + P.swapaxes(-1, -2) + stiff, stiff)
        return Point(
            cost=value.reshape(S, U) @ knots.weight + share,
            gradient=knots.spread(weight * by_q + owns[:, None] * by_qd, -owns[:, None] * by_qd) + slope,
            hessian=self._joined((curved, knots.between(-P - stiff)), more),
            stiff=self._joined((knots.spread(stiff, stiff), knots.between(-stiff)), more),
            error=found.error.reshape(S, U, self.m),
            Y=basis[..., : self.m],
            Z=basis[..., self.m :],
            R=np.ascontiguousarray(R.transpose(2, 0, 1)).reshape(S, U, self.m, self.m),
            columns=tuple(a.reshape(S, U, n, 3) for a in found.columns),
            kept=kept,
            by=by,
            tie=tie,
            tied=tied,
        )

    def _lagrangian(self, q: Array, qd: Array, at: Places) -> tuple[Array, ...]:
        """L (K,), dL/dq, dL/dqd (K, n), M, P, Q (K, n, n)."""
        if not self.inertia:
            zero, none = np.zeros_like(q), np.zeros((*q.shape, self.n))
            norm = none + 2 * self.norm * np.diag(self.counted)
            return self.norm * (qd * qd) @ self.counted, zero, 2 * self.norm * qd * self.counted, norm, none, none
        found = energy(self.chain, q, qd, at=at)
        parts = (found.value, found.by_q, found.by_qd, found.mass, found.mixed, found.by_q_q)
        if self.inertia == 1.0 and not self.norm:
            return parts
        value, by_q, by_qd, M, P, Q = (self.inertia * part for part in parts)
        value, by_qd = value + self.norm * (qd * qd) @ self.counted, by_qd + 2 * self.norm * qd * self.counted
        return value, by_q, by_qd, M + 2 * self.norm * np.diag(self.counted), P, Q

    @property
    def reach(self) -> int:
        """How far apart unknowns are that know of each other."""
        return max(1, self.terms.reach)

    def _joined(self, blocks: Blocks, more: Blocks) -> Blocks:
        """The sum of both, as far from the diagonal as any goes."""
        size = blocks[0].shape
        empty = [np.zeros((size[0], self.knots.pairs_of(j), *size[2:])) for j in range(len(blocks), self.reach + 1)]
        joined = (*blocks, *empty)
        return tuple(a + b for a, b in zip(joined, more, strict=True)) if more else joined

    def curvature(self, point: Point, multipliers: Array) -> Array:
        """multipliers (S, U, m) . d2x/dq2: (S, U, n, n)."""
        columns = tuple(a.reshape(-1, self.n, 3) for a in point.columns)
        blocks = self.rows.curvature(columns, multipliers.reshape(-1, self.m))
        return blocks.reshape(*multipliers.shape[:2], self.n, self.n)
