"""Groups `objective`, `limits` and `boundary`: what is minimised, and within which bounds."""

from __future__ import annotations

from typing import Annotated, ClassVar, Literal, get_args

from pydantic import AfterValidator, Field

from pipeline.config.fields import Number, OneOrList, Switch, Text, once, schema

# The words of problem/integrals.py, whose floor is above: what an integral is, no configuration needs to know.
Integral = Literal["kinetic_energy", "torque", "velocity_norm", "base_rotation", "reaction_force", "reaction_torque"]
INTEGRALS: tuple[str, ...] = get_args(Integral)

Positive = Annotated[Number, Field(gt=0)]
Bound = Annotated[Number, Field(ge=1e-9)]  # robot.limits.STILL: nothing moves below it
Weight = Annotated[Number, Field(ge=0)]
Share = Annotated[Number, Field(ge=0, le=1)]


@schema
class SecondaryConfig:
    """What every objective can have beside it: k0 times a criterion that is to be large."""

    secondary: Annotated[
        Literal["none", "manipulability", "joint_centering", "both"],
        Field(description="criterion that is to be large beside the objective; joint_centering: in the joint limits"),
    ] = "none"
    k0: Annotated[Weight, Field(description="weight of the criterion: k0 times its integral is taken off")] = 1.0

    @property
    def criteria(self) -> tuple[str, ...]:
        return {"none": (), "both": ("manipulability", "joint_centering")}.get(self.secondary, (self.secondary,))


@schema
class KineticEnergyConfig(SecondaryConfig):
    """`objective=kinetic_energy`: the integral of the kinetic energy."""

    kind: Literal["kinetic_energy"] = "kinetic_energy"
    weights: ClassVar[dict[str, float]] = {"kinetic_energy": 1.0}


@schema
class TorqueConfig(SecondaryConfig):
    """`objective=torque`: the integral of the squared joint torques."""

    kind: Literal["torque"] = "torque"
    weights: ClassVar[dict[str, float]] = {"torque": 1.0}


@schema
class VelocityNormConfig(SecondaryConfig):
    """`objective=velocity_norm`: the integral of the squared joint velocities."""

    kind: Literal["velocity_norm"] = "velocity_norm"
    weights: ClassVar[dict[str, float]] = {"velocity_norm": 1.0}


@schema
class BaseRotationConfig(SecondaryConfig):
    """`objective=base_rotation`: the integral of a floating base's squared angular velocity."""

    kind: Literal["base_rotation"] = "base_rotation"
    weights: ClassVar[dict[str, float]] = {"base_rotation": 1.0}


@schema
class ReactionConfig(SecondaryConfig):
    """`objective=reaction`: weights of the integrals of the squared force and torque on a base that is held."""

    kind: Literal["reaction"] = "reaction"
    force: Annotated[Weight, Field(description="[1/(N^2 s)] weight of the squared force")] = 0.0
    torque: Annotated[Weight, Field(description="[1/(N^2 m^2 s)] weight of the squared torque")] = 1.0

    @property
    def weights(self) -> dict[str, float]:
        return {"reaction_force": self.force, "reaction_torque": self.torque}


@schema
class WeightedConfig(SecondaryConfig):
    """`objective=weighted`: a convex combination of kinetic energy, squared torques and a floating base's rotation."""

    kind: Literal["weighted"] = "weighted"
    kinetic_energy: Annotated[Share, Field(description="[1/(J s)] weight; the weights add up to 1")] = 0.5
    torque: Annotated[Share, Field(description="[1/(N^2 m^2 s)] weight of the squared torques")] = 0.5
    base_rotation: Annotated[Share, Field(description="[s/rad^2] weight of a floating base's rotation")] = 0.0

    @property
    def weights(self) -> dict[str, float]:
        return {"kinetic_energy": self.kinetic_energy, "torque": self.torque, "base_rotation": self.base_rotation}


ObjectiveConfig = (
    KineticEnergyConfig | TorqueConfig | VelocityNormConfig | BaseRotationConfig | ReactionConfig | WeightedConfig
)


@schema
class LimitsConfig:
    """Group `limits`: which bounds the motion must keep.

    `kind` says which of the robot description's own limits hold (joint: position and velocity; joint_torque_power:
    torque too, and the power given here); a value given here (one, or one per joint) overrides or adds to them.
    """

    kind: Annotated[
        Literal["none", "joint", "joint_torque_power"],
        Field(description="which limits of the robot description hold; a value below overrides or adds to them"),
    ] = "none"
    lower: Annotated[OneOrList[Number] | None, Field(description="[rad] least joint position, one or per joint")] = None
    upper: Annotated[OneOrList[Number] | None, Field(description="[rad] largest joint position, the same way")] = None
    velocity: Annotated[OneOrList[Bound] | None, Field(description="[rad/s] largest joint speed")] = None
    torque: Annotated[OneOrList[Bound] | None, Field(description="[N m] largest joint torque")] = None
    power: Annotated[
        OneOrList[Bound] | None, Field(description="[W] largest |torque x velocity|; no robot description has it")
    ] = None
    acceleration: Annotated[
        OneOrList[Bound] | None, Field(description="[rad/s^2] largest joint acceleration, between the knots too")
    ] = None
    jerk: Annotated[
        OneOrList[Bound] | None, Field(description="[rad/s^3] largest joint jerk; needs boundary.zero_acceleration")
    ] = None
    tool_speed: Annotated[
        Bound | None,
        Field(description="[m/s] largest linear speed of the end effector; how fast it turns is not limited"),
    ] = None
    tool_acceleration: Annotated[
        Bound | None,
        Field(description="[m/s^2] largest linear acceleration of the end effector, along its path and across it"),
    ] = None
    file: Annotated[
        Text | None,
        Field(description="YAML file of ROS 2, joint_limits.yaml: what it states holds, a value given here overrides"),
    ] = None
    attitude: Annotated[
        Annotated[Number, Field(ge=1e-9, le=1.5)] | None,
        Field(description="[rad] by how much a floating base may turn from its start, at any time"),
    ] = None


@schema
class BoundaryConfig:
    """Group `boundary`: what is prescribed at the ends of the joint motion."""

    kind: Annotated[
        Literal["fixed", "free", "cyclic"],
        Field(description="fixed: starts at robot.q_init; free: anywhere on its manifold; cyclic: ends as it began"),
    ] = "fixed"
    rest: Annotated[
        Annotated[tuple[Literal["start", "end"], ...], AfterValidator(once)] | None,
        Field(
            description="at which ends all joints rest, so that the motion can be sent to a robot; null: at both, but "
            "for the arms in robots/, moving bases, paths that are entered at speed, and runs without the method global"
        ),
    ] = None
    zero_acceleration: Annotated[
        Switch, Field(description="whether they do not accelerate there either, as limits of jerk need")
    ] = False
