"""What an arm stands on. The protocol that all bases answer, and the bases that stand still.

A base that moves, or that is held so that the forces on it can be seen, has its pose as coordinates before the joints:
all that is known of an arm then holds with n = base coordinates + joints. How its velocities follow the joints' qd_m is

    qd = B(q) qd_m + d(q)

with B (n, joints) and d (n,) of the base. One that floats is in `floating.py`; to each question one that stands still
answers with what changes nothing: no rows, no drift, no turn.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar, Literal, Protocol

import numpy as np

from pipeline.common.arrays import Array
from pipeline.model.coordinates import SPACE, Coordinates
from pipeline.robot.description import Description
from pipeline.robot.mounting import Mounting
from pipeline.robot.spacecraft import Spacecraft, on_moving_base


class System(Protocol):
    """What a base asks of the arm that stands on it."""

    @property
    def n(self) -> int:
        """The number of all coordinates, the base's and the joints'."""

    @property
    def mounting(self) -> Mounting:
        """Where the base starts."""

    def mass_matrix(self, q: Array) -> Array:
        """M(q) (K, n, n)."""

    def momentum_gradient(self, q: Array, qd: Array) -> tuple[Array, Array]:
        """M(q) qd (K, n) and its derivative by q (K, n, n)."""


class Base(Protocol):
    """What an arm stands on. Arguments are stacked: q, qd (K, n); `arm` is the one that stands on it."""

    @property
    def kind(self) -> Literal["fixed", "held", "floating"]:
        """fixed: it has no coordinates. held: it has, and stands still. floating: free, without forces from outside."""

    @property
    def count(self) -> int:
        """The number of its coordinates, which stand before the joints: 0, 3 or 6."""

    @property
    def angles(self) -> slice:
        """Those of the n coordinates that turn it."""

    @property
    def spacecraft(self) -> Spacecraft:
        """The body that is bolted to the root link, and the momentum of the whole system; no mass if there is none."""

    def extend(self, description: Description) -> Description:
        """The description with the base's coordinates before the joints."""

    def motion_map(self, arm: System, q: Array) -> Array:
        """B (K, n, joints)."""

    def drift(self, arm: System, q: Array) -> Array:
        """d (K, n): the velocities of an arm whose joints stand still."""

    def momentum_residual(self, arm: System, q: Array, qd: Array) -> tuple[Array, Array, Array]:
        """What must be zero so that momentum is conserved (K, rows), its derivatives by q and by qd (K, rows, n)."""

    def mean_momentum_residual(self, arm: System, q: Array, qd: Array, dt: Array) -> tuple[Array, Array, Array]:
        """The same over intervals dt (K,) [s] from q at constant qd."""

    def after_cycle(self, arm: System, q: Array) -> Array | None:
        """A basis (count, k) of the base's velocities by which it may be off its start when the joints have come back.

        At one configuration q (n,). None: it has drifted away.
        """

    def turning_metric(self, q: Array) -> Array:
        """S (K, n, n) with |w|^2 = qd' S qd for its angular velocity w."""

    def turning(self, q: Array, qd: Array) -> tuple[Array, Array, Array]:
        """|w|^2 (K,) [rad^2/s^2] and its derivatives by q and by qd (K, n)."""

    def attitude_cosine(self, q: Array) -> tuple[Array, Array]:
        """The cosine (K,) of the angle by which it has turned from its start, and its derivative (K, n)."""


@dataclass(frozen=True)
class Fixed:
    """A base that stands still; the methods are described in `Base`."""

    spacecraft: ClassVar[Spacecraft] = Spacecraft()

    @property
    def kind(self) -> Literal["fixed", "held", "floating"]:
        return "fixed"

    @property
    def count(self) -> int:
        return 0

    @property
    def angles(self) -> slice:
        return slice(0)

    def extend(self, description: Description) -> Description:
        return description

    def motion_map(self, arm: System, q: Array) -> Array:
        """B = [0; I]."""
        return np.broadcast_to(np.eye(arm.n)[:, self.count :], (len(q), arm.n, arm.n - self.count))

    def drift(self, arm: System, q: Array) -> Array:
        return np.zeros_like(q)

    def momentum_residual(self, arm: System, q: Array, qd: Array) -> tuple[Array, Array, Array]:
        none = np.zeros((len(q), 0, arm.n))
        return none[:, :, 0], none, none

    def mean_momentum_residual(self, arm: System, q: Array, qd: Array, dt: Array) -> tuple[Array, Array, Array]:
        return self.momentum_residual(arm, q, qd)

    def after_cycle(self, arm: System, q: Array) -> Array | None:
        return np.zeros((self.count, 0))

    def turning_metric(self, q: Array) -> Array:
        return np.zeros((*q.shape, q.shape[1]))

    def turning(self, q: Array, qd: Array) -> tuple[Array, Array, Array]:
        return np.zeros(len(q)), np.zeros_like(q), np.zeros_like(q)

    def attitude_cosine(self, q: Array) -> tuple[Array, Array]:
        return np.ones(len(q)), np.zeros_like(q)


@dataclass(frozen=True)
class Held(Fixed):
    """A base that stands still and has coordinates: its generalized forces are what holds it."""

    coordinates: Coordinates = SPACE

    @property
    def kind(self) -> Literal["fixed", "held", "floating"]:
        return "held"

    @property
    def count(self) -> int:
        return len(self.coordinates.names)

    @property
    def angles(self) -> slice:
        return slice(self.coordinates.positions, self.count)

    def extend(self, description: Description) -> Description:
        return on_moving_base(description, self.spacecraft, self.coordinates.names)


FIXED = Fixed()
