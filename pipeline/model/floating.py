"""A base that floats: a spacecraft without external forces.

The momentum of the whole system is constant (Umetani and Yoshida 1989):

    M_b(q) qd = p(q)    =>    qd = B(q) qd_m + d(q),    B = [-M_bb^-1 M_bm; I],    d = [M_bb^-1 p; 0],

M_b being the base's rows of the inertia matrix, [M_bb M_bm], and qd_m the joints' velocities. J B is the generalized
Jacobian, B' M B = M_mm - M_mb M_bb^-1 M_bm the reduced inertia. The attitude is not a function of the joint positions
(the constraint is not integrable): it is a state of the motion.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache
from typing import Literal

import numpy as np
from scipy.linalg import null_space
from scipy.spatial.transform import Rotation

from pipeline.common.arrays import Array
from pipeline.model.arm import Arm
from pipeline.model.base import System
from pipeline.model.coordinates import PLANE, SPACE, Coordinates
from pipeline.model.stack import STEP
from pipeline.robot.description import Description
from pipeline.robot.spacecraft import Spacecraft, on_moving_base


@dataclass(frozen=True)
class Floating:
    """A base that floats with the body `spacecraft` bolted to the root link; the methods are described in `Base`.

    An arm on one is `Arm(description, mounting, Floating(spacecraft))`. coordinates: SPACE, or PLANE of a planar arm
    (see `pose_coordinates`).
    """

    spacecraft: Spacecraft
    coordinates: Coordinates = SPACE

    @property
    def kind(self) -> Literal["fixed", "held", "floating"]:
        return "floating"

    @property
    def count(self) -> int:
        return len(self.coordinates.names)

    @property
    def angles(self) -> slice:
        return slice(self.coordinates.positions, self.count)

    def extend(self, description: Description) -> Description:
        return on_moving_base(description, self.spacecraft, self.coordinates.names)

    # --- momentum -----------------------------------------------------------------------------------------------

    def motion_map(self, arm: System, q: Array) -> Array:
        """B = [-M_bb^-1 M_bm; I]."""
        nb = self.count
        out = np.zeros((len(q), arm.n, arm.n - nb))
        out[:, nb:] = np.eye(arm.n - nb)
        inertia = arm.mass_matrix(q)
        out[:, :nb] = -np.linalg.solve(inertia[:, :nb, :nb], inertia[:, :nb, nb:])
        return out

    def drift(self, arm: System, q: Array) -> Array:
        """d = [M_bb^-1 p; 0]."""
        nb, out = self.count, np.zeros_like(q)
        if any(self.spacecraft.momentum):
            inertia = arm.mass_matrix(q)[:, :nb, :nb]
            out[:, :nb] = np.linalg.solve(inertia, self._momentum(arm, q)[:, :, None])[:, :, 0]
        return out

    def _momentum(self, arm: System, q: Array) -> Array:
        """p (K, count): the generalized momentum that the system's linear and angular one give at the pose q.

        The conjugate of a coordinate that turns about an axis a is a' L, L the angular momentum about the base.
        """
        linear, angular = _in_start_frame(self.spacecraft.momentum, arm.mounting.base_rpy)
        positions = self.coordinates.positions
        r = np.zeros((len(q), 3))
        r[:, :positions] = q[:, :positions]
        axes = self.coordinates.axes(q[:, self.angles])
        turned = np.einsum("kij,ki->kj", axes, angular - np.cross(r, linear))
        return np.hstack([np.tile(linear[:positions], (len(q), 1)), turned])

    def momentum_residual(self, arm: System, q: Array, qd: Array) -> tuple[Array, Array, Array]:
        """M_b(q) qd - p(q) (K, count), its derivatives by q (by central differences) and by qd: M_b."""
        nb = self.count
        value, by_q = (part[:, :nb] for part in arm.momentum_gradient(q, qd))
        if any(self.spacecraft.momentum):
            for j, unit in enumerate(np.eye(arm.n)[:nb]):
                ahead, behind = self._momentum(arm, q + STEP * unit), self._momentum(arm, q - STEP * unit)
                by_q[:, :, j] -= (ahead - behind) / (2 * STEP)
        return value - self._momentum(arm, q), by_q, arm.mass_matrix(q)[:, :nb]

    def mean_momentum_residual(self, arm: System, q: Array, qd: Array, dt: Array) -> tuple[Array, Array, Array]:
        """The same over intervals dt (K,) from q at constant qd.

        Linear momentum by how far the centre of mass has moved: exact, so that a cycle of the joints brings it back to
        where it was. Angular momentum has no such integral: it is taken in the middle, which is of second order in dt.
        """
        half, step = dt[:, None, None] / 2, dt[:, None, None]
        value, by_q, by_qd = self.momentum_residual(arm, q + half[:, 0] * qd, qd)
        by_qd = by_qd + half * by_q
        before, by_before = self.center_of_mass(arm, q)
        after, by_after = self.center_of_mass(arm, q + step[:, 0] * qd)
        linear, mass = slice(self.coordinates.positions), self.mass(arm)
        own, _ = _in_start_frame(self.spacecraft.momentum, arm.mounting.base_rpy)
        value[:, linear] = mass * (after - before) / step[:, 0] - own[linear]
        by_q[:, linear] = mass * (by_after - by_before) / step
        by_qd[:, linear] = mass * by_after
        return value, by_q, by_qd

    def mass(self, arm: System) -> float:
        """Of the whole system [kg]."""
        return float(arm.mass_matrix(np.zeros((1, arm.n)))[0, 0, 0])

    def center_of_mass(self, arm: System, q: Array) -> tuple[Array, Array]:
        """The whole system's (K, 2 or 3) [m] in the frame in which the base starts, and its derivative (K, 2 or 3, n).

        Both stand in the inertia matrix: the base's rows of positions are mass dc/dq.
        """
        inertia, positions = arm.mass_matrix(q), self.coordinates.positions
        by_q = inertia[:, :positions] / inertia[:, :1, :1]
        return q[:, :positions] + self.coordinates.center(q[:, self.angles], by_q), by_q

    def after_cycle(self, arm: System, q: Array) -> Array | None:
        """Turns about the centre of mass, if that rests."""
        if any(self.spacecraft.momentum[:3]):
            return None
        return np.asarray(null_space(self.center_of_mass(arm, q[None])[1][0, :, : self.count]))

    # --- attitude -----------------------------------------------------------------------------------------------

    def turning_metric(self, q: Array) -> Array:
        out = np.zeros((*q.shape, q.shape[1]))
        out[:, self.angles, self.angles] = self.coordinates.metric(q[:, self.angles])
        return out

    def turning(self, q: Array, qd: Array) -> tuple[Array, Array, Array]:
        by_qd = 2 * np.einsum("kij,kj->ki", self.turning_metric(q), qd)
        by_q = np.zeros_like(q)
        by_q[:, self.angles] = self.coordinates.metric_gradient(q[:, self.angles], qd[:, self.angles])
        return 0.5 * (qd * by_qd).sum(axis=1), by_q, by_qd

    def attitude_cosine(self, q: Array) -> tuple[Array, Array]:
        by_q = np.zeros_like(q)
        value, by_q[:, self.angles] = self.coordinates.cosine(q[:, self.angles])
        return value, by_q


@cache
def _in_start_frame(momentum: tuple[float, ...], rpy: tuple[float, ...]) -> tuple[Array, Array]:
    """Linear and angular momentum in the frame in which the base starts, from those in the world."""
    both = np.array(momentum, dtype=float).reshape(2, 3)
    linear, angular = Rotation.from_euler("xyz", rpy).inv().apply(both)
    return linear, angular


def pose_coordinates(arm: Arm, spacecraft: Spacecraft) -> Coordinates:
    """PLANE if the base of `arm` would stay in the x-y plane in which it stands, whatever the joints do; else SPACE."""
    floating = Arm(arm.on_fixed_base.description, arm.mounting, Floating(spacecraft, SPACE))
    q = np.random.default_rng(0).uniform(-1.0, 1.0, size=(8, floating.n))
    q[:, [2, 4, 5]] = 0.0
    inertia = floating.mass_matrix(q)
    out, within = [2, 4, 5], [0, 1, 3, *range(6, floating.n)]
    planar = np.abs(inertia[:, out][:, :, within]).max() < 1e-10 * np.abs(inertia).max()
    return PLANE if planar else SPACE
