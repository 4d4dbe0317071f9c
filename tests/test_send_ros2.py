"""The guide's script for ROS 2, run against a robot and a controller that read its messages off the wire."""

from __future__ import annotations

import runpy
import sys
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from pipeline.artifacts import motion_files
from pipeline.studies.export import Resampled
from tests.ros2 import Robot, modules
from tests.support import ROOT

JOINTS = ("shoulder", "elbow")
TIME = np.append(np.arange(0.0, 2.0, 0.01), 2.0)
Q = np.array([0.3, -0.5]) + np.outer(1 - np.cos(TIME), [0.4, -0.2])
Send = Callable[..., tuple[int, str]]


@pytest.fixture
def robot(monkeypatch: pytest.MonkeyPatch) -> Robot:
    made = Robot({"shoulder": 0.3005, "elbow": -0.5})
    for name, module in modules(made).items():
        monkeypatch.setitem(sys.modules, name, module)
    return made


@pytest.fixture
def send(robot: Robot, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> Send:
    def sent(*words: str, faults: tuple[str, ...] = ()) -> tuple[int, str]:
        rates = np.outer(np.sin(TIME), [0.4, -0.2]), np.outer(np.cos(TIME), [0.4, -0.2])
        motion = Resampled("global", 1, TIME, Q, *rates, 0.0, 0.0, {}, {}, faults)
        motion_files.save_motion(tmp_path, motion, JOINTS, "base", ["ros2"])
        script = runpy.run_path(str(ROOT / "docs" / "send_ros2.py"))
        code = script["main"]([str(tmp_path / "motion.json"), "--controller", "/arm", *words])
        said = capsys.readouterr()
        return code, said.out + said.err

    return sent


def test_the_controller_gets_the_motion(send: Send, robot: Robot) -> None:
    assert send() == (0, "done\n")
    (goal,) = robot.goals
    assert goal.trajectory.joint_names == list(JOINTS)
    points = goal.trajectory.points
    np.testing.assert_allclose([point.positions for point in points], Q, atol=1e-12)
    times = [point.time_from_start.sec + 1e-9 * point.time_from_start.nanosec for point in points]
    np.testing.assert_allclose(times, TIME, atol=1e-9)
    assert all(len(point.velocities) == len(point.accelerations) == 2 and not len(point.effort) for point in points)


def test_points_are_thinned_and_both_ends_kept(send: Send, robot: Robot) -> None:
    assert send("--rate", "12.5")[0] == 0
    points = robot.goals[0].trajectory.points
    times = np.array([point.time_from_start.sec + 1e-9 * point.time_from_start.nanosec for point in points])
    np.testing.assert_allclose(times, np.arange(0.0, 2.04, 0.08), atol=1e-9)
    np.testing.assert_allclose(points[-1].positions, Q[-1], atol=1e-12)


@pytest.mark.parametrize(
    ("standing", "said"),
    [
        ({"shoulder": 0.32, "elbow": -0.5}, "shoulder stands at 0.3200, the motion starts at 0.3000"),
        ({"shoulder": 0.3}, "elbow is not in joint_states"),
        ({}, "nobody publishes /joint_states"),
    ],
)
def test_nothing_is_sent_to_a_robot_that_stands_elsewhere(
    standing: dict[str, float], said: str, send: Send, robot: Robot
) -> None:
    robot.standing = standing
    code, line = send()
    assert (code, robot.goals) == (1, [])
    assert said in line


def test_what_must_not_be_sent_and_what_nobody_takes(send: Send, robot: Robot) -> None:
    code, line = send(faults=("ends while it moves",))
    assert (code, robot.goals) == (1, [])
    assert "NOT TO BE SENT: this motion ends while it moves" in line
    robot.controller = "/leg"
    assert send() == (1, "error: no controller at /arm\n")
    robot.controller = "/arm"
    robot.follow = lambda goal: (-4, "the arm was held")  # type: ignore[method-assign]
    assert send() == (1, "error: error -4: the arm was held\n")
