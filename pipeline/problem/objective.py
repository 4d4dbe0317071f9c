"""What is minimised: a weighted sum of integrals, and bounds on them."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from pipeline.problem.secondary import Secondary


@dataclass(frozen=True)
class Objective:
    """A sum of integrals: weights of the kinetic energy, the squared joint torques and the squared joint velocities;
    what `secondary` gains is taken off (Pontryagin report eq. (13) with the sign that maximises it).

    Of the base: the squared angular velocity of one that floats; the squared force and torque on one that is held.
    """

    kinetic_energy: float = 1.0
    torque: float = 0.0
    velocity_norm: float = 0.0
    secondary: Secondary | None = None
    base_rotation: float = 0.0
    reaction_force: float = 0.0
    reaction_torque: float = 0.0

    @property
    def second_order(self) -> bool:
        """Whether accelerations count."""
        return self.torque > 0 or self.reaction_force > 0 or self.reaction_torque > 0


INTEGRALS = ("kinetic_energy", "torque", "base_rotation", "reaction_force", "reaction_torque")


@dataclass(frozen=True)
class IntegralBounds:
    """Upper bounds on the same integrals; infinite where there is none."""

    kinetic_energy: float = np.inf
    torque: float = np.inf
    base_rotation: float = np.inf
    reaction_force: float = np.inf
    reaction_torque: float = np.inf

    def bounds(self, *names: str) -> bool:
        """Whether one of the integrals `names` is bounded."""
        return any(np.isfinite(getattr(self, name)) for name in names)
