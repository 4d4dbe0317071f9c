"""Reports for the tests of what a run leaves, and runs that leave less."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from functools import cache
from pathlib import Path

import numpy as np
import pytest
from rerun.chunk import RrdReader

from pipeline.artifacts.report import Report
from pipeline.config.run import RunConfig
from pipeline.evaluation.evaluation import Evaluation, evaluate
from pipeline.model.arm import Arm
from pipeline.model.obstacles import Obstacles
from pipeline.model.task import PositionTask
from pipeline.path.curves import Line
from pipeline.path.reference import Reference
from pipeline.path.timing import RaisedCosine
from pipeline.problem.limits import Limits
from pipeline.problem.problem import Problem
from pipeline.problem.solution import Solution, Status, Trajectory
from pipeline.robot.shapes import Shape
from pipeline.run import run
from pipeline.studies.study import Motions, Result
from tests.plain import PLAIN
from tests.support import with_shapes

TIMES = np.linspace(0.0, 2.0, 5)
MOVES = np.array([0.0, 0.3, -0.7]) + np.outer(np.linspace(0.0, 1.0, 5) ** 2, [0.4, -0.2, 0.1])


def report_of(
    problem: Problem, motions: Sequence[Evaluation], *results: Result, settings: RunConfig | None = None
) -> Report:
    """The report of a run that took half a second per method, ready for any artifact."""
    asked = settings or RunConfig()
    seconds = {e.method: 0.5 for e in motions}
    facts = {"experiment": asked.name, "seed": asked.seed, "inputs": {"robot.urdf": "a digest"}}
    return Report(Motions(asked, problem, motions), results, seconds, {"solve": 0.5}, facts)


def leave_out_pictures(patch: pytest.MonkeyPatch) -> None:
    """Runs then draw and record nothing: that takes most of the time of a small one."""
    patch.setattr(run, "ARTIFACTS", PLAIN)


@cache
def three_motions() -> Report:
    """Three motions of which one meets a singularity, among two solids and under one limit, which the second exceeds
    fourfold: joint1's velocity, 0.35 rad/s in its last interval where 0.1 is allowed.
    """
    arm = Arm(with_shapes("planar3r").description)
    start = arm.position(MOVES[:1])[0, :2]
    solids = (Shape("ball", "sphere", (0.05,), (0.2, 0.5, 0.0)), Shape("wall", "box", (0.1, 0.2, 0.3), (0.9, 0.0, 0.0)))
    limits = replace(Limits.none(3), velocity=np.array([0.1, 9.0, np.inf]))
    reference = Reference(Line(start, np.array([1.0, 0.0]), 0.1), RaisedCosine(2.0), tolerance=9.0)
    problem = Problem(PositionTask(arm), reference, MOVES[0], TIMES, obstacles=Obstacles(solids, 0.02), limits=limits)
    own = [
        Solution("lsv", Trajectory(TIMES, MOVES), Status.SINGULAR, "met one", event_time=1.5),
        Solution("global", Trajectory(TIMES, MOVES), Status.SOLVED, evidence="confirmed by IPOPT: well"),
        Solution("global", Trajectory(TIMES, MOVES[:, [0, 2, 1]]), Status.SOLVED, optimum=2),
    ]
    return report_of(problem, [evaluate(problem, one) for one in own], settings=RunConfig(name="mine"))


def chunks(file: Path, content: str) -> list[object]:
    return RrdReader(file).stream().filter(content=content).to_chunks()


def component(file: Path, entity: str, name: str) -> object:
    """The last value of one component on an entity."""
    batches = [chunk.to_record_batch() for chunk in chunks(file, entity)]
    return [batch[name].to_pylist()[-1] for batch in batches if name in batch.schema.names][-1]
