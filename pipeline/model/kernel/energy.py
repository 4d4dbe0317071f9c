"""Kinetic energy of a chain, its gradient and its whole Hessian, exact, for many knots in one call.

With S_i the screw of joint i, V_i = sum_(j<=i) S_j qd_j the velocity of its link, Sd_i = V_i x S_i its rate, and,
summed over all links b from i on, Ic_i = sum I_b the inertia and H_i = sum I_b V_b the momentum; since
dS_j/dq_i = S_i x S_j for i <= j (Featherstone 2008, chapter 2), and with

    U_i = Ic_i S_i,      F_i = Ic_i Sd_i + S_i x* H_i,

    dT/dqd_i = S_i . H_i,                     dT/dq_i = Sd_i . H_i,
    M_ai = S_a . U_i  (a <= i, symmetric),
    P_ai = d2T/dqd_a dq_i = S_a . F_i  (a <= i),   Sd_i . U_a  (a > i),
    Q_ai = d2T/dq_a dq_i  = Sd_a . F_i (a <= i, symmetric).
"""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from pipeline.common.arrays import Array
from pipeline.model.kernel.chain import Chain, Places, cross, outward


def _none() -> Array:
    return np.empty((0, 0, 0))


@dataclass(frozen=True)
class Energy:
    """T (K,) [J], by_q, by_qd (K, n); M, mixed P = d2T/dqd dq, by_q_q = d2T/dq dq (K, n, n), empty if not asked for."""

    value: Array
    by_q: Array
    by_qd: Array
    mass: Array = field(default_factory=_none)
    mixed: Array = field(default_factory=_none)
    by_q_q: Array = field(default_factory=_none)


@dataclass(frozen=True)
class Inertias:
    """Of every link about the world's origin: moment h = m x (n, 3, K) and rotational inertia (n, 3, 3, K)."""

    moment: Array
    inertia: Array


def link_inertias(chain: Chain, at: Places) -> Inertias:
    """With h the moment about the joint and p its place: I + (2 p.h + m p.p) 1 - (p h' + h p' + m p p') (Steiner)."""
    n, count = chain.n, at.origins.shape[-1]
    m = chain.mass[:, None, None]
    own = (chain.moment[:, None] @ at.axes.reshape(n, 3, -1)).reshape(n, 3, count)
    inertia = (chain.inertia @ at.axes.reshape(n, 3, -1)).reshape(n, 3, 3, count)
    inertia = np.einsum("ncak,ncbk->nabk", at.axes, inertia)
    outer = at.origins[:, :, None] * (own + 0.5 * m * at.origins)[:, None]
    outer = outer + outer.swapaxes(1, 2)
    inertia -= outer
    trace = outer[:, 0, 0] + outer[:, 1, 1] + outer[:, 2, 2]
    for axis in range(3):
        inertia[:, axis, axis] += trace
    return Inertias(own + m * at.origins, inertia)


def energy(chain: Chain, q: Array, qd: Array, *, second: bool = True, at: Places | None = None) -> Energy:
    """T and its derivatives at q, qd (K, n); `second`: the Hessian too; `at`: the places at q, where they are known."""
    at = chain.places(q) if at is None else at
    w, v, n = at.turning, at.moving, chain.n
    rate = np.ascontiguousarray(qd.T)[:, None]
    link = link_inertias(chain, at)
    h, mass = link.moment, chain.mass[:, None, None]
    # One product for all crosses of a stage: short arrays cost by the call.
    Vw, Vv = np.cumsum(w * rate, axis=0), np.cumsum(v * rate, axis=0)
    product = cross(np.concatenate([Vw, h, Vw, Vw, Vv]), np.concatenate([h, Vv, w, v, w]))
    Hv = outward(mass * Vv + product[:n])
    Hw = outward(np.einsum("nabk,nbk->nak", link.inertia, Vw) + product[n : 2 * n])
    Sdw, Sdv = product[2 * n : 3 * n], product[3 * n : 4 * n] + product[4 * n :]
    by_qd = (w * Hw).sum(axis=1) + (v * Hv).sum(axis=1) + chain.armature[:, None] * rate[:, 0]
    by_q = (Sdw * Hw).sum(axis=1) + (Sdv * Hv).sum(axis=1)
    value = 0.5 * (rate[:, 0] * by_qd).sum(axis=0)
    if not second:
        return Energy(value, by_q.T, by_qd.T)
    inertia, h, mass = outward(link.inertia), outward(h), outward(mass)
    product = cross(np.concatenate([h, h, w, Sdw, w, v, w]), np.concatenate([v, Sdv, h, h, Hw, Hv, Hv]))
    product = product.reshape(7, n, 3, -1)
    screws, forces = np.empty((2, n, 6, len(q))), np.empty((2, n, 6, len(q)))  # [S, Sd] and [U, F]
    screws[0, :, :3], screws[0, :, 3:], screws[1, :, :3], screws[1, :, 3:] = w, v, Sdw, Sdv
    np.einsum("nabk,snbk->snak", inertia, screws[:, :, :3], out=forces[:, :, :3])
    forces[:, :, :3] += product[:2]
    np.multiply(mass, screws[:, :, 3:], out=forces[:, :, 3:])
    forces[:, :, 3:] += product[2:4]
    forces[1, :, :3] += product[4] + product[5]
    forces[1, :, 3:] += product[6]
    left = np.ascontiguousarray(screws.reshape(2 * n, 6, -1).transpose(2, 0, 1))
    right = np.ascontiguousarray(forces.reshape(2 * n, 6, -1).transpose(2, 1, 0))
    products = left @ right
    M = chain.mirrored(products[:, :n, :n]) + np.diag(chain.armature)
    P = products[:, :n, n:] * chain.upper + (products[:, n:, :n] * chain.above).swapaxes(1, 2)
    Q = chain.mirrored(products[:, n:, n:])
    return Energy(value, by_q.T, by_qd.T, M, P, Q)


def mass_matrix(chain: Chain, q: Array) -> Array:
    """M(q) (K, n, n) [kg m^2]."""
    at = chain.places(q)
    w, v, n = at.turning, at.moving, chain.n
    link = link_inertias(chain, at)
    inertia, h, mass = outward(link.inertia), outward(link.moment), outward(chain.mass[:, None, None])
    product = cross(np.concatenate([h, w]), np.concatenate([v, h]))
    Uw = np.einsum("nabk,nbk->nak", inertia, w) + product[:n]
    left = np.concatenate([w, v], axis=1).transpose(2, 0, 1)
    right = np.concatenate([Uw, mass * v + product[n:]], axis=1).transpose(2, 1, 0)
    return chain.mirrored(np.ascontiguousarray(left) @ np.ascontiguousarray(right)) + np.diag(chain.armature)
