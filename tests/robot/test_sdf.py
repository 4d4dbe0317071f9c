"""An SDF model is the arm of the URDF that says the same, whatever frames its links have."""

from __future__ import annotations

import xml.etree.ElementTree as ET
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from pipeline.common.arrays import Array
from pipeline.common.errors import RobotError
from pipeline.model.arm import Arm
from pipeline.robot import urdf
from pipeline.robot.mounting import Mounting
from tests.robot.test_urdf import ROBOT

Q = np.array([[0.7, 0.15, -1.2, 2.1], [-0.4, -0.02, 0.9, -3.0]])
LOCKED = {"elbow": 0.6}


def pose(element: ET.Element | None) -> Array:
    """An <origin> as a matrix (4, 4)."""
    made = np.eye(4)
    if element is not None:
        numbers = {key: [float(word) for word in element.get(key, "0 0 0").split()] for key in ("xyz", "rpy")}
        made[:3, :3] = Rotation.from_euler("xyz", numbers["rpy"]).as_matrix()
        made[:3, 3] = numbers["xyz"]
    return made


def text(matrix: Array) -> str:
    numbers = [*matrix[:3, 3], *Rotation.from_matrix(matrix[:3, :3]).as_euler("xyz")]
    return " ".join(repr(float(number)) for number in numbers)


def own_frames(links: list[str]) -> dict[str, Array]:
    """Each link's own frame in the frame of the joint that carries it: anything but the same."""
    rng = np.random.default_rng(4)
    frames = {}
    for link in links:
        frames[link] = np.eye(4)
        frames[link][:3, :3] = Rotation.random(random_state=rng).as_matrix()
        frames[link][:3, 3] = rng.uniform(-0.2, 0.2, 3)
    return frames


def as_sdf(robot: str, frames: dict[str, Array], root: str = "base") -> str:
    """The URDF `robot` as an SDF model, written out by hand; its root link is fixed to the world."""
    source = ET.fromstring(robot)
    frames = {**frames, root: np.eye(4)}
    there = {root: np.eye(4)}  # each link's joint frame in the model at q = 0
    parts = []
    for joint in source.findall("joint"):
        if (parent := joint.find("parent")) is None or (child := joint.find("child")) is None:
            continue
        before, after = parent.get("link", ""), child.get("link", "")
        there[after] = there[before] @ pose(joint.find("origin"))
        limit, axis = joint.find("limit"), joint.find("axis")
        assert limit is not None
        assert axis is not None
        bounds = "".join(f"<{key}>{value}</{key}>" for key, value in limit.items())
        parts.append(
            f'<joint name="{joint.get("name")}" type="{joint.get("type")}">'
            f"<parent>{before}</parent><child>{after}</child>"
            f'<pose relative_to="{after}">{text(np.linalg.inv(frames[after]))}</pose>'
            f"<axis><xyz>{axis.get('xyz')}</xyz><limit>{bounds}</limit></axis></joint>"
        )
    for link in source.findall("link"):
        name, inertial = link.get("name", ""), link.find("inertial")
        solid = ""
        if inertial is not None:
            mass, inertia = inertial.find("mass"), inertial.find("inertia")
            assert mass is not None
            assert inertia is not None
            moments = "".join(f"<{key}>{value}</{key}>" for key, value in inertia.items())
            place = text(np.linalg.inv(frames[name]) @ pose(inertial.find("origin")))
            solid = (
                f"<inertial><pose>{place}</pose><mass>{mass.get('value')}</mass><inertia>{moments}</inertia></inertial>"
            )
        parts.append(f'<link name="{name}"><pose>{text(there[name] @ frames[name])}</pose>{solid}</link>')
    fixed = f'<joint name="stand" type="fixed"><parent>world</parent><child>{root}</child></joint>'
    return f'<sdf version="1.9"><model name="test">{"".join(parts)}{fixed}</model></sdf>'


LINKS = ["upper", "carriage", "lower", "hand", "nail"]
FRAMES = own_frames(LINKS)


@pytest.fixture
def write(tmp_path: Path) -> Callable[[str, str], Path]:
    def to_file(name: str, content: str) -> Path:
        (tmp_path / name).write_text(content)
        return tmp_path / name

    return to_file


