"""The typed schema of `conf/`: one dataclass per group. The only place where keys and their bounds are known.

Defaults here equal the files under `conf/` (a test compares them), so that the same options serve Python callers.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from pipeline.config.fields import build, choices, count, one_of, part, switch, text, word_or_vector
from pipeline.config.goal import (
    BaseRotationConfig,
    BoundaryConfig,
    KineticEnergyConfig,
    LimitsConfig,
    ObjectiveConfig,
    ReactionConfig,
    TorqueConfig,
    VelocityNormConfig,
    WeightedConfig,
)
from pipeline.config.methods import DEFAULT_METHODS, METHODS, MethodConfig
from pipeline.config.path import CircleConfig, LineConfig, TimingConfig, WaypointsConfig
from pipeline.config.robot import FixedBaseConfig, FreeBaseConfig, ObstaclesConfig, RobotConfig
from pipeline.config.studies import (
    CandidateStudyConfig,
    ClosedLoopConfig,
    ExportConfig,
    IdentificationConfig,
    PublishedConfig,
)


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
    candidate_study: CandidateStudyConfig = part(CandidateStudyConfig)
    export: ExportConfig = part(ExportConfig)
    closed_loop: ClosedLoopConfig = part(ClosedLoopConfig)
    identification: IdentificationConfig = part(IdentificationConfig)
    published: PublishedConfig = part(PublishedConfig)


def check(values: Mapping[str, Any]) -> RunConfig:
    """The checked configuration of one run; raises ConfigError naming the key and what is allowed."""
    return build(RunConfig, values)
