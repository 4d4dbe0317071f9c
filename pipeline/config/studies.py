"""What a run asks about its motions beside solving: export, closed loop, candidate study, identification."""

from __future__ import annotations

from typing import Annotated, Literal

from pydantic import Field

from pipeline.config.fields import Number, Switch, Whole, Words, schema
from pipeline.config.methods import MethodName

Positive = Annotated[Number, Field(gt=0)]


@schema
class CandidateStudyConfig:
    """The Global paper's Fig. 1: how near the best of so many candidates comes to the optimum."""

    run: Annotated[Switch, Field(description="whether it is made, see experiment candidate_study")] = False
    most: Annotated[Whole, Field(ge=100, le=1_000_000, description="candidates")] = 10000
    repeats: Annotated[Whole, Field(ge=1, le=1000, description="populations that are averaged")] = 5


@schema
class ExportConfig:
    """The motion that is written for a controller, by default as a table and for ROS 2."""

    method: Annotated[
        Literal["best", "none", MethodName],
        Field(description="best: the cheapest confirmed motion that can be sent; none; or that of one method"),
    ] = "best"
    rate: Annotated[Number, Field(gt=0, le=10_000, description="[Hz] of the points")] = 100.0
    force: Annotated[
        Switch, Field(description="whether a motion that cannot be sent is written all the same; its files say so")
    ] = False
    format: Annotated[
        Words[Literal["csv", "ros2", "moveit", "urscript"]],
        Field(
            description="what is written: csv: motion.csv; ros2: motion.yaml and motion.json (JointTrajectory); "
            "moveit: motion_moveit.yaml (RobotTrajectory); urscript: motion.script for an arm of Universal Robots"
        ),
    ] = ("csv", "ros2")


@schema
class RetimingConfig:
    """The least time for the joint path of every motion, by toppra: a lower bound, with jerks that have none."""

    run: Annotated[Switch, Field(description="whether it is computed")] = False


@schema
class IdentificationConfig:
    """The masses of the links from the numbers that documents print, see experiment identify_masses."""

    run: Annotated[Switch, Field(description="whether it is made")] = False
    documents: Annotated[
        Words[Literal["pmke", "global"]], Field(description="whose rows in conf/reproduction/ say how they count")
    ] = ("pmke", "global")
    confidence: Annotated[Number, Field(gt=0, le=0.999, description="of the intervals")] = 0.95


@schema
class ClosedLoopConfig:
    """The exported motion in Drake's Simulator, under a torque-limited inverse-dynamics controller."""

    run: Annotated[Switch, Field(description="whether it is simulated")] = False
    bandwidth: Annotated[Positive, Field(description="[rad/s] of the controller")] = 20.0
    damping: Annotated[Positive, Field(description="ratio of the controller")] = 1.0
    sampling: Annotated[Number, Field(gt=0, le=100_000, description="[Hz] of the controller")] = 1000.0
    mass_error: Annotated[
        Number, Field(gt=-1, description="relative: by how much the controller takes the arm for heavier than it is")
    ] = 0.0
    initial_error: Annotated[Number, Field(description="[rad] of every joint at the start")] = 0.0


@schema
class ControlConfig:
    """PMKE's controller in the loop: Drake's Simulator is driven by it tick by tick, from the start of the path."""

    run: Annotated[Switch, Field(description="whether it is simulated")] = False
    rate: Annotated[Number, Field(gt=0, le=10_000, description="[Hz] of the ticks")] = 100.0
    bandwidth: Annotated[Positive, Field(description="[rad/s] of the torque's feedback")] = 25.0
    damping: Annotated[Positive, Field(description="ratio of the same")] = 1.0
    mass_error: Annotated[
        Number, Field(gt=-1, description="relative: by how much the controller takes the arm for heavier than it is")
    ] = 0.05
    latency: Annotated[Whole, Field(ge=0, le=100, description="ticks after which a torque takes effect")] = 1
    push_time: Annotated[
        Annotated[Number, Field(ge=0)] | None, Field(description="[s] when every joint is pushed; null: never")
    ] = None
    push_torque: Annotated[Number, Field(description="[N m] of the push")] = 0.0
    push_duration: Annotated[Positive, Field(description="[s] of the push")] = 0.1
    stall_time: Annotated[
        Annotated[Number, Field(ge=0)] | None,
        Field(description="[s] when the controller is not called, and the last torque stays; null: never"),
    ] = None
    stall_ticks: Annotated[Whole, Field(ge=1, le=1000, description="ticks for which it is not called")] = 5
