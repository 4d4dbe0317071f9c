"""An integration that leaves all bounds ends as a method that found nothing, not in what is not finite."""

from __future__ import annotations

import numpy as np
import pytest

from pipeline.build.problem import prepare
from pipeline.config.methods import LsvOptions, PmkeOptions
from pipeline.methods.lsv import inertia_weighted, lsv
from pipeline.methods.method import Method
from pipeline.methods.pmke.predictive import pmke
from pipeline.methods.singularity import LOST, lost
from pipeline.problem.solution import Status
from tests.support import composed

OPTIONS = {"lsv": LsvOptions(dt=0.5), "inertia_weighted": LsvOptions(dt=0.5, integrator="euler"), "pmke": PmkeOptions()}


@pytest.mark.parametrize("method", [lsv, inertia_weighted, pmke], ids=lambda method: method.name)
def test_a_spacecraft_that_carries_the_arm_away(method: Method) -> None:
    """Its momentum turns the joints by far more than a turn in a step."""
    words = ("base=free", "robot=planar3r_base", "base.linear_momentum=[1e6,0,0]", "timing.steps=4")
    problem = prepare(composed(*words))
    (ended,) = method(problem, OPTIONS[method.name])
    assert (ended.status, ended.found) == (Status.INFEASIBLE, False)
    assert f"where the joints are beyond {LOST:g} rad" in ended.message
    assert (ended.trajectory.q == problem.q_init).all()


@pytest.mark.parametrize(("q", "expected"), [([1e6, -1e6], False), ([0.0, -1.1e6], True), ([0.0, np.nan], True)])
def test_what_is_lost(q: list[float], expected: bool) -> None:
    assert lost(np.array(q)) is expected
