"""Limits of the tool's pace: refused at once where a law that is given exceeds them."""

from __future__ import annotations

import re

import numpy as np
import pytest

from pipeline.build.problem import prepare
from pipeline.common.errors import ConfigError
from tests.support import composed

LINE = ("path.length=0.3", "timing.duration=2")


@pytest.mark.parametrize(
    ("words", "said", "needed"),
    [
        (("limits.tool_speed=0.2",), r"tool_speed = 0.2 m/s: the path is run through at up to 0.3 m/s in 2 s", 3.0),
        (("limits.tool_acceleration=0.1",), r"tool_acceleration = 0.1 m/s\^2: .* 0.6 m/s\^2", 2.0 * np.sqrt(6)),
        (("timing=constant_speed", "limits.tool_speed=0.1"), r"up to 0.15 m/s", 3.0),
        (("timing=cruise", "timing.ramp=0.25", "limits.tool_speed=0.1"), r"up to 0.2 m/s", 4.0),
    ],
)
def test_a_given_law_is_too_fast(words: tuple[str, ...], said: str, needed: float) -> None:
    """The raised cosine's largest speed is 2 L / T, its acceleration 8 L / T^2; the duration named has 1 % of room."""
    with pytest.raises(ConfigError, match=said) as refused:
        prepare(composed(*LINE, *words))
    found = re.search(r"([\d.]+) s would do$", str(refused.value))
    assert found is not None
    assert float(found.group(1)) == pytest.approx(1.01 * needed, rel=5e-3)
    prepare(composed("path.length=0.3", *words, f"timing.duration={found.group(1)}"))


def test_a_circle_accelerates_across_itself() -> None:
    """v^2 / r at constant speed: 2 pi 0.1 m in 2 s is 0.99 m/s^2."""
    words = (
        "path=circle",
        "path.radius=0.1",
        "timing=constant_speed",
        "timing.duration=2",
        "limits.tool_acceleration=",
    )
    with pytest.raises(ConfigError, match=r"at up to 0\.987 m/s\^2 in 2 s"):
        prepare(composed(*words[:-1], f"{words[-1]}0.98"))
    prepare(composed(*words[:-1], f"{words[-1]}0.99"))


def test_the_shortest_time_needs_limits_of_joints() -> None:
    """Those of the tool leave open what the joints do beside it."""
    words = (*LINE[:1], "timing.duration=shortest", "limits.tool_speed=0.2")
    with pytest.raises(ConfigError, match=r"set limits.velocity, limits.acceleration or limits.torque$"):
        prepare(composed(*words))
    assert prepare(composed(*words, "limits.velocity=3")).bounds.limits_tool


def test_a_turn_on_the_spot_has_no_pace() -> None:
    words = ("robot=panda", "robot.orientation=full", "path.length=0", "path.turn=[0,0,0.3]", "limits.tool_speed=1")
    with pytest.raises(ConfigError, match=r"the tool turns on the spot, and goes nowhere$"):
        prepare(composed(*words))
