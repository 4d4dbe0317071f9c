"""Limits of the tool's pace: refused at once where a law that is given exceeds them."""

from __future__ import annotations

import re
from dataclasses import replace

import numpy as np
import pytest

from pipeline.build.rest import check_rest
from pipeline.build.tool import check_tool
from pipeline.common.errors import ConfigError
from pipeline.path.curves import Geometry, Line, Still, circle
from pipeline.path.timing import ConstantSpeed, Cruise, RaisedCosine, Timing
from pipeline.problem.limits import Limits
from pipeline.problem.problem import Problem
from tests.support import free_line

START = np.array([1.0, 0.2])
LINE = Line(START, np.array([-1.0, 0.0]), 0.3)


def paced(law: Timing, geometry: Geometry = LINE, **limits: float) -> Problem:
    problem = free_line(4)
    reference = replace(problem.reference, geometry=geometry, timing=law)
    return replace(problem, reference=reference, limits=replace(Limits.none(3), **limits))


@pytest.mark.parametrize(
    ("law", "limits", "said", "needed"),
    [
        (RaisedCosine(2.0), {"tool_speed": 0.2}, r"tool_speed = 0.2 m/s: the path .* at up to 0.3 m/s in 2 s", 3.0),
        (RaisedCosine(2.0), {"tool_acceleration": 0.1}, r"n = 0.1 m/s\^2: .* up to 0.6 m/s\^2", 2.0 * np.sqrt(6)),
        (ConstantSpeed(2.0), {"tool_speed": 0.1}, r"up to 0.15 m/s", 3.0),
        (Cruise(2.0, 0.25), {"tool_speed": 0.1}, r"up to 0.2 m/s", 4.0),
    ],
)
def test_a_given_law_is_too_fast(law: Timing, limits: dict[str, float], said: str, needed: float) -> None:
    """The raised cosine's largest speed is 2 L / T, its acceleration 8 L / T^2; the duration named has 1 % of room."""
    asked = paced(law, **limits)
    with pytest.raises(ConfigError, match=said) as refused:
        check_tool(asked)
    found = re.search(r"([\d.]+) s would do$", str(refused.value))
    assert found is not None
    assert float(found.group(1)) == pytest.approx(1.01 * needed, rel=5e-3)
    check_tool(asked.slowed(float(found.group(1)) / 2.0))


def test_a_circle_accelerates_across_itself() -> None:
    """v^2 / r at constant speed: 2 pi 0.1 m in 2 s is 0.987 m/s^2."""
    round_path = circle(START, 180.0, 0.1)
    with pytest.raises(ConfigError, match=r"at up to 0\.987 m/s\^2 in 2 s"):
        check_tool(paced(ConstantSpeed(2.0), round_path, tool_acceleration=0.98))
    check_tool(paced(ConstantSpeed(2.0), round_path, tool_acceleration=0.99))


def test_the_shortest_time_needs_limits_of_joints() -> None:
    """Those of the tool leave open what the joints do beside it."""
    asked = replace(paced(RaisedCosine(2.0), tool_speed=0.2), free_duration=True)
    check_tool(asked)
    with pytest.raises(ConfigError, match=r"set limits.velocity, limits.acceleration or limits.torque$"):
        check_rest(asked)


def test_a_turn_on_the_spot_has_no_pace() -> None:
    with pytest.raises(ConfigError, match=r"the tool turns on the spot, and goes nowhere$"):
        check_tool(paced(RaisedCosine(2.0), Still(START, 0.03), tool_speed=1.0))