@pytest.mark.parametrize("locked", [{}, LOCKED], ids=["all move", "one locked"])
def test_the_arm_is_that_of_the_urdf(write: Callable[[str, str], Path], locked: dict[str, float]) -> None:
    ours = Arm(urdf.read(write("robot.sdf", as_sdf(ROBOT, FRAMES)), "hand", locked=locked))
    frame = FRAMES["hand"]
    theirs = Arm(
        urdf.read(write("robot.urdf", ROBOT), "hand", locked=locked),
        Mounting(frame[:3, 3], Rotation.from_matrix(frame[:3, :3]).as_euler("xyz")),
    )
    for key in ("joints", "name"):
        assert getattr(ours.description, key) == getattr(theirs.description, key)
    for key in ("revolute", "lower", "upper", "velocity", "effort"):
        np.testing.assert_array_equal(getattr(ours.description, key), getattr(theirs.description, key), key)
    q = np.delete(Q, [2] if locked else [], axis=1)
    for got, expected in zip(ours.pose(q), theirs.pose(q), strict=True):
        np.testing.assert_allclose(got, expected, atol=1e-12)
    np.testing.assert_allclose(ours.mass_matrix(q), theirs.mass_matrix(q), atol=1e-12)
    np.testing.assert_allclose(ours.bias(q, q[::-1]), theirs.bias(q, q[::-1]), atol=1e-12)


FAULTS = {  # what is wrong: old text, new text, what the message must name
    "a joint that turns every way": ('"elbow" type="revolute"', '"elbow" type="ball"', ["elbow", "ball", "revolute"]),
    "a joint that mimics": (
        "<xyz>0.6 0.8 0</xyz>",
        '<xyz>0.6 0.8 0</xyz><mimic joint="shoulder">'
        "<multiplier>1</multiplier><offset>0</offset><reference>0</reference></mimic>",
        ["elbow", "mimics", "robot.locked.elbow"],
    ),
    "a link that floats": ("</model>", '<link name="stray"/></model>', ["2", "base", "stray"]),
    "negative inertia": ("<ixx>0.01<", "<ixx>-0.01<", ["upper", "-0.01"]),
    "triangle inequality": ("<izz>0.015<", "<izz>0.05<", ["upper", "0.0501"]),
    "inertia not a number": ("<izz>0.015<", "<izz>much<", ["upper", "izz"]),
    "negative mass": ("<mass>1.0<", "<mass>-1.0<", ["upper", "-1 kg"]),
    "unknown type": ('"elbow" type="revolute"', '"elbow" type="gearbox"', ["elbow", "gearbox"]),
    "not XML": ("</model>", "", ["XML"]),
    "no model": ("model", "mode", ["mode"]),
}


@pytest.mark.parametrize("fault", FAULTS)
def test_a_fault_is_one_line_that_names_the_culprit(
    write: Callable[[str, str], Path], fault: str, caplog: pytest.LogCaptureFixture
) -> None:
    old, new, named = FAULTS[fault]
    sound = as_sdf(ROBOT, FRAMES)
    assert old in sound
    broken = sound.replace(old, new) if old == "model" else sound.replace(old, new, 1)
    with pytest.raises(RobotError) as caught:
        urdf.read(write("robot.sdf", broken), "hand")
    message = str(caught.value)
    assert "\n" not in message
    for word in ["robot.urdf", *named]:
        assert word in message
    assert caplog.records == []  # Drake's own complaints would stand before the one line


def test_a_moving_link_without_a_mass_is_named(write: Callable[[str, str], Path]) -> None:
    """SDF would give it one kilogram that nobody wrote down."""
    model = ET.fromstring(as_sdf(ROBOT, FRAMES))
    for link in model.iter("link"):
        if (solid := link.find("inertial")) is not None and link.get("name") in ("lower", "upper"):
            link.remove(solid)
    with pytest.raises(RobotError, match=r"no mass on links upper \(.*\), lower \(.*\); every moving link needs"):
        urdf.read(write("robot.sdf", ET.tostring(model, encoding="unicode")), "hand")


def test_a_model_that_stands_nowhere_is_mounted(write: Callable[[str, str], Path]) -> None:
    standing = as_sdf(ROBOT, FRAMES)
    at = standing.index('<joint name="stand"')
    loose = standing[:at] + standing[standing.index("</joint>", at) + len("</joint>") :]
    arms = [Arm(urdf.read(write("robot.sdf", content), "hand")) for content in (standing, loose)]
    np.testing.assert_allclose(arms[0].position(Q), arms[1].position(Q), atol=1e-14)


@pytest.mark.parametrize("name", ["robot.xml", "robot.world", "robot.urdf", "robot"])
def test_it_is_told_by_what_it_holds(write: Callable[[str, str], Path], name: str) -> None:
    got = Arm(urdf.read(write(name, as_sdf(ROBOT, FRAMES)), "hand"))
    np.testing.assert_allclose(
        got.position(Q), Arm(urdf.read(write("arm.sdf", as_sdf(ROBOT, FRAMES)), "hand")).position(Q), atol=1e-15
    )


