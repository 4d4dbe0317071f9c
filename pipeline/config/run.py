"""The typed schema of `conf/`: one dataclass per group. The only place where keys and their bounds are known.

Defaults here equal the files under `conf/` (a test compares them), so that the same options serve Python callers.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Annotated, Any, Literal

from pydantic import Field

from pipeline.config.fields import Name, Number, Switch, Text, Whole, WordOrVector, WordOrWords, Words, build, schema
from pipeline.config.goal import BoundaryConfig, KineticEnergyConfig, LimitsConfig, ObjectiveConfig
from pipeline.config.methods import MethodConfig, MethodName
from pipeline.config.path import CircleConfig, LineConfig, TimingConfig, WaypointsConfig
from pipeline.config.robot import CollisionConfig, FixedBaseConfig, FreeBaseConfig, ObstaclesConfig, RobotConfig
from pipeline.config.steps import refuse_endless, refuse_endless_search
from pipeline.config.studies import (
    CandidateStudyConfig,
    ClosedLoopConfig,
    ControlConfig,
    ExportConfig,
    IdentificationConfig,
    RetimingConfig,
)


@schema
class ParallelConfig:
    """Group `parallel`: how independent solves are spread."""

    workers: Annotated[
        Annotated[Whole, Field(ge=1, le=1024)] | None, Field(description="local processes; null: all cores")
    ] = None
    address: Annotated[
        Text | None, Field(description="of a running Dask scheduler, such as tcp://127.0.0.1:8786; null: none")
    ] = None
    wait: Annotated[
        Number, Field(ge=0, le=86_400, description="[s] for the first worker of a cluster that has none, at most")
    ] = 60.0


# Columns of summary.csv; peak_torque and its like: the largest of their joints'.
Measure = Literal[
    "kinetic_energy_integral",
    "torque_integral",
    "peak_velocity",
    "peak_torque",
    "peak_power",
    "max_tracking_error_between",
    "min_clearance_between",
    "wall_time_s",
]


@schema
class SweepConfig:
    """What a sweep does besides its runs."""

    resume: Annotated[
        Switch, Field(description="skip runs that are finished when a sweep is started again in its hydra.sweep.dir")
    ] = True
    objective: Annotated[
        WordOrWords[Measure] | None,
        Field(
            description="number in SI units, or numbers, of each run's motion to send (else its best) that a sweeper "
            "such as Optuna's optimises; null: none"
        ),
    ] = None


@schema
class ArtifactsConfig:
    """What a run leaves beside what every run leaves."""

    animation: Annotated[
        Literal["gif", "mp4"] | None,
        Field(description="a film of the motions for slides; mp4 needs ffmpeg (the extra film); null: none"),
    ] = None


@schema
class RunConfig:
    """Everything that one run needs."""

    name: Annotated[Name, Field(description="of the experiment: names the folder under outputs/")] = "run"
    methods: Annotated[Words[MethodName], Field(description="which methods run, in this order")] = (
        "lsv",
        "pmke",
        "global",
    )
    seed: Annotated[Whole, Field(ge=0, le=2**64 - 1, description="of every random draw")] = 1
    robot: RobotConfig = RobotConfig()
    base: Annotated[FixedBaseConfig | FreeBaseConfig, Field(discriminator="kind")] = FixedBaseConfig()
    path: Annotated[LineConfig | CircleConfig | WaypointsConfig, Field(discriminator="kind")] = LineConfig()
    timing: TimingConfig = TimingConfig()
    objective: Annotated[ObjectiveConfig, Field(discriminator="kind")] = KineticEnergyConfig()
    gravity: Annotated[
        WordOrVector[Literal["none", "earth"]], Field(description="[m/s^2] acceleration in the world")
    ] = "none"
    limits: LimitsConfig = LimitsConfig()
    boundary: BoundaryConfig = BoundaryConfig()
    obstacles: ObstaclesConfig = ObstaclesConfig()
    collision: CollisionConfig = CollisionConfig()
    method: MethodConfig = MethodConfig()
    parallel: ParallelConfig = ParallelConfig()
    sweep: SweepConfig = SweepConfig()
    artifacts: ArtifactsConfig = ArtifactsConfig()
    candidate_study: CandidateStudyConfig = CandidateStudyConfig()
    export: ExportConfig = ExportConfig()
    retiming: RetimingConfig = RetimingConfig()
    closed_loop: ClosedLoopConfig = ClosedLoopConfig()
    control: ControlConfig = ControlConfig()
    identification: IdentificationConfig = IdentificationConfig()


def check(values: Mapping[str, Any]) -> RunConfig:
    """The checked configuration of one run; raises ConfigError naming the key and what is allowed."""
    config = build(RunConfig, values)
    refuse_endless_search(config)
    if config.timing.law != "from_file" and isinstance(config.timing.duration, float):
        refuse_endless(config, config.timing.duration)
    return config
