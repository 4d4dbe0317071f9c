"""From the words of a command line to an arm with what it carries, and to a path with its orientations."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from pipeline.build.problem import prepare
from pipeline.common.errors import ConfigError, PathError, RobotError
from pipeline.evaluation.evaluation import evaluate
from pipeline.methods.lsv import lsv
from pipeline.problem.problem import Problem
from pipeline.problem.solution import Status
from tests.support import composed, robot

pytestmark = pytest.mark.slow  # together: each composes and prepares problems in space

SPACE = ("path.direction=[0,1,0]", "path.length=0.05", "timing.duration=2", "timing.steps=10")


def posed(*words: str) -> Problem:
    return prepare(composed("robot=panda", *SPACE, *words))


def test_gravity() -> None:
    q = posed().q_init[None]
    still = np.zeros_like(q)
    plain, earth, moon = (posed(*words).task.arm for words in ((), ("gravity=earth",), ("gravity=[0,0,-1.62]",)))
    assert not np.any(plain.inverse_dynamics(q, still, still))
    held = earth.inverse_dynamics(q, still, still)
    np.testing.assert_allclose(moon.inverse_dynamics(q, still, still), held * 1.62 / 9.80665, rtol=1e-9)
    # Held still, a joint balances the weight of what it carries: no torque about the vertical.
    assert abs(held[0, 0]) < 1e-9
    assert np.abs(held[0, 1]) > 1.0
    with pytest.raises(ConfigError, match=r"gravity = 'mars': must be none, earth or a list of 3 numbers m/s\^2"):
        composed("gravity=mars")


def test_payload_and_armature() -> None:
    q = posed().q_init[None]
    plain, loaded = posed().task.arm, posed("robot.payload=2").task.arm
    jacobian = plain.jacobian(q)[0]
    np.testing.assert_allclose(
        loaded.mass_matrix(q)[0] - plain.mass_matrix(q)[0], 2 * jacobian.T @ jacobian, atol=1e-10
    )
    rotors = [0.1, 0.2, 0.3, 0.4, 0.5, 0.6, 0.7]
    for words, expected in ((f"robot.armature={rotors}", rotors), ("robot.armature=0.3", [0.3] * 7)):
        heavier = posed(words.replace(" ", "")).task.arm
        np.testing.assert_allclose(heavier.mass_matrix(q)[0] - plain.mass_matrix(q)[0], np.diag(expected), atol=1e-12)
    with pytest.raises(ConfigError, match=r"robot\.armature has 2 values, the arm has 7 moving joints"):
        posed("robot.armature=[0.1,0.2]")
    with pytest.raises(ConfigError, match=r"robot\.payload = -1: must be a number >= 0 and <= 1e\+06 kg"):
        posed("robot.payload=-1")


def test_a_placed_base_and_a_tool() -> None:
    plain = posed()
    placed = posed("robot.base_position=[0.5,-0.2,0.7]", "robot.base_rpy=[0,0,1.5707963267948966]")
    here, there = (problem.reference.position(np.zeros(1))[0] for problem in (plain, placed))
    np.testing.assert_allclose(there, [0.5 - here[1], -0.2 + here[0], 0.7 + here[2]], atol=1e-9)
    tool = posed("robot.offset=[0,0,0.1]", "robot.offset_rpy=[0.3,0,0]").task.arm
    position, rotation = plain.task.arm.pose(plain.q_init[None])
    tip, turned = tool.pose(plain.q_init[None])
    np.testing.assert_allclose(tip[0], position[0] + 0.1 * rotation[0][:, 2], atol=1e-12)
    np.testing.assert_allclose(turned[0], rotation[0] @ Rotation.from_euler("x", 0.3).as_matrix(), atol=1e-12)


def test_locked_joints() -> None:
    problem = posed("robot.locked={panda_joint3: 0.2}", "robot.q_init=[0.0,-0.785,-2.356,0.0,1.571,0.785]")
    q = np.insert(problem.q_init, 2, 0.2)[None]
    assert problem.task.arm.n == 6
    np.testing.assert_allclose(problem.task.arm.position(problem.q_init[None]), robot("panda").position(q), atol=1e-12)


# --- way-points with orientations -----------------------------------------------------------------------------------

TURNS = Rotation.from_euler("xyz", [[3.1, 0.1, 0.0], [3.0, 0.0, 0.3], [2.9, -0.1, 0.5]])
POINTS = np.array([[0.4, 0.0, 0.5], [0.42, 0.05, 0.5], [0.4, 0.1, 0.55]])
HEADERS = {"roll,pitch,yaw": TURNS.as_euler("xyz"), "qx,qy,qz,qw": 2.0 * TURNS.as_quat()}


def table(folder: Path, header: str, values: np.ndarray) -> Path:
    rows = [",".join(map(repr, row)) for row in np.hstack([POINTS, values]).tolist()]
    file = folder / "points.csv"
    file.write_text("\n".join([f"x,y,z,{header}", *rows]), encoding="utf-8")
    return file


@pytest.mark.parametrize("header", HEADERS)
def test_way_points_with_orientations(tmp_path: Path, header: str) -> None:
    file = table(tmp_path, header, HEADERS[header])
    words = ["robot=panda", "path=waypoints", f"path.file={file}", "timing.duration=3"]
    problem = prepare(composed(*words, "robot.orientation=full"))
    assert problem.task.m == 6
    geometry, orientation = problem.reference.geometry, problem.reference.orientation
    assert orientation is not None
    dense = np.linspace(0.0, geometry.length, 20_001)
    for point, turn in zip(POINTS, TURNS, strict=True):
        at = dense[[int(np.argmin(np.linalg.norm(geometry.sample(dense)[0] - point, axis=1)))]]
        np.testing.assert_allclose(geometry.sample(at)[0][0], point, atol=1e-5)
        assert (turn.inv() * Rotation.from_rotvec(orientation.sample(at)[0][0])).magnitude() < 1e-3
    # The start is moved onto the first of them.
    position, rotation = problem.task.arm.pose(problem.q_init[None])
    np.testing.assert_allclose(position[0], POINTS[0], atol=1e-8)
    np.testing.assert_allclose(rotation[0], TURNS[0].as_matrix(), atol=1e-8)
    motion = evaluate(problem, lsv(problem)[0])
    assert motion.status is Status.SOLVED
    end = problem.task.arm.pose(motion.q[[-1]])[1][0]
    assert (TURNS[-1].inv() * Rotation.from_matrix(end)).magnitude() < 1e-3
    with pytest.raises(ConfigError, match="has orientations, and the task prescribes none"):
        prepare(composed(*words))


def test_orientations_that_contradict(tmp_path: Path) -> None:
    file = table(tmp_path, "roll,pitch,yaw", HEADERS["roll,pitch,yaw"])
    with pytest.raises(ConfigError, match=r"path\.file = .*points\.csv has orientations of its own"):
        prepare(
            composed(
                "robot=panda", "robot.orientation=full", "path=waypoints", f"path.file={file}", "path.turn=[0,0,1]"
            )
        )
    with pytest.raises(ConfigError, match=r"the task prescribes no orientation; set robot\.orientation"):
        posed("path.turn=[0,0,1]")
    file = table(tmp_path, "qx,qy,qz,qw", np.zeros((3, 4)))
    with pytest.raises(PathError, match=r"row 1 of the data holds a quaternion of length zero"):
        prepare(composed("robot=panda", "robot.orientation=full", "path=waypoints", f"path.file={file}"))
    with pytest.raises(RobotError, match=r"with robot\.orientation = full it must be \[x, y, z\]"):
        posed("robot.orientation=full", "robot.task=[x,y]")
