"""The typed schema of `conf/`: one dataclass per group. The only place where keys and their bounds are known.

Defaults here equal the files under `conf/` (a test compares them), so that the same options serve Python callers.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, ClassVar

from pipeline.schema import (
    angle_or_vector,
    any_number,
    build,
    choice,
    choices,
    count,
    fixed,
    intervals,
    mapping,
    number,
    numbers,
    one_of,
    part,
    per_joint,
    switch,
    table_of,
    table_of_numbers,
    text,
    word_or_vector,
)

METHODS = (
    "lsv",
    "inertia_weighted",
    "pmke",
    "global",
    "dynamic_programming",
    "calculus_of_variations",
    "pontryagin",
    "pareto",
)
INTEGRALS = ("kinetic_energy", "torque", "base_rotation", "reaction_force", "reaction_torque")
DEFAULT_METHODS = ("lsv", "pmke", "global")


@dataclass(frozen=True)
class SphereConfig:
    """A sphere."""

    kind: str = fixed("sphere")
    center: list[float] = numbers([0.0, 0.0, 0.0], length=3, unit="m")
    radius: float = number(0.1, above=0, unit="m")


@dataclass(frozen=True)
class BoxConfig:
    """A box: its edges, and roll, pitch, yaw."""

    kind: str = fixed("box")
    center: list[float] = numbers([0.0, 0.0, 0.0], length=3, unit="m")
    size: list[float] = numbers([0.1, 0.1, 0.1], length=3, above=0, unit="m")
    rpy: list[float] = numbers([0.0, 0.0, 0.0], length=3, unit="rad")


@dataclass(frozen=True)
class CapsuleConfig:
    """All points within `radius` of the segment from start to end."""

    kind: str = fixed("capsule")
    start: list[float] = numbers([0.0, 0.0, 0.0], length=3, unit="m")
    end: list[float] = numbers([0.0, 0.0, 0.1], length=3, unit="m")
    radius: float = number(0.1, above=0, unit="m")


SHAPES = {"sphere": SphereConfig, "box": BoxConfig, "capsule": CapsuleConfig}


@dataclass(frozen=True)
class RobotConfig:
    """Group `robot`: the description, the end effector, what of it is prescribed, and where the arm starts."""

    name: str = text("planar3r")
    urdf: str = text("robots/planar3r.urdf")
    base: str | None = text(None)
    end_effector: str = text("tip")
    offset: list[float] = numbers([0.0, 0.0, 0.0], length=3, unit="m")
    offset_rpy: list[float] = numbers([0.0, 0.0, 0.0], length=3, unit="rad")
    base_position: list[float] = numbers([0.0, 0.0, 0.0], length=3, unit="m")
    base_rpy: list[float] = numbers([0.0, 0.0, 0.0], length=3, unit="rad")
    payload: float = number(0.0, low=0, unit="kg")
    armature: float | list[float] = per_joint(0.0, low=0, unit="kg m^2")
    task: list[str] = choices(["x", "y"], "x", "y", "z")
    orientation: str = choice("none", "none", "full", "pointing")
    pointing: list[float] = numbers([0.0, 0.0, 1.0], length=3)
    collision: dict[str, list[SphereConfig | BoxConfig | CapsuleConfig]] | None = table_of(SHAPES, listed=True)
    q_init: list[float] | None = numbers([0.0, 0.327, -0.754], unit="rad", optional=True)
    locked: dict[str, float] | None = mapping(any_number, optional=True)


@dataclass(frozen=True)
class FixedBaseConfig:
    """`base=fixed`: the root link stands where robot.base_position puts it."""

    kind: str = fixed("fixed")


@dataclass(frozen=True)
class FreeBaseConfig:
    """`base=free`: the root link is bolted to a spacecraft that floats; its pose at the start is robot.base_position's.

    mass, inertia and com are those of the spacecraft, beside the root link's own; null: the root link is the base.
    inertia: one moment for all axes, three, or ixx, iyy, izz, ixy, ixz, iyz, about com in the frame of the root link.
    """

    kind: str = fixed("free")
    mass: float | None = number(None, above=0, unit="kg")
    inertia: float | list[float] = per_joint(0.0, unit="kg m^2")
    com: list[float] = numbers([0.0, 0.0, 0.0], length=3, unit="m")
    linear_momentum: list[float] = numbers([0.0, 0.0, 0.0], length=3, unit="N s")
    angular_momentum: list[float] = numbers([0.0, 0.0, 0.0], length=3, unit="N m s")


@dataclass(frozen=True)
class PathConfig:
    """What every path has for tasks with an orientation: the one it starts with, and how far it turns to its end."""

    orientation: list[float] | None = numbers(None, length=3, unit="rad")
    turn: list[float] = numbers([0.0, 0.0, 0.0], length=3, unit="rad")


@dataclass(frozen=True)
class LineConfig(PathConfig):
    """`path=line`: straight, `length` m along `direction`."""

    kind: str = fixed("line")
    length: float = number(0.4, above=0, unit="m")
    direction: float | list[float] = angle_or_vector(157.5)
    start: list[float] | None = numbers(None, unit="m")


@dataclass(frozen=True)
class CircleConfig(PathConfig):
    """`path=circle`: through the start, centre `radius` m away along `center_direction`; `angle` deg of it."""

    kind: str = fixed("circle")
    radius: float = number(0.05, above=0, unit="m")
    center_direction: float | list[float] = angle_or_vector(180.0)
    clockwise: bool = switch(False)
    angle: float = number(360.0, above=0, unit="deg")
    normal: list[float] = numbers([0.0, 0.0, 1.0], length=3)
    start: list[float] | None = numbers(None, unit="m")


@dataclass(frozen=True)
class WaypointsConfig(PathConfig):
    """`path=waypoints`: a smooth curve through the rows of a CSV file."""

    kind: str = fixed("waypoints")
    file: str = text("")
    relative: bool = switch(False)


@dataclass(frozen=True)
class TimingConfig:
    """Group `timing`: the law s(t), the motion time and the number of intervals of the global grid."""

    law: str = choice("raised_cosine", "raised_cosine", "constant_speed", "quintic")
    duration: float = number(10.0, above=0, unit="s")
    steps: int = count(100, low=2, high=100_000)
    dense: list[list[float]] = intervals()


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
class ObstaclesConfig:
    """Group `obstacles`: solids in the world, by name, and the clearance that moving links keep from them."""

    margin: float = number(0.02, above=0, unit="m")
    influence: float = number(0.05, above=0, unit="m")
    shapes: dict[str, SphereConfig | BoxConfig | CapsuleConfig] = table_of(SHAPES)


@dataclass(frozen=True)
class BoundaryConfig:
    """Group `boundary`: what is prescribed at the ends of the joint motion."""

    kind: str = choice("fixed", "fixed", "free", "cyclic")


@dataclass(frozen=True)
class LsvOptions:
    """Least-squares velocities: qd = J+ (xd + gain (x_ref - x))."""

    dt: float = number(0.01, above=0, unit="s")
    integrator: str = choice("heun", "euler", "heun")
    gain: float = number(0.0, low=0, unit="1/s")
    singular_value: float = number(0.03, above=0)
    max_drift: float = number(0.01, above=0, unit="m")


@dataclass(frozen=True)
class PmkeOptions:
    """Predictive minimisation of the kinetic energy: the parameters of Table 2 of its paper."""

    dt: float = number(0.01, above=0, unit="s")
    prediction_step: float = number(1.0, above=0, unit="s")
    horizon: int = count(2)
    update_interval: float = number(0.5, above=0, unit="s")
    objective: str = choice("problem", "problem", "kinetic_energy", "torque")
    limits: bool = switch(False)
    tail: int = count(8, low=0)
    interpolation: str = choice("quintic", "quintic", "cubic")
    gain: float = number(0.0, low=0, unit="1/s")
    tolerance: float = number(1e-8, above=0)
    singular_value: float = number(0.03, above=0)
    max_drift: float = number(0.01, above=0, unit="m")


@dataclass(frozen=True)
class GlobalOptions:
    """The interpolation-based Global Kinematic Planner; counts as in its paper."""

    starts: str = choice("population", "population", "dynamic_programming", "both")
    configurations: int = count(66)
    draw: str = choice("normal", "normal", "latin_hypercube", "uniform")
    candidates: int | None = count(None)
    optimised: int = count(48)
    limit_weight: float = number(0.01, low=0)
    coarse_steps: int = count(12, low=2)
    tolerance: float = number(1e-8, above=0)
    max_iterations: int = count(300)
    same_path: float = number(0.05, above=0, unit="rad")


@dataclass(frozen=True)
class DynamicProgrammingOptions:
    """Dynamic programming on a grid of the self-motion manifold (r = 1)."""

    nodes: int = count(360, low=8)
    intervals: int | None = count(25, low=2)
    velocity_slack: float = number(0.0, low=0)
    same_path: float = number(0.2, above=0, unit="rad")


@dataclass(frozen=True)
class CalculusOfVariationsOptions:
    """Stationary motions of the kinetic-energy integral (r = 1, no limits)."""

    spacing: float = number(0.03, above=0, unit="rad")
    refinements: int = count(3, low=0)
    scan_tolerance: float = number(1e-6, above=0)
    tolerance: float = number(1e-10, above=0)
    max_speed: float | None = number(None, above=0, unit="rad/s")


@dataclass(frozen=True)
class PontryaginOptions:
    """The maximum principle: as the report prints it, and its correct two-point boundary-value problem."""

    formulation: str = choice("boundary_value", "as_printed", "boundary_value", "both")
    dt: float = number(0.01, above=0, unit="s")
    max_drift: float = number(0.1, above=0, unit="m")
    guesses: int = count(24)
    intervals: int = count(40, low=4)
    tolerance: float = number(1e-9, above=0)
    max_nodes: int = count(20000, low=10)
    same_path: float = number(0.01, above=0, unit="rad")


@dataclass(frozen=True)
class ParallelConfig:
    """Group `parallel`: how independent solves are spread."""

    workers: int | None = count(None)
    address: str | None = text(None)


@dataclass(frozen=True)
class SweepConfig:
    """What a sweep does besides its runs."""

    resume: bool = switch(True)


@dataclass(frozen=True)
class MethodConfig:
    """Group `method`: the options of every method; the key `methods` says which of them run."""

    lsv: LsvOptions = part(LsvOptions)
    inertia_weighted: LsvOptions = part(LsvOptions)
    pmke: PmkeOptions = part(PmkeOptions)
    global_: GlobalOptions = part(GlobalOptions)
    dynamic_programming: DynamicProgrammingOptions = part(DynamicProgrammingOptions)
    calculus_of_variations: CalculusOfVariationsOptions = part(CalculusOfVariationsOptions)
    pontryagin: PontryaginOptions = part(PontryaginOptions)


@dataclass(frozen=True)
class CandidateStudyConfig:
    """The Global paper's Fig. 1: how near the best of so many candidates comes to the optimum."""

    run: bool = switch(False)
    most: int = count(10000, low=100)
    repeats: int = count(5)


