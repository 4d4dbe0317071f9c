"""With how much clearance a path can be followed: held against what the path alone says, and against a gap's width."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from pipeline.build.problem import prepare
from pipeline.config.methods import GlobalOptions, SegmentsOptions
from pipeline.methods.segments.segments import segments
from pipeline.problem.limits import Limits
from pipeline.problem.problem import Problem
from pipeline.search.widest import widest
from tests.support import composed

TIP = "robot.collision={link3: [{kind: sphere, center: [0.1375, 0, 0], radius: 0.01}]}"
LINE = ("path.start=[0.3,0]", "path.direction=90", "path.length=0.2", "timing.steps=8", "boundary=free")


def past(*balls: str, margin: float = 0.05) -> Problem:
    """A line of 0.2 m, along which a ball of 10 mm about the tool's point keeps off other ones of 20 mm."""
    shapes = ", ".join(f"b{i}: {{kind: sphere, center: [{at}, 0.0], radius: 0.02}}" for i, at in enumerate(balls))
    return prepare(composed(TIP, *LINE, f"+obstacles.shapes={{{shapes}}}", f"obstacles.margin={margin}"))


@pytest.mark.slow
@pytest.mark.parametrize(("aside", "width"), [(0.07, 0.04), (0.02, -0.01), (0.1, 0.05)])
def test_it_is_what_the_path_leaves_to_the_tool(aside: float, width: float) -> None:
    """The balls' distance at the path's middle, whatever the joints do: less than nothing, or the margin and more."""
    found = widest(past(f"{0.3 + aside}, 0.1"), 8, 16, np.random.default_rng(1))
    assert found == pytest.approx(width, abs=2e-5)


def test_without_any_way_there_is_none() -> None:
    problem = past("0.9, 0.1")
    free = Limits.none(3)
    near = replace(problem, limits=replace(free, lower=problem.q_init - 0.1, upper=problem.q_init + 0.1))
    assert widest(near, 8, 16, np.random.default_rng(1)) is None


@pytest.mark.slow
def test_it_is_said_beside_a_path_that_cannot_be_followed() -> None:
    options = SegmentsOptions(intervals=20, nodes=40, planner=GlobalOptions(optimised=2, nodes=20))
    (nothing,) = segments(past("0.37, 0.1"), options)
    assert not nothing.found
    assert nothing.message.endswith(
        "is within the limits and clear; by that grid one would at obstacles.margin = 0.04 m"
    )
