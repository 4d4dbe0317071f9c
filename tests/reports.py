"""Reports for the tests of what a run leaves, and runs that leave less."""

from __future__ import annotations

from collections.abc import Sequence

import pytest

from pipeline.artifacts.artifacts import ARTIFACTS, name
from pipeline.artifacts.report import Report
from pipeline.config.run import RunConfig
from pipeline.evaluation.evaluation import Evaluation
from pipeline.problem.problem import Problem
from pipeline.run import run
from pipeline.studies.study import Motions, Result


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
    kept = tuple(artifact for artifact in ARTIFACTS if name(artifact) not in ("page", "figures", "recording"))
    patch.setattr(run, "ARTIFACTS", kept)
