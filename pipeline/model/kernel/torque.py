"""Inverse dynamics of a chain and its derivatives, exact, for many knots in one call.

With spatial vectors in the world (Featherstone 2008, chapter 5): V_i = sum_(j<=i) S_j qd_j, Sd_j = V_j x S_j,
A_i = -g + sum_(j<=i) (S_j qdd_j + Sd_j qd_j), f_i = sum_(b>=i) (I_b A_b + V_b x* I_b V_b), tau_i = S_i . f_i.
Derivatives by Singh, Russo and Wensing (2022, "Efficient analytical derivatives of rigid-body dynamics using spatial
vector algebra"): with B = 1/2 (V x* I - I V x + (I V) xb*), where (f xb*) v = v x* f, summed over all links from i on
like I, and Sdd_j = A_(j-1) x S_j + V_(j-1) x Sd_j, for j <= i:

    dtau_i/dq_j  = S_i . (2 B_i Sd_j + I_i Sdd_j),    dtau_j/dq_i  = S_j . (2 B_i Sd_i + I_i Sdd_i + S_i x* f_i),  j < i
    dtau_i/dqd_j = S_i . 2 (B_i S_j + I_i Sd_j),      dtau_j/dqd_i = S_j . 2 (B_i S_i + I_i Sd_i).
"""

from __future__ import annotations

import numpy as np

from pipeline.common.arrays import Array
from pipeline.model.kernel.chain import Chain, Places, outward
from pipeline.model.kernel.energy import link_inertias


def inverse_dynamics(chain: Chain, q: Array, qd: Array, qdd: Array) -> tuple[Array, Array, Array, Array]:
    """tau (K, n) [N m] and dtau/dq, dtau/dqd, dtau/dqdd = M, each (K, n, n) with [k, i, j] = d tau_i / d x_j."""
    at = chain.places(q)
    count = len(q)
    S = np.concatenate([at.turning, at.moving], axis=1)  # (n, 6, K)
    rate, acceleration = qd.T[:, None], qdd.T[:, None]
    V = np.cumsum(S * rate, axis=0)
    turning = _motion_cross(V)
    Sd = _apply(turning, S)
    base = np.concatenate([np.zeros(3), -chain.gravity])[:, None]
    A = np.cumsum(S * acceleration + Sd * rate, axis=0) + base
    before = np.concatenate([np.broadcast_to(base, (1, 6, count)), A[:-1]])
    # V_(j-1) x Sd_j = V_j x Sd_j - qd_j S_j x Sd_j
    Sdd = _apply(_motion_cross(before), S) + _apply(turning, Sd) - rate * _apply(_motion_cross(S), Sd)

    link = _spatial_inertias(chain, at)
    momentum = _apply(link, V)
    dual = -turning.swapaxes(1, 2)  # V x*
    f = outward(_apply(link, A) + _apply(dual, momentum))
    own = 0.5 * (_multiply(dual, link) - _multiply(link, turning) + _force_cross(momentum))
    inertia, B = outward(link), outward(own)

    armature = np.diag(chain.armature)
    tau = (S * f).sum(axis=1).T + chain.armature * qdd
    IS = _apply(inertia, S)
    M = chain.mirrored(_products(S, IS)) + armature
    twisted = _apply(-_motion_cross(S).swapaxes(1, 2), f)
    own_q = 2 * _apply(B, Sd) + _apply(inertia, Sdd) + twisted
    own_qd = 2 * (_apply(B, S) + _apply(inertia, Sd))
    # below the diagonal the inertias are those of the row: S_i . B_i x_j = (B_i' S_i) . x_j
    BS = _apply(B.swapaxes(1, 2), S)
    low_q = 2 * _products(BS, Sd) + _products(IS, Sdd)
    low_qd = 2 * (_products(BS, S) + _products(IS, Sd))
    below = 1.0 - chain.above
    by_q = low_q * below + _products(S, own_q) * chain.above
    by_qd = low_qd * below + _products(S, own_qd) * chain.above
    return tau, by_q, by_qd, M


def _apply(matrix: Array, vector: Array) -> Array:
    return np.asarray(np.einsum("nabk,nbk->nak", matrix, vector))


def _multiply(a: Array, b: Array) -> Array:
    return np.asarray(np.einsum("nabk,nbck->nack", a, b))


def _products(a: Array, b: Array) -> Array:
    """(K, n, n) with [k, i, j] = a_i . b_j for a, b (n, 6, K)."""
    return np.ascontiguousarray(a.transpose(2, 0, 1)) @ np.ascontiguousarray(b.transpose(2, 1, 0))


def _skew(v: Array) -> Array:
    """(n, 3, 3, K) with [v] u = v x u."""
    out = np.zeros((len(v), 3, 3, v.shape[-1]))
    for a, b, c in ((0, 1, 2), (1, 2, 0), (2, 0, 1)):
        out[:, b, a], out[:, a, b] = v[:, c], -v[:, c]
    return out


def _motion_cross(V: Array) -> Array:
    """V x (n, 6, 6, K) of motions."""
    out = np.zeros((len(V), 6, 6, V.shape[-1]))
    out[:, :3, :3] = out[:, 3:, 3:] = _skew(V[:, :3])
    out[:, 3:, :3] = _skew(V[:, 3:])
    return out


def _force_cross(f: Array) -> Array:
    """f xb* (n, 6, 6, K), with (f xb*) v = v x* f."""
    out = np.zeros((len(f), 6, 6, f.shape[-1]))
    out[:, :3, :3] = -_skew(f[:, :3])
    out[:, :3, 3:] = out[:, 3:, :3] = -_skew(f[:, 3:])
    return out


def _spatial_inertias(chain: Chain, at: Places) -> Array:
    """(n, 6, 6, K): [[I, h x], [-h x, m]] about the world's origin."""
    link = link_inertias(chain, at)
    out = np.zeros((chain.n, 6, 6, link.moment.shape[-1]))
    out[:, :3, :3] = link.inertia
    out[:, :3, 3:] = _skew(link.moment)
    out[:, 3:, :3] = -out[:, :3, 3:]
    out[:, [3, 4, 5], [3, 4, 5]] = chain.mass[:, None, None]
    return out
