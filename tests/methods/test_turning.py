"""Paths on which the tool turns on the spot, stays where it is, or turns far over a few millimetres."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from pipeline.build.problem import prepare
from pipeline.common.errors import ConfigError
from pipeline.config.methods import GlobalOptions
from pipeline.evaluation.evaluation import evaluate
from pipeline.methods.global_planner.planner import global_planner
from pipeline.problem.curve import whole
from pipeline.problem.problem import Problem
from pipeline.problem.solution import Status
from tests.support import composed

FEW = GlobalOptions(optimised=2, budget=2, nodes=30, layers=4)
PANDA = ("robot=panda", "robot.orientation=full", "boundary.rest=[]", "collision.self=false", "timing.steps=24")
HEADER = "x,y,z,qx,qy,qz,qw"
DOWN, ROLLED = "1,0,0,0", "0.92387953,0.38268343,0,0"  # a quarter of half a turn about the tool's own axis: 45 deg


def along(folder: Path, rows: list[str], header: str = HEADER, *words: str) -> Problem:
    (folder / "path.csv").write_text("\n".join([header, *rows]) + "\n")
    return prepare(composed(*PANDA, "path=waypoints", f"path.file={folder / 'path.csv'}", *words))


@pytest.mark.slow
def test_a_tool_that_turns_on_the_spot_stays_there(tmp_path: Path) -> None:
    problem = along(tmp_path, [f"0.45,0,0.4,{DOWN}", f"0.45,0,0.4,{ROLLED}"], HEADER, "timing.duration=4")
    solution = global_planner(problem, FEW)[0]
    assert evaluate(problem, solution).status is Status.SOLVED
    q = whole(problem, solution.trajectory)(np.linspace(0.0, 4.0, 101))
    pose = problem.task.value(q)
    np.testing.assert_allclose(pose[:, :3], np.tile([0.45, 0, 0.4], (101, 1)), atol=1e-4)
    turned = (Rotation.from_rotvec(pose[0, 3:]).inv() * Rotation.from_rotvec(pose[:, 3:])).magnitude()
    assert np.all(np.diff(turned) >= -1e-5)
    assert turned[-1] == pytest.approx(np.pi / 4, abs=1e-6)


@pytest.mark.slow
def test_between_equal_way_points_the_tool_waits(tmp_path: Path) -> None:
    times, y = (0.0, 1.5, 2.5, 4.0), (-0.05, 0.0, 0.0, 0.05)
    rows = [f"0.45,{at},0.4,{DOWN},{t}" for at, t in zip(y, times, strict=True)]
    problem = along(tmp_path, rows, f"{HEADER},time", "timing=from_file")
    solution = global_planner(problem, FEW)[0]
    assert evaluate(problem, solution).status is Status.SOLVED
    waiting = whole(problem, solution.trajectory)(np.linspace(1.5, 2.5, 51))
    np.testing.assert_allclose(problem.task.value(waiting)[:, :3], np.tile([0.45, 0, 0.4], (51, 1)), atol=1e-4)


@pytest.mark.slow
def test_a_turn_that_counts_as_length_takes_its_time(tmp_path: Path) -> None:
    """45 degrees within 5 mm of 200 mm: by length alone they are over within a fortieth of the motion."""
    rows = [f"0.45,{y},0.4,{way}" for y, way in ((-0.1, DOWN), (0, DOWN), (0.005, ROLLED), (0.1, ROLLED))]
    words = (HEADER, "timing.duration=4", "timing=constant_speed")
    sudden, even = along(tmp_path, rows, *words), along(tmp_path, rows, *words, "path.meters_per_radian=0.1")
    t = np.linspace(0.0, 4.0, 801)
    fastest = [np.linalg.norm(problem.reference.sample(t)[1][:, 3:], axis=1).max() for problem in (sudden, even)]
    assert fastest[0] > 10 * fastest[1]
    length = even.reference.geometry.length
    assert fastest[1] <= length / 4 / 0.1 * (1 + 1e-9)  # all of the pace is turning
    assert length > np.hypot(0.005, 0.1 * np.pi / 4) + 0.195 - 1e-9  # as its polygon
    assert even.reference.notes[-1] == "a radian of turning counts as 0.1 m of the path's length"
    with pytest.raises(ConfigError, match="corners = blend rounds by length alone"):
        along(tmp_path, rows, *words, "path.meters_per_radian=0.1", "path.corners=blend")
    line = ("path.length=0.3", "path.direction=[0,1,0]", "path.turn=[0,0,2]", "path.meters_per_radian=0.2")
    assert prepare(composed(*PANDA, *line)).reference.geometry.length == pytest.approx(0.5, abs=1e-12)
    assert prepare(composed(*PANDA, *line, "path.length=0")).reference.geometry.length == pytest.approx(0.4)
    with pytest.raises(ConfigError, match=r"path\.meters_per_radian: the task prescribes no orientation"):
        prepare(composed("robot=panda", *line[:2], "path.meters_per_radian=0.2"))
