"""A robot file alone: what holds for it is read from it, and nothing of the robot whose option stands there."""

from __future__ import annotations

from pathlib import Path

import pytest
import yaml

from pipeline.common.errors import RobotError
from pipeline.config.robot import RobotConfig
from pipeline.run import own_robot
from tests.commands import Run
from tests.support import composed

LINK = (
    '<link name="{0}"><inertial><mass value="1"/>'
    '<inertia ixx=".1" iyy=".1" izz=".1" ixy="0" ixz="0" iyz="0"/></inertial></link>'
)


def urdf(file: Path, *joints: tuple[str, str, str, str]) -> Path:
    """A robot of joints (kind, parent, child, axis)."""
    links = dict.fromkeys(link for _, parent, child, _ in joints for link in (parent, child))
    text = [LINK.format(link) for link in links]
    text += [
        f'<joint name="to_{child}" type="{kind}"><parent link="{parent}"/><child link="{child}"/><axis xyz="{axis}"/>'
        '<limit lower="-1" upper="1" velocity="1" effort="9"/></joint>'
        for kind, parent, child, axis in joints
    ]
    file.write_text(f'<robot name="r">{"".join(text)}</robot>')
    return file


def said(file: Path, *words: str) -> dict[str, str]:
    found, _ = own_robot.words([f"robot.urdf={file}", *words])
    return {key.removeprefix("robot."): value for key, _, value in (word.partition("=") for word in found)}


def test_what_the_file_says(tmp_path: Path) -> None:
    """The longest chain, up to where it forks into fingers; there the frame that is called a tool."""
    file = urdf(
        tmp_path / "my arm.urdf",
        ("prismatic", "base", "lift", "0 0 1"),
        ("revolute", "lift", "head", "0 1 0"),
        ("revolute", "lift", "upper", "0 1 0"),
        ("continuous", "upper", "hand", "1 0 0"),
        ("prismatic", "hand", "finger_left_tip", "0 1 0"),
        ("prismatic", "hand", "finger_right_tip", "0 1 0"),
        ("fixed", "hand", "camera", "0 0 1"),
        ("fixed", "hand", "gripper_tcp", "0 0 1"),
        ("fixed", "hand", "cover", "0 0 1"),
        ("fixed", "hand", "third_finger_tip", "0 0 1"),
    )
    found = said(file)
    assert (found["name"], found["end_effector"], found["task"]) == ('"my_arm"', '"gripper_tcp"', "[x,y,z]")
    robot, nobodys = composed(*(f"robot.{key}={value}" for key, value in found.items())).robot, RobotConfig()
    assert (robot.name, robot.end_effector, robot.q_init) == ("my_arm", "gripper_tcp", None)
    for key in ("limits", "srdf", "collision", "locked", "armature", "offset", "base"):
        assert getattr(robot, key) == getattr(nobodys, key)
    line = own_robot.words([f"robot.urdf={file}"])[1]
    assert line.startswith("note: my arm.urdf says no more, so robot.end_effector=gripper_tcp (its last link), ")
    given = said(file, "robot.end_effector=head", "robot.q_init=[0,0]", "++robot.name=nod")
    assert not {"end_effector", "q_init", "name"} & set(given)
    assert said(urdf(tmp_path / "bare.urdf", ("revolute", "base", "flange", "1 0 0")))["end_effector"] == '"flange"'


def test_a_gripper_is_not_of_the_arm_and_two_arms_are_not_guessed(tmp_path: Path) -> None:
    """As the descriptions of Unitree's Z1 (one jaw) and Baxter (two arms of seven joints) have it."""
    arm = [("revolute", "base", "l1", "0 0 1"), ("revolute", "l1", "l2", "0 1 0"), ("fixed", "l2", "stator", "0 0 1")]
    jaw = urdf(tmp_path / "jaw.urdf", *arm, ("revolute", "stator", "gripper_mover", "0 1 0"))
    assert said(jaw)["end_effector"] == '"stator"'
    sides = [
        (kind, "torso" if parent == "base" else f"{side}_{parent}", f"{side}_{child}", axis)
        for side in ("left", "right")
        for kind, parent, child, axis in arm
    ]
    two = urdf(tmp_path / "two.urdf", ("revolute", "base", "torso", "0 0 1"), *sides)
    with pytest.raises(RobotError, match=r"^robot.end_effector must say .* 'torso' .* left_l2 or right_l2$"):
        said(two)
    assert "end_effector" not in said(two, "robot.end_effector=left_stator")


@pytest.mark.parametrize(
    ("first", "second", "task"),
    [
        ("revolute 0 0 1", "revolute 0 0 -2", "[x,y]"),
        ("prismatic 0 1 0", "revolute 0 0 1", "[x,y]"),
        ("prismatic 0 0 1", "revolute 0 0 1", "[x,y,z]"),
        ("revolute 0 0 1", "revolute 1 0 0", "[x,y,z]"),
    ],
)
def test_arms_in_the_plane(first: str, second: str, task: str, tmp_path: Path) -> None:
    joints = [(*one.split(" ", 1), link) for one, link in ((first, "base"), (second, "l1"))]
    made = [(kind, parent, f"l{i + 1}", axis) for i, (kind, axis, parent) in enumerate(joints)]
    assert said(urdf(tmp_path / "arm.urdf", *made))["task"] == task


def test_nothing_is_said_where_the_option_or_nobody_knows(tmp_path: Path) -> None:
    file = urdf(tmp_path / "arm.urdf", ("revolute", "base", "tip", "0 0 1"))
    broken = tmp_path / "broken.urdf"
    broken.write_text("<robot>")
    for words in (
        ["robot=panda"],
        ["robot.q_init=null"],
        [f"robot.urdf={file}", "robot=panda"],
        ["-m", f"robot.urdf={file},{file}"],
        [f"robot.urdf={tmp_path / 'absent.urdf'}"],
        [f"robot.urdf={broken}"],
    ):
        assert own_robot.words(words) == ([], "")


def test_the_composed_run_has_it(run: Run, tmp_path: Path) -> None:
    urdf(tmp_path / "arm.urdf", ("prismatic", "base", "cart", "1 0 0"), ("revolute", "cart", "tip", "0 1 0"))
    answer = run("robot.urdf=arm.urdf", "robot.payload=2", "--cfg", "job")
    assert answer.code == 0
    line, _, text = answer.out.partition("\n")
    assert line.startswith("note: arm.urdf says no more, so robot.end_effector=tip")
    robot = yaml.safe_load(text)["robot"]
    assert (robot["name"], robot["end_effector"], robot["task"]) == ("arm", "tip", ["x", "y", "z"])
    assert (robot["q_init"], robot["payload"]) == (None, 2)
