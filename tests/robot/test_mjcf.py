"""MJCF: the arm that Drake makes of the same model with every class written out, and one line for what is not read."""

from __future__ import annotations

import re
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from pydrake.multibody.parsing import Parser
from pydrake.multibody.plant import MultibodyPlant

from pipeline.common.errors import RobotError
from pipeline.model.arm import Arm
from pipeline.robot import urdf

# Bodies weighed by their shapes, two joints in one body, a joint off its body's origin, one that starts at 30 deg.
MODEL = """<mujoco model="m">
<compiler angle="degree" eulerseq="zyx"/>
{default}
<worldbody><body name="base" euler="10 20 30" {childclass}>
  <geom type="box" size="0.1 0.1 0.1"/>
  <body name="one" pos="0 0 0.5" euler="0 90 0">
    <inertial mass="2" pos="0.1 0 0" xyaxes="0 1 0 -1 0 0" diaginertia="0.02 0.03 0.04"/>
    <joint name="j1" {j1} ref="30"/>
    <body name="plate"><inertial mass="1" pos="0 0.1 0" fullinertia="0.02 0.03 0.04 0.001 0 0.002"/></body>
    <body name="two" pos="0.3 0 0" axisangle="1 1 0 40">
      <joint name="j2" {j2}/>
      <joint name="j3" {j3} pos="0 0.1 0"/>
      <geom {geom} fromto="0 0 0 0.2 0 0"/>
      <geom type="box" size="0.02 0.03 0.04" pos="0.2 0 0" quat="1 0 1 0" mass="0.7"/>
      <body name="tip" pos="0.3 0 0"/>
    </body>
  </body>
</body></worldbody></mujoco>"""
PLAIN = MODEL.format(
    default="", childclass="", j1='axis="0 1 0" range="-80 90"', j2='type="slide" axis="1 0 0" range="0 0.2"',
    j3='axis="0 1 0" range="-80 90"', geom='type="capsule" size="0.03"',
)  # fmt: skip
CLASSES = """<default><geom density="1000"/><default class="arm"><joint axis="0 1 0" range="-80 90"/>
<geom type="capsule" size="0.03"/><default class="thin"><default class="rail">
<joint type="slide" axis="1 0 0" range="0 0.2"/>
</default></default></default></default>"""
CLASSED = MODEL.format(
    default=CLASSES, childclass='childclass="arm"', j1="", j2='class="rail"', j3='class="thin"', geom='class="thin"'
)
Q = np.array([[0.7, 0.05, -0.4], [-0.2, 0.15, 0.9]])


@pytest.fixture
def write(tmp_path: Path) -> Callable[[str], Path]:
    def to_file(text: str) -> Path:
        (tmp_path / "arm.xml").write_text(text)
        return tmp_path / "arm.xml"

    return to_file


@pytest.mark.parametrize("text", [PLAIN, CLASSED], ids=["written out", "classes"])
def test_the_arm_is_drakes(write: Callable[[str], Path], text: str) -> None:
    arm = Arm(urdf.read(write(text), "tip"))
    assert arm.description.joints == ("j1", "j2", "j3")
    np.testing.assert_allclose(arm.description.lower, (*np.deg2rad([-80]), 0, *np.deg2rad([-80])))
    np.testing.assert_allclose(arm.description.upper, (*np.deg2rad([90]), 0.2, *np.deg2rad([90])))
    plant = MultibodyPlant(0.0)
    Parser(plant).AddModelsFromString(PLAIN, "xml")
    plant.Finalize()
    context, base = plant.CreateDefaultContext(), plant.GetFrameByName("base")
    for q, position, mass in zip(Q, arm.position(Q), arm.mass_matrix(Q), strict=True):
        plant.SetPositions(context, q)
        expected = plant.GetFrameByName("tip").CalcPose(context, base).translation()
        np.testing.assert_allclose(position, expected, atol=1e-14)
        np.testing.assert_allclose(mass, plant.CalcMassMatrix(context), atol=1e-13)


