"""Descriptions in the styles that people have, each with its right value: the arm it is, or the one line it gets."""

from __future__ import annotations

from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np
import pytest

from pipeline.build.regular import require_regular
from pipeline.common.errors import RobotError
from pipeline.model.arm import Arm
from pipeline.robot import urdf
from pipeline.robot.description import Description
from pipeline.robot.mounting import Mounting

FOLDER = Path(__file__).parent / "descriptions"
INF = np.inf


def read(file: str, tip: str, **how: object) -> Description:
    return urdf.read(FOLDER / file, tip, **how)  # type: ignore[arg-type]


def two_links(first: float, second: float, at: tuple[float, float, float] = (0.0, 0.0, 0.0)) -> np.ndarray:
    """Where the tip of links of 0.4 m and 0.3 m in a plane is."""
    along = [[np.cos(a), np.sin(a), 0.0] for a in (first, first + second)]
    return np.array(at) + 0.4 * np.array(along[0]) + 0.3 * np.array(along[1])


@pytest.mark.parametrize(("file", "drives"), [("mobile_base.urdf", "drive"), ("planar_base.urdf", "drive")])
def test_a_base_that_drives(file: str, drives: str) -> None:
    """Its empty links are carried by the cart and the arm: whatever moves along x or y is all 25 kg."""
    got = read(file, "hand")
    assert got.joints == (f"{drives}_x", f"{drives}_y", f"{drives}_yaw", "shoulder", "elbow")
    assert got.revolute.tolist() == [False, False, True, True, True]
    assert len(got.notes) >= 1
    arm = Arm(got)
    require_regular(arm)
    q = np.array([[0.5, -0.2, 0.0, 0.3, 0.4]])
    mass = arm.mass_matrix(q)[0]
    assert mass[0, 0] == pytest.approx(25.0)
    assert mass[1, 1] == pytest.approx(25.0)
    assert mass[0, 1] == pytest.approx(0.0, abs=1e-12)
    np.testing.assert_allclose(arm.position(q)[0], two_links(0.3, 0.4, (0.6, -0.2, 0.3)), atol=1e-14)


def test_what_old_exporters_left() -> None:
    got = read("old_simulator.urdf", "hand")
    assert got.name == "old_simulator"  # the file's, since it has none
    assert (got.base, got.joints) == ("world", ("shoulder", "elbow"))
    assert (got.lower.tolist(), got.upper.tolist()) == ([-3.0, -INF], [3.0, INF])
    assert (got.velocity.tolist(), got.effort.tolist()) == ([2.0, INF], [50.0, INF])
    np.testing.assert_allclose(Arm(got).position(np.array([[0.3, 0.4]]))[0], two_links(0.3, 0.4), atol=1e-14)


def test_a_finger_stands_where_what_it_mimics_does() -> None:
    got = read("gripper.urdf", "right_finger")
    assert got.joints == ("shoulder", "elbow")
    assert got.notes == ("joint right_slide stands at 0.01, as what it mimics does not move",)
    np.testing.assert_allclose(Arm(got).position(np.zeros((1, 2)))[0], (0.7, -0.01, 0.0), atol=1e-15)
    held = read("gripper.urdf", "right_finger", locked={"left_slide": 0.04})
    np.testing.assert_allclose(Arm(held).position(np.zeros((1, 2)))[0], (0.7, -0.03, 0.0), atol=1e-15)
    text = (FOLDER / "gripper.urdf").read_text()
    with pytest.raises(RobotError, match=r"joint 'right_slide' in the chain mimics another joint; lock it"):
        _read_text(text.replace('mimic joint="left_slide"', 'mimic joint="elbow"'), "right_finger")


def _read_text(text: str, tip: str) -> Description:
    with TemporaryDirectory() as folder:
        file = Path(folder) / "robot.urdf"
        file.write_text(text)
        return urdf.read(file, tip)


