"""Rest, acceleration and jerk: what does not go together is refused with what would."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np
import pytest

from pipeline.build.problem import prepare
from pipeline.common.errors import ConfigError, RobotError
from tests.support import ROOT, composed

pytestmark = pytest.mark.slow  # together: each composes and prepares problems in space

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


PANDA = ("robot=panda", "path.direction=[0,1,0]", "path.length=0.1", "timing.steps=4")
SHEET = [15.0, 7.5, 10.0, 12.5, 15.0, 20.0, 20.0]  # [rad/s^2]
OWN = ("robot.end_effector=tip", "path.length=0.1", "timing.steps=4")


@pytest.mark.parametrize(
    ("words", "rests"),
    [
        ((), True),
        (("boundary=free", "limits=joint"), True),
        (("boundary.rest=[]",), False),
        (("timing=constant_speed",), False),
        (("base=free", "base.mass=60"), False),
        (("objective=reaction",), False),
        (("methods=[lsv,pmke]",), False),
        (("robot=planar3r", "path.direction=90"), False),
    ],
)
def test_arms_that_are_not_the_papers_rest_at_both_ends(words: tuple[str, ...], rests: bool) -> None:
    """Within the accelerations of their data sheet, unless the command line says otherwise."""
    problem = prepare(composed(*PANDA, *words))
    assert problem.rest == (rests, rests)
    assert problem.bounds.smooth == rests
    if rests:
        np.testing.assert_array_equal(problem.bounds.acceleration, SHEET)
        assert np.isinf(problem.bounds.jerk).all()


def test_accelerations_of_the_robot_give_way() -> None:
    own = prepare(composed(*PANDA, "limits.acceleration=3"))
    np.testing.assert_array_equal(own.bounds.acceleration, 3.0)
    with pytest.raises(ConfigError, match="there is no best motion from rest"):
        prepare(composed(*PANDA, ENDS, "limits.acceleration=1e9"))
    with pytest.raises(RobotError, match=r"^robot\.limits = .*panda_limits\.yaml: states limits of panda_joint1, .*"):
        prepare(composed("boundary.rest=[start]", "robot.limits=robots/panda_limits.yaml"))


def test_an_arm_of_ones_own_is_told_a_number(tmp_path: Path) -> None:
    """From the torques of its file: the same arm, a hundred times as weak, can speed up by less."""
    text = (ROOT / "robots" / "planar3r.urdf").read_text(encoding="utf-8")
    numbers = {}
    for name, effort in (("strong", "0.4"), ("weak", "0.004")):
        file = tmp_path / f"{name}.urdf"
        file.write_text(text.replace('effort="0.4"', f'effort="{effort}"'), encoding="utf-8")
        assert prepare(composed(*OWN, f"robot.urdf={file}", "timing.duration=1")).rest == (False, False)
        with pytest.raises(ConfigError) as refused:
            prepare(composed(*OWN, f"robot.urdf={file}", "timing.duration=1", ENDS))
        assert str(refused.value).endswith("boundary.rest=[] lets it jump")
        numbers[name] = float(re.findall(r"set limits.acceleration, such as (\S+) rad/s", str(refused.value))[0])
        assert all(prepare(composed(*OWN, f"robot.urdf={file}", f"limits.acceleration={numbers[name]}")).rest)
    assert 0 < numbers["weak"] < numbers["strong"]


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
