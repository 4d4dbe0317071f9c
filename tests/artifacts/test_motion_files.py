from __future__ import annotations

import json
import re
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
import yaml

from pipeline.artifacts import motion_files as export
from pipeline.studies.export import Resampled

JOINTS = ("shoulder", "elbow")
TIME = np.array([0.0, 0.3, 1.1, 2.0000000004])


@pytest.fixture
def motion() -> Resampled:
    q, qd, qdd = np.random.default_rng(5).normal(size=(3, 4, 2))
    return Resampled("global", 1, TIME, q, qd, qdd, 0.0, 0.0, {}, {})


def test_the_table(motion: Resampled, tmp_path: Path) -> None:
    export.save_motion(tmp_path, motion, JOINTS, "base")
    table = pd.read_csv(tmp_path / "motion.csv")
    kinds = ("position", "velocity", "acceleration")
    assert list(table.columns) == ["time", *(f"{joint}_{kind}" for kind in kinds for joint in JOINTS)]
    expected = np.column_stack([motion.time, motion.q, motion.qd, motion.qdd])
    np.testing.assert_allclose(table.to_numpy(), expected, rtol=1e-14)


def test_the_message_of_ros(motion: Resampled, tmp_path: Path) -> None:
    """The fields of trajectory_msgs/JointTrajectory and of its points, neither more nor fewer."""
    export.save_motion(tmp_path, motion, JOINTS, "base")
    message = json.loads((tmp_path / "motion.json").read_text(encoding="utf-8"))
    assert yaml.safe_load((tmp_path / "motion.yaml").read_text(encoding="utf-8")) == message
    assert list(message) == ["header", "joint_names", "points"]
    assert message["header"] == {"stamp": {"sec": 0, "nanosec": 0}, "frame_id": "base"}
    assert message["joint_names"] == list(JOINTS)
    for i, point in enumerate(message["points"]):
        assert set(point) == {"positions", "velocities", "accelerations", "effort", "time_from_start"}
        np.testing.assert_array_equal(point["positions"], motion.q[i])
        np.testing.assert_array_equal(point["velocities"], motion.qd[i])
        np.testing.assert_array_equal(point["accelerations"], motion.qdd[i])
        assert point["effort"] == []
    times = [(p["time_from_start"]["sec"], p["time_from_start"]["nanosec"]) for p in message["points"]]
    assert times == [(0, 0), (0, 300_000_000), (1, 100_000_000), (2, 0)]


def test_a_time_just_below_a_second_is_that_second(motion: Resampled) -> None:
    """Rounding must not leave a whole thousand million of nanoseconds, which ROS refuses."""
    late = Resampled("global", 1, np.array([0.9999999999]), motion.q[:1], motion.qd[:1], motion.qdd[:1], 0, 0, {}, {})
    (point,) = export.joint_trajectory(late, JOINTS, "base")["points"]
    assert point["time_from_start"] == {"sec": 1, "nanosec": 0}


def test_moveit_and_universal_robots(motion: Resampled, tmp_path: Path) -> None:
    """A RobotTrajectory around the same message; a program that begins where the motion does and takes its time."""
    export.save_motion(tmp_path, motion, JOINTS, "base", ["moveit", "urscript"])
    assert sorted(file.name for file in tmp_path.iterdir()) == ["motion.script", "motion_moveit.yaml"]
    text = (tmp_path / "motion_moveit.yaml").read_text(encoding="utf-8")
    message = yaml.safe_load(text)
    assert message["joint_trajectory"] == export.joint_trajectory(motion, JOINTS, "base")
    assert message["multi_dof_joint_trajectory"] == {
        "header": message["joint_trajectory"]["header"],
        "joint_names": [],
        "points": [],
    }
    assert "&" not in text
    program = (tmp_path / "motion.script").read_text(encoding="utf-8")
    rows = re.findall(r"servoj\(\[(.*?)\], t=([\d.e-]+),", program)
    np.testing.assert_allclose([[float(v) for v in row.split(",")] for row, _ in rows], motion.q[1:], rtol=1e-8)
    np.testing.assert_allclose([float(step) for _, step in rows], np.diff(TIME), rtol=1e-5)
    (start,) = re.findall(r"start = \[(.*?)\]", program)
    np.testing.assert_allclose([float(v) for v in start.split(",")], motion.q[0], rtol=1e-8)


def test_other_arms_are_not_universal_robots() -> None:
    assert export.why_not(["csv", "urscript"], [True] * 6) is None
    assert export.why_not(["csv", "moveit"], [True, False]) is None
    assert "1 that turn and 1 that slide" in str(export.why_not(["urscript"], [True, False]))
    assert export.why_not(["urscript"], [True] * 5 + [False]) is not None