DEFAULTS = {  # what would be 1 kg or 1 kg m^2 that nobody wrote down: old text, new text, what the message must name
    "no mass": ("<mass>1.0</mass>", "", ["upper", "<mass>"]),
    "a mass of zero": ("<mass>1.0</mass>", "<mass>0</mass>", ["upper", "no mass"]),
    "no inertia": ("<inertia>", "<none>", ["upper", "<inertia>"]),
    "empty izz": ("<izz>0.015</izz>", "<izz/>", ["upper", "izz ''"]),
    "no izz": ("<izz>0.015</izz>", "", ["upper", "<izz>"]),
    "computed by itself": ("<inertial>", '<inertial auto="true">', ["upper", "auto"]),
    "mass with an underscore": ("<mass>1.0</mass>", "<mass>1_0</mass>", ["upper", "mass", "1_0"]),
    "pose of the inertial": ("<inertial><pose>", "<inertial><pose>x ", ["upper", "pose"]),
}


@pytest.mark.parametrize("fault", DEFAULTS)
def test_no_default_of_sdf_leaks_in(write: Callable[[str, str], Path], fault: str) -> None:
    old, new, named = DEFAULTS[fault]
    sound = as_sdf(ROBOT, FRAMES)
    assert old in sound
    broken = sound.replace(old, new, 1)
    if fault == "no inertia":
        broken = broken.replace("</inertia>", "</none>", 1)
    with pytest.raises(RobotError) as caught:
        urdf.read(write("robot.sdf", broken), "hand")
    for word in named:
        assert word in str(caught.value)


def test_poses_and_limits_that_are_no_numbers(write: Callable[[str, str], Path]) -> None:
    sound = as_sdf(ROBOT, FRAMES)
    for old, new, named in (
        ('<link name="upper"><pose>', '<link name="upper"><pose>nan ', r"link 'upper' has the pose"),
        ("<velocity>3</velocity>", "<velocity>fast</velocity>", r"joint 'shoulder' has the velocity limit 'fast'"),
        ("<lower>-1.5</lower>", "<lower>nan</lower>", r"joint 'shoulder' has the lower limit 'nan'"),
        ("<mass>1.0</mass>", "<mass>3</mass><mass>1.0</mass>", "link 'upper' has 2 different <mass>"),
        ("<izz>0.015</izz>", "<izz>1</izz><izz>0.015</izz>", "link 'upper' has 2 different <izz>"),
        ("<velocity>3</velocity>", "<velocity>9</velocity><velocity>3</velocity>", "'shoulder' has 2 different <velo"),
        ("<xyz>0.6 0.8 0</xyz>", "<xyz>1 0 0</xyz><xyz>0.6 0.8 0</xyz>", "joint 'elbow' has 2 different <xyz>"),
        ("<xyz>0.6 0.8 0</xyz>", "<xyz>0.6 0,8 0</xyz>", r"joint 'elbow' has in its axis the xyz '0,8'"),
    ):
        assert old in sound
        with pytest.raises(RobotError, match=named):
            urdf.read(write("robot.sdf", sound.replace(old, new, 1)), "hand")


def test_an_included_model_is_the_same_arm(write: Callable[[str, str], Path], monkeypatch: pytest.MonkeyPatch) -> None:
    arm = write("inner.sdf", as_sdf(ROBOT, FRAMES))
    folder = arm.parent / "some_arm"
    folder.mkdir()
    arm.rename(folder / "model.sdf")
    monkeypatch.setenv("GZ_SIM_RESOURCE_PATH", str(arm.parent))
    plain = Arm(urdf.read(folder / "model.sdf", "hand"))
    for uri in ("model://some_arm", "some_arm/model.sdf"):
        include = f"<include><uri>{uri}</uri><pose>1 2 3 0 0 0</pose></include>"
        outer = f'<sdf version="1.9"><world name="w">{include}</world></sdf>'
        got = Arm(urdf.read(write("outer.world", outer), "hand"))
        np.testing.assert_allclose(got.position(Q), plain.position(Q), atol=1e-14)
        np.testing.assert_allclose(got.mass_matrix(Q), plain.mass_matrix(Q), atol=1e-13)
        np.testing.assert_array_equal(got.description.effort, plain.description.effort)
    with pytest.raises(RobotError, match="the included model model://none was not found"):
        urdf.read(write("outer.world", outer.replace("some_arm/model.sdf", "model://none")), "hand")
