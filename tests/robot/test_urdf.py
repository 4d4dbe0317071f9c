from __future__ import annotations

import re
import signal
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path

import numpy as np
import pytest
from pydrake.multibody.parsing import Parser
from pydrake.multibody.plant import MultibodyPlant

from pipeline.common.arrays import Array
from pipeline.common.errors import RobotError
from pipeline.model.arm import Arm
from pipeline.robot import urdf


def link(name: str, mass: float = 1.0) -> str:
    return (
        f'<link name="{name}"><visual><geometry><mesh filename="package://none/{name}.obj"/></geometry></visual>'
        f'<inertial><origin xyz="0.1 0.02 0.03"/><mass value="{mass}"/>'
        '<inertia ixx="0.01" iyy="0.012" izz="0.015" ixy="0.001" ixz="0" iyz="0.002"/></inertial></link>'
    )


def joint(name: str, parent: str, child: str, kind: str, axis: str = "0 0 1", extra: str = "") -> str:
    return (
        f'<joint name="{name}" type="{kind}"><parent link="{parent}"/><child link="{child}"/>'
        f'<origin xyz="0.3 0.1 0.2" rpy="0.4 -0.3 0.8"/><axis xyz="{axis}"/>{extra}</joint>'
    )


LIMIT = '<limit lower="-1.5" upper="2.5" effort="40" velocity="3"/>'
SLIDE = '<limit lower="-0.1" upper="0.2" effort="50" velocity="0.5"/>'
# base -shoulder-> upper -slide-> carriage -elbow-> lower -wrist-> hand; a finger branches off the hand.
ROBOT = (
    '<robot name="test">\n'
    + '<link name="base"/>\n'
    + joint("shoulder", "base", "upper", "revolute", extra=LIMIT)
    + link("upper")
    + joint("slide", "upper", "carriage", "prismatic", "0 0.6 0.8", SLIDE)
    + link("carriage")
    + joint("elbow", "carriage", "lower", "revolute", "0.6 0.8 0", LIMIT)
    + link("lower")
    + joint("wrist", "lower", "hand", "continuous", "1 0 0", '<limit effort="4" velocity="9"/>')
    + link("hand")
    + joint("finger", "hand", "nail", "prismatic", "0 1 0", SLIDE)
    + link("nail", 0.5)
    + '<transmission name="t"><joint name="shoulder"/></transmission><gazebo reference="hand"/>\n</robot>'
)


@pytest.fixture
def write(tmp_path: Path) -> Callable[[str], Path]:
    def to_file(text: str) -> Path:
        file = tmp_path / "robot.urdf"
        file.write_text(text)
        return file

    return to_file


class Whole:
    """The unreduced robot in Drake: every joint of the file moves."""

    def __init__(self, text: str, tip: str, base: str = "base") -> None:
        self.plant = MultibodyPlant(0.0)
        bare = re.sub(r"<(visual|transmission)\b.*?</\1>|<mimic.*?/>", "", text)
        Parser(self.plant).AddModelsFromString(bare, "urdf")
        self.plant.WeldFrames(self.plant.world_frame(), self.plant.GetFrameByName(base))
        self.plant.Finalize()
        self.tip, self.context = self.plant.GetFrameByName(tip), self.plant.CreateDefaultContext()
        self.q = np.zeros(self.plant.num_positions())

    def at(self, **positions: float) -> Whole:
        for name, value in positions.items():
            start = self.plant.GetJointByName(name).position_start()
            self.q[start] = value
        self.plant.SetPositions(self.context, self.q)
        return self

    def position(self) -> Array:
        return self.tip.CalcPoseInWorld(self.context).translation()

    def mass_matrix(self, *names: str) -> Array:
        rows = [self.plant.GetJointByName(name).velocity_start() for name in names]
        return self.plant.CalcMassMatrix(self.context)[np.ix_(rows, rows)]


Q = {"shoulder": 0.7, "slide": 0.15, "elbow": -1.2, "wrist": 2.1}


def test_limits_are_read_and_continuous_joints_have_none(write: Callable[[str], Path]) -> None:
    got = urdf.read(write(ROBOT), "hand")
    assert got.joints == tuple(Q)
    assert "mesh" not in got.xml  # so that a missing one does not matter
    assert (got.name, got.base, got.end_effector) == ("test", "base", "hand")
    assert got.revolute.tolist() == [True, False, True, True]
    assert got.lower.tolist() == [-1.5, -0.1, -1.5, -np.inf]
    assert got.upper.tolist() == [2.5, 0.2, 2.5, np.inf]
    assert got.velocity.tolist() == [3, 0.5, 3, 9]
    assert got.effort.tolist() == [40, 50, 40, 4]
    bare = urdf.read(write(ROBOT.replace(LIMIT, "")), "hand")
    assert bare.lower[0] == -np.inf
    assert bare.effort[0] == np.inf


