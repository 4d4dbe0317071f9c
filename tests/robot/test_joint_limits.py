"""joint_limits.yaml: what it states is read joint by joint, and anything else is refused in one line."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from pipeline.common.errors import RobotError
from pipeline.robot.joint_limits import read
from tests.support import ROOT

JOINTS = ("a", "b")


def written(folder: Path, text: str) -> Path:
    file = folder / "joint_limits.yaml"
    file.write_text(text, encoding="utf-8")
    return file


def test_what_a_file_states(tmp_path: Path) -> None:
    """Switches decide; the fingers' limits and scaling factors are nothing to the arm."""
    file = written(
        tmp_path,
        "default_velocity_scaling_factor: 0.1\n"
        "joint_limits:\n"
        "  b: {has_velocity_limits: true, max_velocity: 2, has_position_limits: true, min_position: -1.5, "
        "max_position: 1.5}\n"
        "  a: {has_velocity_limits: false, max_velocity: 9, has_acceleration_limits: true, max_acceleration: 3.5}\n"
        "  finger: {has_velocity_limits: true, max_velocity: 0.1}\n",
    )
    found = read(file, JOINTS)
    assert set(found) == {"velocity", "acceleration", "lower", "upper"}
    np.testing.assert_array_equal(found["velocity"], [np.nan, 2.0])
    np.testing.assert_array_equal(found["acceleration"], [3.5, np.nan])
    np.testing.assert_array_equal([found["lower"][1], found["upper"][1]], [-1.5, 1.5])


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("- a\n", "no table joint_limits"),
        ("joint_limits: {c: {}}\n", "states limits of c; the arm has a, b"),
        ("joint_limits: {a: 3}\n", "a: a table of keys such as max_acceleration is needed"),
        (
            "joint_limits: {a: {has_jerk_limits: true}}\n",
            "max_jerk of a is missing; one of at least 1e-09 is needed",
        ),
        (
            "joint_limits: {a: {has_jerk_limits: true, max_jerk: -1}}\n",
            "max_jerk of a = -1; one of at least 1e-09",
        ),
        ("joint_limits: {a: {has_effort_limits: true, max_effort: .inf}}\n", "max_effort of a = inf"),
        ("joint_limits: {a: {has_position_limits: true, min_position: x}}\n", "min_position of a = x; a number is"),
        ("joint_limits: {\n", "while parsing"),
    ],
)
def test_what_is_refused(tmp_path: Path, text: str, said: str) -> None:
    with pytest.raises(RobotError) as refused:
        read(written(tmp_path, text), JOINTS)
    assert said in str(refused.value)
    assert "\n" not in str(refused.value)


def test_a_file_that_is_not_there(tmp_path: Path) -> None:
    with pytest.raises(RobotError, match="No such file"):
        read(tmp_path / "none.yaml", JOINTS)


def test_the_data_sheets() -> None:
    """Franka Control Interface, limits of the Panda; xArm7: 180 degrees per second, 20 rad/s^2."""
    panda = read(ROOT / "robots" / "panda_limits.yaml", [f"panda_joint{i}" for i in range(1, 8)])
    np.testing.assert_array_equal(panda["velocity"], [2.175] * 4 + [2.61] * 3)
    np.testing.assert_array_equal(panda["acceleration"], [15, 7.5, 10, 12.5, 15, 20, 20])
    np.testing.assert_array_equal(panda["jerk"], np.array(panda["acceleration"]) * 500)
    np.testing.assert_array_equal(panda["torque"], [87] * 4 + [12] * 3)
    xarm = read(ROOT / "robots" / "xarm7_limits.yaml", [f"joint{i}" for i in range(1, 8)])
    np.testing.assert_allclose(xarm["velocity"], np.pi, atol=1e-4)
    assert set(xarm["acceleration"]) == {20.0}