def test_three_joints_in_one_place() -> None:
    got = read("spherical_wrist.urdf", "hand")
    assert got.joints == ("shoulder", "wrist_z", "wrist_y", "wrist_x")
    assert got.notes[0].startswith("wrist_1, wrist_2 without a mass")
    require_regular(Arm(got))
    # The hand's 2 kg, 0.15 m out, and its 0.02 kg m^2 are all that the wrist turns.
    mass = Arm(got).mass_matrix(np.zeros((1, 4)))[0]
    np.testing.assert_allclose(np.diag(mass)[1:], (0.02 + 2 * 0.15**2, 0.02 + 2 * 0.15**2, 0.02), rtol=1e-12)
    longer = (
        (FOLDER / "spherical_wrist.urdf")
        .read_text()
        .replace('<child link="wrist_2"/>', '<child link="wrist_2"/><origin xyz="0 0 0.1"/>')
    )
    with pytest.raises(RobotError, match="no mass on link wrist_1; every moving link needs an <inertial> with a mass"):
        _read_text(longer, "hand")  # a link that spans something weighs something


def test_a_mass_on_the_last_axis() -> None:
    got = read("point_wrist.urdf", "hand")
    with pytest.raises(RobotError, match=r"link hand: moving joint roll moves no mass, .* or robot\.armature$"):
        require_regular(Arm(got))
    require_regular(Arm(got, Mounting(armature=1e-3)))
    require_regular(Arm(got, Mounting(offset=(0.0, 0.1, 0.0), payload=0.1)))  # off the axis


def test_inertias_of_a_drawing_program() -> None:
    with pytest.raises(
        RobotError, match=r"export\.urdf: link 'upper' has an inertia that no body has .*0\.01, 0\.01, 0\.5"
    ):
        read("export.urdf", "hook")
    got = read("export.urdf", "hook", repair_inertia=True)
    said = " ".join(got.notes)
    assert "link upper has the principal moments 0.25, 0.25, 0.5 kg m^2, not 0.01, 0.01, 0.5" in said
    turned = Arm(got).mass_matrix(np.zeros((1, 2)))[0]
    lever = 3 * 0.2**2 + 2 * 0.55**2 + 1e-6 * 0.7**2
    assert turned[0, 0] == pytest.approx(0.5 + 0.02 + lever, abs=2e-6)


def test_a_macro_file() -> None:
    with pytest.raises(
        RobotError, match=r"macro\.urdf: a xacro file, not expanded \('\$\{length\} 0 0' in a <origin>\); expand"
    ):
        read("macro.urdf", "upper")


@pytest.mark.parametrize("file", ["classes.xml", "scene.xml"])
def test_mjcf_with_classes_and_in_a_scene(file: str) -> None:
    got = read(file, "tool")
    assert got.joints == ("shoulder", "elbow", "wrist")
    assert (got.base, got.name) == ("base", file.removesuffix(".xml"))
    np.testing.assert_allclose(np.rad2deg(got.upper), (170, 170, 45))
    np.testing.assert_allclose(np.rad2deg(got.lower), (-170, -170, -90))
    assert got.effort.tolist() == [80.0, 12.0, 6.0]
    assert got.velocity.tolist() == [INF, INF, INF]
    said = " ".join(got.notes)
    assert "robot.armature=[0.1,0.1,0.1] takes it" in said
    assert "cup" in said
    arm = Arm(got)
    q = np.array([[0.3, 0.4, 0.2]])  # the fore link lies along -y of its frame, which is turned by 90 deg
    expected = two_links(0.3, 0.4) + 0.1 * np.array([np.cos(0.9), np.sin(0.9), 0.0])
    np.testing.assert_allclose(arm.position(q)[0], expected, atol=1e-14)
    # The hand turns about its centre: 0.0025 kg m^2, turned about the axis that it turns about.
    assert arm.mass_matrix(q)[0, 2, 2] == pytest.approx(0.0025)
    assert urdf.link_masses(got) == {"shoulder": 3.0, "elbow": 2.0, "wrist": 0.5}


def test_a_world_with_an_arm_of_nested_models() -> None:
    got = read("cell.world", "hand")
    assert (got.name, got.base, got.joints) == ("arm", "base", ("shoulder", "elbow"))
    assert (got.lower.tolist(), got.upper.tolist()) == ([-3.0, -INF], [3.0, INF])
    assert (got.velocity.tolist(), got.effort.tolist()) == ([2.0, INF], [50.0, INF])
    arm = Arm(got)
    position, rotation = arm.pose(np.array([[0.3, 0.4]]))
    np.testing.assert_allclose(position[0], two_links(0.3, 0.4), atol=1e-14)
    turn = 0.7 + np.pi / 2
    np.testing.assert_allclose(rotation[0][:2, 0], (np.cos(turn), np.sin(turn)), atol=1e-14)
