"""The kernel for a few knots, where a numpy call costs more than what it computes: about thirty calls for all of it.

Everything is a 4 x 4 matrix in the world: A_j the place of joint frame j, S_j its screw (dA_b/dq_j = S_j A_b for
b >= j), V_b = sum_(j<=b) S_j qd_j the velocity of link b and W_b = A_b J_b A_b' its inertia, with the pseudo-inertia
J_b = [[sum m r r', h], [h', m]] in the link's frame. With <X, Y> = tr X'Y, Sd_i = V_i S_i - S_i V_i, and summed over
all links b from i on W_i and H_i = sum V_b W_b, the kinetic energy's derivatives (`energy.py`) are

    dT/dqd_i = <S_i, H_i>,  dT/dq_i = <Sd_i, H_i>,    U_i = S_i W_i,  F_i = Sd_i W_i + H_i S_i' - S_i'H_i,
    M_ai = <S_a, U_i> (a <= i),   P_ai = <S_a, F_i> (a <= i), <Sd_i, U_a> (a > i),   Q_ai = <Sd_a, F_i> (a <= i).
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from pipeline.common.arrays import Array
from pipeline.model.kernel.chain import Chain


@dataclass(frozen=True)
class Second:
    """by_q, by_qd (K, n), of which T = 1/2 qd . by_qd, and mass = d2T/dqd2, mixed = d2T/dqd dq, by_q_q = d2T/dq2
    (K, n, n).
    """

    by_q: Array
    by_qd: Array
    mass: Array
    mixed: Array
    by_q_q: Array


class Few:
    """`count` knots (K) of a chain. Arrays are made once and written over by the next call."""

    def __init__(self, chain: Chain, count: int) -> None:
        n = chain.n
        self.chain, self.n, self.count = chain, n, count
        self.features = np.ones((n, count, 1, 3))  # 1, cos q, sin q; 1, q, 0 where a joint slides
        self.maps = _local(chain)[:, None]
        self.slides = np.flatnonzero(chain.slides)
        self.turns = np.zeros((4, 4))  # d/dq of a turn about z, at its end
        self.turns[[1, 0], [0, 1]] = 1.0, -1.0
        self.inertia = _pseudo_inertias(chain)[:, None]
        self.rotors = np.diag(chain.armature) if chain.armature.any() else None
        self.tip = np.append(chain.tip, 1.0)[:, None]
        self.places = np.empty((n, count, 4, 4))
        self.left, self.right = np.zeros((2, n, count, 4, 4)), np.empty((3, n, count, 4, 4))  # S, Sd; U, F, H
        self.both = np.empty((n, 2, count, 4, 4))  # W, V W of each link
        self.composite = np.empty((n, 2, count, 4, 4))  # their sums onward
        self._look()
        self.onward, self.before = np.triu(np.ones((n, n))), np.tril(np.ones((n, n)))
        row, column = np.indices((n, n))
        low, high = np.minimum(row, column), np.maximum(row, column)

        def of(a: Any, b: Any) -> Any:
            """Where <left_a, right_b> stands."""
            return (a * 3 * n + b).ravel()

        mixed = np.where(row <= column, row * 3 * n + n + column, (n + column) * 3 * n + row)
        joint = np.arange(n)
        self.mass_at = of(low, high)
        self.pick = np.concatenate(
            [
                self.mass_at,
                mixed.ravel(),
                of(n + low, n + high),
                of(n + joint, 2 * n + joint),
                of(joint, 2 * n + joint),
            ]
        )
        self.triangle = (low * n + high).ravel()

    def _look(self) -> None:
        """Views of the arrays: in so short a computation making them takes a tenth of the time."""
        n, K, S = self.n, self.count, self.left[0]
        self.flat_places, self.origins = self.places.reshape(n, K, 1, 16), self.places[..., 3:]
        self.turned_places, self.turned = self.places.swapaxes(-1, -2), S.swapaxes(-1, -2)
        self.screws, self.rotating, self.shift = S.reshape(n, K, 16), S[..., :3, :3], S[..., 3:]
        self.rows, self.mass_rows = (a.reshape(-1, K, 16).transpose(1, 0, 2) for a in (self.left, S))
        self.columns = self.right.reshape(3 * n, K, 16).transpose(1, 2, 0)
        self.mass_columns = self.right[0].reshape(n, K, 16).transpose(1, 2, 0)
        self.link, self.moving, self.onto = self.both[:, 0], self.both[:, 1], self.composite[:, 0]
        self.flat_both, self.flat_composite = self.both.reshape(n, -1), self.composite.reshape(n, -1)

    def place(self, q: Array) -> None:
        """Joint frames and screws at q (K, n)."""
        at, features, screws = self.places, self.features, self.left[0]
        angle = q.T[:, :, None]
        np.cos(angle, out=features[..., 1])
        np.sin(angle, out=features[..., 2])
        if self.slides.size:
            features[self.slides, ..., 1], features[self.slides, ..., 2] = angle[self.slides], 0.0
        np.matmul(features, self.maps, out=self.flat_places)
        for j in range(1, self.n):
            at[j] = at[j - 1] @ at[j]
        np.matmul(at @ self.turns, self.turned_places, out=screws)
        np.negative(screws @ self.origins, out=self.shift)
        for j in map(int, self.slides):
            screws[j] = 0.0
            screws[j, :, :, 3] = at[j, :, :, 2]

    def tip_and_jacobian(self) -> tuple[Array, Array]:
        """x (K, 3) and each joint's column (K, n, 3) of the translational Jacobian, where `place` was."""
        x = self.places[-1] @ self.tip
        return x[:, :3, 0], (self.left[0] @ x)[:, :, :3, 0].swapaxes(0, 1)

    def tip_rotation(self) -> Array:
        """Rotation matrices (K, 3, 3) of the end effector, where `place` was."""
        return np.asarray(self.places[-1][:, :3, :3] @ self.chain.tip_turn)

    def turning(self) -> Array:
        """Each joint's angular velocity (K, n, 3) in the world, where `place` was."""
        S = self.left[0]
        return np.stack([S[..., 2, 1], S[..., 0, 2], S[..., 1, 0]], axis=-1).swapaxes(0, 1)

    def path_curvature(self, pull: Array, columns: Array) -> Array:
        """pull (K, 3) times d2x/dq dq = S_i J_j (i <= j): (K, n, n), for the Jacobian's columns (K, n, 3)."""
        turned = (pull[:, None] @ self.rotating)[:, :, 0].swapaxes(0, 1)
        products = (turned @ columns.swapaxes(1, 2)).reshape(self.count, -1)
        return products.take(self.triangle, axis=1).reshape(self.count, self.n, self.n)

    def mass_matrix(self) -> Array:
        """M (K, n, n), where `place` was."""
        n, K = self.n, self.count
        weight = self.places @ self.inertia @ self.turned_places
        composite = (self.onward @ weight.reshape(n, -1)).reshape(n, K, 4, 4)
        np.matmul(self.left[0], composite, out=self.right[0])
        mass = (self.mass_rows @ self.mass_columns).reshape(K, -1).take(self.triangle, axis=1).reshape(K, n, n)
        return mass if self.rotors is None else np.asarray(mass + self.rotors)

    def energy(self, qd: Array) -> Second:
        """The derivatives of T at qd (K, n), where `place` was."""
        n, K = self.n, self.count
        (S, Sd), (_, F, H) = self.left, self.right
        np.matmul(self.places @ self.inertia, self.turned_places, out=self.link)
        moved = self.screws * qd.T[:, :, None]
        V = (self.before @ moved.reshape(n, -1)).reshape(n, K, 4, 4)
        np.matmul(V, self.link, out=self.moving)
        np.matmul(self.onward, self.flat_both, out=self.flat_composite)
        H[:] = self.composite[:, 1]
        np.subtract(V @ S, S @ V, out=Sd)
        np.matmul(self.left, self.onto, out=self.right[:2])
        F += H @ self.turned
        F -= self.turned @ H
        products = self.rows @ self.columns
        found = products.reshape(K, -1).take(self.pick, axis=1)
        by_qd = found[:, -n:]
        second = found[:, : 3 * n * n].reshape(K, 3, n, n)
        mass = second[:, 0]
        if self.rotors is not None:
            mass += self.rotors
            by_qd += self.chain.armature * qd
        return Second(found[:, 3 * n * n : -n], by_qd, mass, second[:, 1], second[:, 2])