FAULTS = {  # old text, new text, what the message must name
    "number": ('size="0.02 0.03 0.04"', 'size="0.02 0,03 0.04"', ["geom", "size", "0,03"]),
    "position": ('pos="0 0 0.5"', 'pos="0 0"', ["body 'one'", "pos", "0 0"]),
    "mass": ('mass="2"', 'mass="2_0"', ["one", "mass", "2_0"]),
    "moments": ("0.02 0.03 0.04 0.001", "0.02 0.03 9 0.001", ["'plate'", "no body has"]),
    "both": ('fullinertia', 'quat="1 0 0 0" fullinertia', ["'plate'", "fullinertia", "quat"]),
    "no mass": ('mass="2"', "", ["one", "mass"]),
    "class": ('<joint name="j1"', '<joint class="none" name="j1"', ["<joint> 'j1'", "none"]),
    "scaled": ('eulerseq="zyx"', 'eulerseq="zyx" settotalmass="3"', ["settotalmass", "3"]),
    "mesh": ('<geom type="box" size="0.02', '<geom type="mesh" mesh="m" size="0.02', ["two", "mesh", "<inertial>"]),
    "frame": ('<body name="tip" pos="0.3 0 0"/>', '<frame><body name="tip"/></frame>', ["'two'", "<frame>"]),
    "include": ("<worldbody>", '<include file="none.xml"/><worldbody>', ["none.xml", "not found"]),
    "ball": ('name="j3" axis="0 1 0" range="-80 90"', 'name="j3" type="ball"', ["j3", "ball"]),
    "same name": ('name="tip"', 'name="two"', ["two"]),
    "no bodies": ("worldbody>", "world>", ["<body>"]),
    "curve": ("</mujoco>", '<equality><joint joint1="j3" joint2="j1" polycoef="0 1 1"/></equality></mujoco>', ["j3"]),
}  # fmt: skip


@pytest.mark.parametrize("fault", FAULTS)
def test_a_fault_is_one_line_that_names_the_culprit(
    write: Callable[[str], Path], fault: str, caplog: pytest.LogCaptureFixture
) -> None:
    old, new, named = FAULTS[fault]
    assert old in PLAIN
    with pytest.raises(RobotError, match=r"^robot\.urdf = .*arm\.xml: ") as caught:
        urdf.read(write(PLAIN.replace(old, new)), "tip")
    assert "\n" not in str(caught.value)
    for word in named:
        assert word in str(caught.value)
    assert caplog.records == []


def test_files_that_include_one_another_end(write: Callable[[str], Path]) -> None:
    with pytest.raises(RobotError, match="include one another"):
        urdf.read(write('<mujoco><include file="arm.xml"/></mujoco>'), "tip")


def test_an_equality_couples_a_joint(write: Callable[[str], Path]) -> None:
    coupled = '<equality><joint joint1="j2" joint2="j1" polycoef="0.1 2"/></equality></mujoco>'
    file = write(PLAIN.replace("</mujoco>", coupled))
    with pytest.raises(RobotError, match="joint 'j2' in the chain mimics another joint"):
        urdf.read(file, "tip")
    held = Arm(urdf.read(file, "tip", locked={"j1": 0.02}))
    assert held.description.joints == ("j3",)
    free = Arm(urdf.read(write(PLAIN), "tip"))
    np.testing.assert_allclose(
        held.position(np.array([[0.4]])), free.position(np.array([[0.02, 0.1 + 2 * 0.02, 0.4]])), atol=1e-14
    )


def test_forces_of_actuators_and_joints(write: Callable[[str], Path]) -> None:
    actuators = (
        '<actuator><motor joint="j1" ctrlrange="-3 2" gear="5"/><position joint="j3" forcerange="-4 1"/>'
        '<position joint="j2" forcerange="0 0" ctrlrange="-1 1"/></actuator></mujoco>'
    )
    text = PLAIN.replace("</mujoco>", actuators)
    assert urdf.read(write(text), "tip").effort.tolist() == [15.0, np.inf, 4.0]
    less = re.sub('name="j3"', 'name="j3" actuatorfrcrange="-2.5 2.5"', text)
    assert urdf.read(write(less), "tip").effort.tolist() == [15.0, np.inf, 2.5]