@dataclass(frozen=True)
class ParetoOptions:
    """Pareto front of two integrals: method `pareto`."""

    method: str = choice("epsilon_constraint", "epsilon_constraint", "weighting")
    objectives: list[str] = choices(INTEGRALS[:2], *INTEGRALS)
    steps: int = count(10, low=2)
    rounds: int = count(3, low=0)
    tolerance: float = number(1e-8, above=0)
    max_iterations: int = count(200)


@dataclass(frozen=True)
class ExportConfig:
    """The motion that is written for a controller: `best`, the cheapest confirmed one, `none`, or that of one method."""

    method: str = choice("best", "best", "none", *METHODS)
    rate: float = number(100.0, above=0, high=10_000, unit="Hz")


@dataclass(frozen=True)
class IdentificationConfig:
    """The masses of the links from the numbers that documents print (see experiment identify_masses)."""

    run: bool = switch(False)
    documents: list[str] = choices(["pmke", "global"], "pmke", "global")
    confidence: float = number(0.95, above=0, high=0.999)


@dataclass(frozen=True)
class ClosedLoopConfig:
    """Drake's Simulator follows the exported motion with a torque-limited inverse-dynamics controller."""

    run: bool = switch(False)
    bandwidth: float = number(20.0, above=0, unit="rad/s")
    damping: float = number(1.0, above=0)
    sampling: float = number(1000.0, above=0, high=100_000, unit="Hz")
    mass_error: float = number(0.0, above=-1)
    initial_error: float = number(0.0, unit="rad")


