"""Groups `objective`, `limits` and `boundary`: what is minimised, and within which bounds."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

from pipeline.config.fields import choice, fixed, number, per_joint

# The words of problem/integrals.py, whose floor is above: what an integral is, no configuration needs to know.
INTEGRALS = ("kinetic_energy", "torque", "velocity_norm", "base_rotation", "reaction_force", "reaction_torque")


@dataclass(frozen=True)
class SecondaryConfig:
    """What every objective can have beside it: k0 times a criterion that is to be large."""

    secondary: str = choice("none", "none", "manipulability", "joint_centering", "both")
    k0: float = number(1.0, low=0)

    @property
    def criteria(self) -> tuple[str, ...]:
        return {"none": (), "both": ("manipulability", "joint_centering")}.get(self.secondary, (self.secondary,))


@dataclass(frozen=True)
class KineticEnergyConfig(SecondaryConfig):
    """`objective=kinetic_energy`: the integral of the kinetic energy."""

    kind: str = fixed("kinetic_energy")
    weights: ClassVar[dict[str, float]] = {"kinetic_energy": 1.0}


@dataclass(frozen=True)
class TorqueConfig(SecondaryConfig):
    """`objective=torque`: the integral of the squared joint torques."""

    kind: str = fixed("torque")
    weights: ClassVar[dict[str, float]] = {"torque": 1.0}


@dataclass(frozen=True)
class VelocityNormConfig(SecondaryConfig):
    """`objective=velocity_norm`: the integral of the squared joint velocities."""

    kind: str = fixed("velocity_norm")
    weights: ClassVar[dict[str, float]] = {"velocity_norm": 1.0}


@dataclass(frozen=True)
class BaseRotationConfig(SecondaryConfig):
    """`objective=base_rotation`: the integral of a floating base's squared angular velocity."""

    kind: str = fixed("base_rotation")
    weights: ClassVar[dict[str, float]] = {"base_rotation": 1.0}


@dataclass(frozen=True)
class ReactionConfig(SecondaryConfig):
    """`objective=reaction`: weights of the integrals of the squared force and torque on a base that is held."""

    kind: str = fixed("reaction")
    force: float = number(0.0, low=0, unit="1/(N^2 s)")
    torque: float = number(1.0, low=0, unit="1/(N^2 m^2 s)")

    @property
    def weights(self) -> dict[str, float]:
        return {"reaction_force": self.force, "reaction_torque": self.torque}


@dataclass(frozen=True)
class WeightedConfig(SecondaryConfig):
    """`objective=weighted`: a convex combination of kinetic energy, squared torques and a floating base's rotation."""

    kind: str = fixed("weighted")
    kinetic_energy: float = number(0.5, low=0, high=1)
    torque: float = number(0.5, low=0, high=1)
    base_rotation: float = number(0.0, low=0, high=1)

    @property
    def weights(self) -> dict[str, float]:
        return {"kinetic_energy": self.kinetic_energy, "torque": self.torque, "base_rotation": self.base_rotation}


ObjectiveConfig = (
    KineticEnergyConfig | TorqueConfig | VelocityNormConfig | BaseRotationConfig | ReactionConfig | WeightedConfig
)


@dataclass(frozen=True)
class LimitsConfig:
    """Group `limits`: which bounds the motion must keep.

    `kind` says which of the robot description's own limits hold (joint: position and velocity; joint_torque_power:
    torque too, and the power given here); a value given here (one, or one per joint) overrides or adds to them.
    """

    kind: str = choice("none", "none", "joint", "joint_torque_power")
    lower: float | list[float] | None = per_joint(unit="rad")
    upper: float | list[float] | None = per_joint(unit="rad")
    velocity: float | list[float] | None = per_joint(above=0, unit="rad/s")
    torque: float | list[float] | None = per_joint(above=0, unit="N m")
    power: float | list[float] | None = per_joint(above=0, unit="W")
    attitude: float | None = number(None, above=0, high=1.5, unit="rad")


@dataclass(frozen=True)
class BoundaryConfig:
    """Group `boundary`: what is prescribed at the ends of the joint motion."""

    kind: str = choice("fixed", "fixed", "free", "cyclic")
