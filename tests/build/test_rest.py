"""Rest, acceleration and jerk: what does not go together is refused with what would."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np
import pytest

from pipeline.build.problem import prepare
from pipeline.common.errors import ConfigError
from tests.support import composed

ENDS, START = "boundary.rest=[start,end]", "boundary.rest=[start]"
SPEED = ("timing=constant_speed", "timing.duration=2")


@pytest.mark.parametrize(
    ("words", "said"),
    [
        ((ENDS,), "there is no best motion from rest unless the accelerations of all joints are limited"),
        ((START, "limits.acceleration=[1,1,1e9]"), "there is no best motion"),
        ((*SPEED, "boundary.rest=[end]"), "the path is entered and left at speed"),
        (("boundary.zero_acceleration=true",), "of which ends is said by boundary.rest"),
        ((ENDS, "limits.jerk=2"), "set boundary.rest=[start,end] and boundary.zero_acceleration=true"),
        (("limits.jerk=2",), "set boundary.rest=[start,end] and boundary.zero_acceleration=true"),
    ],
)
def test_refused(words: tuple[str, ...], said: str) -> None:
    with pytest.raises(ConfigError) as refused:
        prepare(composed(*words))
    assert said in str(refused.value)


@pytest.mark.parametrize(
    "words",
    [
        (ENDS, "boundary=free"),
        (ENDS, "objective=torque"),
        (ENDS, "limits.acceleration=1"),
        ("boundary.rest=[end]",),
        (ENDS, "boundary.zero_acceleration=true", "limits.jerk=2"),
        ("boundary=cyclic", "path=circle", "limits.jerk=20"),
    ],
)
def test_served(words: tuple[str, ...]) -> None:
    problem = prepare(composed(*words))
    assert problem.rest == ("start" in words[0], "end" in words[0])


def test_the_suggested_acceleration_is_one_that_does() -> None:
    """Taken over, it is served; and in it the motion's largest speed is reached in a twentieth of its time or so."""
    with pytest.raises(ConfigError) as refused:
        prepare(composed(ENDS))
    (number,) = re.findall(r"such as (\S+) rad/s", str(refused.value))
    assert 0.05 < float(number) < 20
    assert prepare(composed(ENDS, f"limits.acceleration={number}")).bounds.smooth


def test_limits_of_a_file_give_way_to_values() -> None:
    problem = prepare(composed("+experiment=xarm7", "limits.file=robots/xarm7_limits.yaml"))
    np.testing.assert_array_equal(problem.bounds.acceleration, 20.0)
    np.testing.assert_allclose(problem.bounds.velocity, 3.1416)
    assert np.isinf(problem.bounds.jerk).all()
    own = prepare(composed("+experiment=xarm7", "limits.file=robots/xarm7_limits.yaml", "limits.acceleration=3"))
    np.testing.assert_array_equal(own.bounds.acceleration, 3.0)


def test_a_file_limits_the_joints_that_it_names(tmp_path: Path) -> None:
    """The others keep the limits of the description."""
    file = tmp_path / "limits.yaml"
    file.write_text("joint_limits: {joint2: {has_velocity_limits: true, max_velocity: 0.25}}")
    own = prepare(composed("limits=joint")).bounds.velocity
    assert np.isfinite(own).all()
    found = prepare(composed("limits=joint", f"limits.file={file}")).bounds.velocity
    np.testing.assert_array_equal(found, [own[0], 0.25, own[2]])
