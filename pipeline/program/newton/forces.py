"""Joint torques of the intervals: their squares in the objective, and their limits and the powers' as rows.

With backward differences tau_k = tau(q_k, qd_k, qdd_k) is a function of three neighbours (`transcription.py`). The
Hessian of the squares has the first derivatives' squares (Gauss-Newton) and the second derivatives of w'tau with w = 2
tau dt: by q and another one central differences of exact first ones; by qd twice P + P' - M', P = d(M w)/dq and M' the
rate of M along w; no others.
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from pipeline.common.arrays import Array
from pipeline.model.kernel.chain import Chain
from pipeline.model.kernel.energy import mass_matrix
from pipeline.model.kernel.torque import inverse_dynamics
from pipeline.problem.problem import Problem
from pipeline.program.newton import stencils
from pipeline.program.newton.knots import Blocks, Knots
from pipeline.program.newton.stencils import By

BLOCK = 512  # knots per call of the kernel: more leave the processor's cache
STEP = 1e-5  # [rad] of central differences of exact first derivatives


class Forces:
    """The torques of `problem` on `knots`; rows in order: 1 -+ tau/limit, 1 -+ tau qd/power, of the joints limited."""

    kinks = False
    reach, penalty = 2, 100.0  # a larger penalty makes the Hessian indefinite where limits are exceeded

    def __init__(self, chain: Chain, problem: Problem, knots: Knots) -> None:
        self.chain, self.knots, self.weight = chain, knots, problem.objective.weight("torque")
        bounds = problem.bounds
        self.torque, self.power = np.flatnonzero(np.isfinite(bounds.torque)), np.flatnonzero(np.isfinite(bounds.power))
        self.most, self.most_power = bounds.torque[self.torque], bounds.power[self.power]
        self.count = 2 * (len(self.torque) + len(self.power))
        self.owns = (knots.weight > 0).astype(float)[:, None]
        dt = knots.dt
        # how q_k, qd_k and qdd_k follow from x_k, x_(k-1), x_(k-2): (U, 3)
        by_q, by_qd = np.tile([1.0, 0.0, 0.0], (len(dt), 1)), np.stack([1 / dt, -1 / dt, 0 * dt], axis=1)
        earlier = np.roll(by_qd, 1, axis=0)
        by_qdd = (by_qd - np.stack([0 * dt, earlier[:, 0], earlier[:, 1]], axis=1)) / dt[:, None]
        self.came_with = np.zeros((len(dt), chain.n))
        if not knots.cyclic:
            first = 0 if knots.fixed else 1
            given, at_rest = problem.qd_init, problem.reference.timing.at_rest
            enters_with_own = given is None and not at_rest
            by_qdd[first] = 0.0 if enters_with_own else by_qd[first] / dt[first]
            if given is not None:
                self.came_with[first] = -given / dt[first]
        self.maps = (by_q, by_qd, by_qdd)

    # --- values and first derivatives ---------------------------------------------------------------------------

    def values(self, x: Array, begin: Array) -> tuple[Array, Array]:
        """The objective's share (S,) and c (S, U, R)."""
        qd, _, tau, _ = self._torques(x, begin)
        return self._share(tau), self._rows(tau, qd)

    def differentiate(self, x: Array, begin: Array) -> tuple[Array, Array, Blocks, Array, By]:
        """The share (S,), its gradient, blocks of its Hessian (Gauss-Newton); c and its derivatives."""
        qd, _, tau, by = self._torques(x, begin)
        of_squares = 2 * self.weight * self.knots.weight[:, None] * tau
        doubled = np.broadcast_to(2 * self.weight * self.knots.weight[:, None], tau.shape)
        gradient, blocks = stencils.pull(self.knots, by, of_squares), stencils.weigh(self.knots, by, doubled)
        return self._share(tau), gradient, blocks, self._rows(tau, qd), self._rows_by(tau, qd, by)

    def _share(self, tau: Array) -> Array:
        return np.asarray(self.weight * ((tau * tau).sum(axis=2) @ self.knots.weight))

    def _rows(self, tau: Array, qd: Array) -> Array:
        load = tau[..., self.torque] / self.most
        power = (tau * qd)[..., self.power] / self.most_power
        return np.concatenate([1 - load, 1 + load, 1 - power, 1 + power], axis=-1)

    def _rows_by(self, tau: Array, qd: Array, by: By) -> By:
        out = []
        for g, of_rate in zip(by, self.maps[1].T, strict=True):
            load = g[:, :, self.torque] / self.most[:, None]
            power = g * qd[..., None] + (tau * of_rate[:, None])[..., None] * np.eye(g.shape[-1])
            power = (power * self.owns[..., None])[:, :, self.power] / self.most_power[:, None]
            out.append(np.concatenate([-load, load, -power, power], axis=2))
        return tuple(out)

    def _motion(self, x: Array, begin: Array) -> tuple[Array, Array]:
        """qd, qdd (S, U, n)."""
        knots = self.knots
        qd = knots.steps(x, begin) / knots.dt[:, None]
        qdd = (qd - knots.before(qd, 1)) / knots.dt[:, None]
        if not knots.cyclic:
            first = 0 if knots.fixed else 1
            whole = self.maps[2][first].any()
            qdd[:, first] = (qd[:, first] / knots.dt[first] if whole else 0.0) + self.came_with[first]
        return qd, qdd

    def _torques(self, x: Array, begin: Array) -> tuple[Array, Array, Array, By]:
        """qd, qdd, tau (S, U, n) and the derivatives of tau (S, U, n, n)."""
        qd, qdd = self._motion(x, begin)
        shape, n = x.shape, x.shape[-1]
        found = [inverse_dynamics(self.chain, *part) for part in self._parts(x, qd, qdd)]
        tau, *firsts = (np.concatenate(parts) for parts in zip(*found, strict=True))
        of_motion = [first.reshape(*shape[:2], n, n) * self.owns[..., None] for first in firsts]
        by = (
            sum(c[:, s, None, None] * g for c, g in zip(self.maps, of_motion, strict=True))
            for s in range(self.reach + 1)
        )
        return qd, qdd, tau.reshape(shape) * self.owns, tuple(map(np.asarray, by))

    @staticmethod
    def _parts(*motion: Array) -> Iterator[tuple[Array, ...]]:
        flat = [part.reshape(-1, part.shape[-1]) for part in motion]
        return (tuple(part[k : k + BLOCK] for part in flat) for k in range(0, len(flat[0]), BLOCK))

    # --- second derivatives -------------------------------------------------------------------------------------

    def curvature(self, x: Array, begin: Array, z: Array, scale: Array) -> Blocks:
        """Blocks of the second derivatives of tau in the share, times scale (S,), less those of z (S, U, R) times c."""
        qd, qdd, tau, by = self._torques(x, begin)
        n, loads = x.shape[-1], len(self.torque)
        up, down, high, low = np.split(z, np.cumsum([loads, loads, len(self.power)]), axis=-1)
        weights = 2 * self.weight * self.knots.weight[:, None] * tau * scale[:, None, None]
        weights[..., self.torque] += (up - down) / self.most
        on_power = np.zeros_like(tau)
        on_power[..., self.power] = (high - low) / self.most_power
        weights += on_power * qd
        found = [self._second(*part) for part in self._parts(x, qd, qdd, weights * self.owns)]
        second = {key: np.concatenate([f[key] for f in found]).reshape(*x.shape, n) for key in found[0]}
        parts: dict[tuple[int, int], Array] = {}
        for s in range(self.reach + 1):
            for t in range(s + 1):
                total = np.zeros((*x.shape, n))
                for (u, v), block in second.items():
                    total += (self.maps[u][:, s] * self.maps[v][:, t])[:, None, None] * block
                    if u != v:
                        total += (self.maps[v][:, s] * self.maps[u][:, t])[:, None, None] * block.swapaxes(-1, -2)
                # power: d tau_j d qd_j + d qd_j d tau_j
                rate = on_power * self.owns
                total += by[s].swapaxes(-1, -2) * (rate * self.maps[1][:, t, None])[:, :, None]
                total += by[t] * (rate * self.maps[1][:, s, None])[..., None]
                parts[s, t] = total
        return stencils.gather(self.knots, parts, self.reach + 1)

    def _second(self, q: Array, qd: Array, qdd: Array, w: Array) -> dict[tuple[int, int], Array]:
        """Second derivatives (K, n, n) of w'tau, by (q, q), (qd, q), (qdd, q), (qd, qd): numbered 0, 1, 2."""
        by_q: list[list[Array]] = [[], [], []]
        for unit in np.eye(self.chain.n):
            ahead, behind = (inverse_dynamics(self.chain, q + s * STEP * unit, qd, qdd)[1:] for s in (1, -1))
            for column, one, other in zip(by_q, ahead, behind, strict=True):
                column.append(((w[:, None] @ (one - other))[:, 0]) / (2 * STEP))
        qq, dq, aq = (np.stack(column, axis=-1) for column in by_q)
        along = (mass_matrix(self.chain, q + STEP * w) - mass_matrix(self.chain, q - STEP * w)) / (2 * STEP)
        return {(0, 0): (qq + qq.swapaxes(1, 2)) / 2, (1, 0): dq, (2, 0): aq, (1, 1): aq + aq.swapaxes(1, 2) - along}
