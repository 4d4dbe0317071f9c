from __future__ import annotations

from functools import partial
from pathlib import Path

import numpy as np
import pytest
from rerun.chunk import RrdReader

from pipeline.artifacts.recording.recording import read_series
from pipeline.describe import __main__ as command
from pipeline.describe.facts import Facts, inspect
from pipeline.describe.show import sweep
from tests.commands import Run, assert_refused, call
from tests.support import composed, robot, within_limits


def facts(*words: str) -> Facts:
    config = composed(*words)
    return inspect(config.robot, config.gravity)


def test_panda(rng: np.random.Generator) -> None:
    found = facts("robot=panda")
    assert found.tasks == {
        "position in the x-y plane": (2, 2),
        "position": (3, 3),
        "position and pointing": (5, 5),
        "pose": (6, 6),
    }
    arm = robot("panda")
    text = arm.description.file.read_text(encoding="utf-8")
    values = [float(part.split('"')[0]) for part in text.split('<mass value="')[1:]]
    root = text.split('<link name="panda_link0">')[1].split("</link>")[0]
    standing = float(root.split('<mass value="')[1].split('"')[0]) if "<mass" in root else 0.0
    assert sum(found.masses.values()) == pytest.approx(sum(values) - standing)
    assert list(found.masses) == list(arm.description.joints)
    # No configuration reaches farther, and some nearly as far.
    far = np.linalg.norm(arm.position(within_limits(arm, 20_000, rng)) - arm.first_joint(), axis=1).max()
    assert 0.95 * found.reach < far < found.reach
    assert found.notes == []


def test_planar4r() -> None:
    found = facts("robot=planar4r")
    assert found.tasks == {
        "position in the x-y plane": (2, 2),
        "position": (2, 3),
        "position and pointing": (2, 5),
        "pose": (3, 6),
    }
    arm = robot("planar4r")
    stretched = arm.position(np.zeros((1, 4)))[0]
    assert found.reach == pytest.approx(np.linalg.norm(stretched - arm.first_joint()), abs=1e-6)
    assert len(found.masses) == 4


def test_notes(tmp_path: Path) -> None:
    words = ["robot=planar4r", "robot.payload=0.3", "robot.armature=0.01", "robot.q_init=[9,0,0,0]"]
    file = tmp_path / "arm.urdf"
    text = robot("planar4r").description.file.read_text(encoding="utf-8")
    text = text.replace("velocity=", "ignored=").replace(
        "</link>", '<visual><geometry><mesh filename="a.stl"/></geometry></visual></link>', 1
    )
    file.write_text(text, encoding="utf-8")
    said = "; ".join(facts(*words, f"robot.urdf={file}").notes)
    for words_of_it in (
        "no velocity limit stated for joint1, joint2",
        "robot.q_init of joint1 is outside its limits",
        "a payload of 0.3 kg",
        "rotor inertia 0.01, 0.01, 0.01, 0.01 kg m^2",
        "1 mesh file not found, such as a.stl",
    ):
        assert words_of_it in said


def test_the_sweep_moves_one_joint_after_the_other_within_its_limits() -> None:
    found = facts("robot=panda")
    time, q = sweep(found)
    description = found.arm.description
    assert (q >= description.lower - 1e-12).all()
    assert (q <= description.upper + 1e-12).all()
    away = np.abs(q - found.q_init) > 1e-9
    assert (away.sum(axis=1) <= 1).all()
    assert away.any(axis=0).all()
    assert (np.diff(time) > 0).all()


# --- the command ----------------------------------------------------------------------------------------------------


@pytest.fixture
def run(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capfd: pytest.CaptureFixture[str]) -> Run:
    monkeypatch.chdir(tmp_path)
    return partial(call, monkeypatch, capfd, entry=command.main)


def test_the_command_prints_and_records(run: Run, tmp_path: Path) -> None:
    answer = run("robot=panda")
    assert answer.code == 0, answer.error
    assert answer.error == ""
    for words in ("panda_joint7", "reach 0.947", "pose (m = 6): r = 1", "position (m = 3): r = 4"):
        assert words in answer.out
    file = tmp_path / "outputs" / "describe" / "panda" / "recording.rrd"
    time, q = sweep(facts("robot=panda"))
    moments, values = read_series(file, "/joint_position")
    np.testing.assert_allclose(moments, time, atol=1e-9)
    np.testing.assert_array_equal(values, q)
    assert any("panda_link4" in chunk.entity_path for chunk in RrdReader(file).stream())


@pytest.mark.parametrize(
    ("words", "named"),
    [
        (["robot.urdf=nowhere.urdf"], ["robot.urdf", "nowhere.urdf", "no such file"]),
        (["robot=panda", "robot.end_effector=hand"], ["robot.end_effector", "did you mean panda_hand"]),
        (["robot=pand"], ["robot", "pand", "panda", "xarm7"]),
        (["robot.urdf=package://nowhere/arm.urdf"], ["no package nowhere was found"]),
    ],
)
def test_a_bad_robot_is_one_line(run: Run, tmp_path: Path, words: list[str], named: list[str]) -> None:
    assert_refused(run(*words), *named)
    assert list(tmp_path.iterdir()) == []