def test_branch_joints_become_rigid_and_keep_their_mass(write: Callable[[str], Path]) -> None:
    arm = Arm(urdf.read(write(ROBOT), "hand"))
    q = np.array([list(Q.values())])
    whole = Whole(ROBOT, "hand").at(**Q)
    np.testing.assert_allclose(arm.position(q)[0], whole.position(), atol=1e-14)
    np.testing.assert_allclose(arm.mass_matrix(q)[0], whole.mass_matrix(*Q), atol=1e-13)


@pytest.mark.parametrize(
    ("name", "position"), [("shoulder", 0.9), ("slide", -0.07), ("elbow", -2.0), ("wrist", 4.0), ("finger", 0.12)]
)
@pytest.mark.parametrize("scale", [1, 2])  # an axis need not be a unit vector
@pytest.mark.parametrize("origin", ["0.4 -0.3 0.8", "0.4 1.5707963267948966 0.8"])
def test_a_locked_joint_stands_at_its_position(
    write: Callable[[str], Path], name: str, position: float, scale: int, origin: str
) -> None:
    text = ROBOT.replace("0.4 -0.3 0.8", origin)
    if scale == 2:
        for axis, twice in (("0 0 1", "0 0 2"), ("0 0.6 0.8", "0 1.2 1.6"), ("0.6 0.8 0", "1.2 1.6 0")):
            text = text.replace(f'axis xyz="{axis}"', f'axis xyz="{twice}"')
    arm = Arm(urdf.read(write(text), "nail", locked={name: position, **({} if name == "finger" else {"finger": 0.0})}))
    assert name not in arm.description.joints
    q = np.array([[Q[joint] for joint in arm.description.joints]])
    whole = Whole(text, "nail").at(**{**Q, "finger": 0.0, name: position})
    np.testing.assert_allclose(arm.position(q)[0], whole.position(), atol=1e-12)


def test_a_joint_before_the_base_becomes_rigid(write: Callable[[str], Path]) -> None:
    arm = Arm(urdf.read(write(ROBOT), "hand", base="carriage"))
    assert arm.description.joints == ("elbow", "wrist")
    whole = Whole(ROBOT, "hand").at(elbow=0.4, wrist=-0.3)
    np.testing.assert_allclose(arm.position(np.array([[0.4, -0.3]]))[0], whole.position(), atol=1e-14)


def test_a_mimicking_joint_may_be_locked(write: Callable[[str], Path]) -> None:
    text = ROBOT.replace('<axis xyz="0.6 0.8 0"/>', '<axis xyz="0.6 0.8 0"/><mimic joint="shoulder"/>')
    assert "elbow" not in urdf.read(write(text), "hand", locked={"elbow": 0.0}).joints


def test_a_file_that_calls_its_root_world(write: Callable[[str], Path]) -> None:
    arm = Arm(urdf.read(write(ROBOT.replace('"base"', '"world"')), "hand"))
    q = np.array([list(Q.values())] * 3)
    np.testing.assert_allclose(arm.position(q), [Whole(ROBOT, "hand").at(**Q).position()] * 3, atol=1e-14)