def _local(chain: Chain) -> Array:
    """(n, 3, 16): the place of joint frame j in frame j - 1 by 1, cos q, sin q; by 1, q where it slides."""
    out = np.zeros((chain.n, 3, 4, 4))
    out[:, 0, :3, 3], out[:, 0, 3, 3] = chain.shift, 1.0
    for j, turn in enumerate(chain.turn):
        if chain.slides[j]:
            out[j, 0, :3, :3], out[j, 1, :3, 3] = turn, turn[:, 2]
            continue
        out[j, 0, :3, 2] = turn[:, 2]
        out[j, 1, :3, :2] = turn[:, :2]
        out[j, 2, :3, 0], out[j, 2, :3, 1] = turn[:, 1], -turn[:, 0]
    return out.reshape(chain.n, 3, 16)


def _pseudo_inertias(chain: Chain) -> Array:
    """J (n, 4, 4) of what moves with each joint, in its frame (Wensing, Kim and Slotine 2018)."""
    out = np.zeros((chain.n, 4, 4))
    half = 0.5 * np.trace(chain.inertia, axis1=1, axis2=2)
    out[:, :3, :3] = half[:, None, None] * np.eye(3) - chain.inertia
    out[:, :3, 3] = out[:, 3, :3] = chain.moment
    out[:, 3, 3] = chain.mass
    return out