@dataclass(frozen=True)
class PublishedConfig:
    """Printed numbers that a run is compared against: data for the tables, never used in solving."""

    document: str = text("")
    note: str = text("")
    values: dict[str, dict[str, float]] = mapping(table_of_numbers)


@dataclass(frozen=True)
class RunConfig:
    """Everything that one run needs."""

    name: str = text("run")
    methods: list[str] = choices(DEFAULT_METHODS, *METHODS)
    seed: int = count(1, low=0)
    robot: RobotConfig = part(RobotConfig)
    base: FixedBaseConfig | FreeBaseConfig = one_of({"fixed": FixedBaseConfig, "free": FreeBaseConfig}, "fixed")
    path: LineConfig | CircleConfig | WaypointsConfig = one_of(
        {"line": LineConfig, "circle": CircleConfig, "waypoints": WaypointsConfig}, "line"
    )
    timing: TimingConfig = part(TimingConfig)
    objective: ObjectiveConfig = one_of(
        {
            "kinetic_energy": KineticEnergyConfig,
            "torque": TorqueConfig,
            "velocity_norm": VelocityNormConfig,
            "base_rotation": BaseRotationConfig,
            "reaction": ReactionConfig,
            "weighted": WeightedConfig,
        },
        "kinetic_energy",
    )
    gravity: str | list[float] = word_or_vector("none", "none", "earth", unit="m/s^2")
    limits: LimitsConfig = part(LimitsConfig)
    boundary: BoundaryConfig = part(BoundaryConfig)
    obstacles: ObstaclesConfig = part(ObstaclesConfig)
    method: MethodConfig = part(MethodConfig)
    parallel: ParallelConfig = part(ParallelConfig)
    sweep: SweepConfig = part(SweepConfig)
    pareto: ParetoOptions = part(ParetoOptions)
    candidate_study: CandidateStudyConfig = part(CandidateStudyConfig)
    export: ExportConfig = part(ExportConfig)
    closed_loop: ClosedLoopConfig = part(ClosedLoopConfig)
    identification: IdentificationConfig = part(IdentificationConfig)
    published: PublishedConfig = part(PublishedConfig)


def check(values: Mapping[str, Any]) -> RunConfig:
    """The checked configuration of one run; raises ConfigError naming the key and what is allowed."""
    return build(RunConfig, values)