INERTIA = 'ixx="0.01" iyy="0.012" izz="0.015"'
HAND = link("hand")
FAULTS = [  # what is wrong, old text, new text, arguments, what the message must name
    ("not XML", "</robot>", "", {}, ["not well-formed"]),
    ("wrong root", "robot", "sdf", {}, ["<sdf>", "<robot>"]),
    ("unknown tip", "", "", {"end_effector": "hnad"}, ["hnad", "did you mean hand"]),
    ("unknown base", "", "", {"base": "carrige"}, ["carrige", "did you mean carriage"]),
    ("unknown locked joint", "", "", {"locked": {"elbo": 0.0}}, ["elbo", "did you mean elbow"]),
    ("no inertia", HAND + joint("finger", "hand", "nail", "prismatic", "0 1 0", SLIDE) + link("nail", 0.5),
     '<link name="hand"/>', {}, ["hand", "inertial"]),
    ("negative inertia", INERTIA, 'ixx="-0.01" iyy="0.012" izz="0.015"', {}, ["upper", "-0.01"]),
    ("triangle inequality", INERTIA, 'ixx="0.01" iyy="0.012" izz="0.05"', {}, ["upper", "0.05"]),
    ("inertia not a number", INERTIA, 'ixx="much" iyy="0.012" izz="0.05"', {}, ["upper", "expected a number"]),
    ("inertia nan", INERTIA, 'ixx="nan" iyy="0.012" izz="0.015"', {}, ["upper"]),
    ("mass not a number", 'value="1.0"', 'value="heavy"', {}, ["upper", "heavy"]),
    ("mass nan", 'value="1.0"', 'value="nan"', {}, ["upper", "nan"]),
    ("negative mass", HAND, link("hand", -0.1), {}, ["hand"]),
    ("floating", 'name="elbow" type="revolute"', 'name="elbow" type="floating"', {}, ["elbow", "floating", "revolute"]),
    ("mimic", '<axis xyz="0.6 0.8 0"/>', '<axis xyz="0.6 0.8 0"/><mimic joint="shoulder"/>', {},
     ["elbow", "robot.locked.elbow"]),
    ("base below tip", "", "", {"base": "hand", "end_effector": "upper"}, ["hand", "upper", "not reached"]),
    ("base is tip", "", "", {"base": "hand"}, ["no moving joint", "hand"]),
    ("limit not a number", 'upper="2.5"', 'upper="pi"', {}, ["shoulder", "upper", "pi"]),
    ("limit nan", 'velocity="3"', 'velocity="nan"', {}, ["shoulder", "velocity", "nan"]),
    ("several roots", "</robot>", '<link name="stray"/></robot>', {}, ["2", "base", "stray"]),
    ("unknown child", 'child link="hand"', 'child link="hands"', {}, ["wrist", "child", "hands"]),
    ("no joint name", 'joint name="wrist"', "joint", {}, ["<joint> has no name"]),
    ("two links of one name", "</robot>", HAND + "</robot>", {}, ["hand"]),
    ("two joints of one name", 'joint name="wrist"', 'joint name="elbow"', {}, ["elbow"]),
    ("axis of zeros", 'xyz="0.6 0.8 0"', 'xyz="0 0 0"', {}, ["elbow"]),
    ("origin not numbers", 'rpy="0.4 -0.3 0.8"', 'rpy="0 up 0"', {}, ["shoulder"]),
]  # fmt: skip


@contextmanager
def at_most(seconds: int) -> Iterator[None]:
    def give_up(*_: object) -> None:
        raise TimeoutError(f"no answer within {seconds} s")

    before = signal.signal(signal.SIGALRM, give_up)
    signal.alarm(seconds)
    try:
        yield
    finally:
        signal.alarm(0)
        signal.signal(signal.SIGALRM, before)


@pytest.mark.parametrize(("old", "new", "arguments", "named"), [f[1:] for f in FAULTS], ids=[f[0] for f in FAULTS])
def test_a_fault_is_one_line_that_names_the_culprit(
    write: Callable[[str], Path], old: str, new: str, arguments: dict[str, object], named: list[str]
) -> None:
    assert old in ROBOT
    file = write(ROBOT.replace(old, new) if old in ("robot",) else ROBOT.replace(old, new, 1) if old else ROBOT)
    with pytest.raises(RobotError) as caught:
        urdf.read(file, **{"end_effector": "hand", **arguments})
    message = str(caught.value)
    assert "\n" not in message
    for word in ["robot.urdf", *named]:
        assert word in message


def test_no_such_file(tmp_path: Path) -> None:
    with pytest.raises(RobotError, match=r"^robot.urdf = .*absent.urdf: no such file$"):
        urdf.read(tmp_path / "absent.urdf", "hand")


def test_links_in_a_loop_are_refused(write: Callable[[str], Path]) -> None:
    loop = link("a") + link("b") + joint("ab", "a", "b", "revolute") + joint("ba", "b", "a", "revolute")
    with at_most(2), pytest.raises(RobotError, match=r"robot.urdf"):
        urdf.read(write(ROBOT.replace("</robot>", loop + "</robot>")), "b")


def test_a_link_with_two_parents_is_refused(write: Callable[[str], Path]) -> None:
    second = joint("strut", "upper", "hand", "fixed")
    with pytest.raises(RobotError, match=r"hand"):
        urdf.read(write(ROBOT.replace("</robot>", second + "</robot>")), "hand")
