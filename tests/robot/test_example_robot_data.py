"""Every URDF of example-robot-data, from its root to the last link of its longest chain: read, or refused rightly."""

from __future__ import annotations

import xml.etree.ElementTree as ET
from pathlib import Path

import numpy as np
import pytest
from pydrake.multibody.parsing import Parser
from pydrake.multibody.plant import MultibodyPlant

from pipeline.common.errors import RobotError
from pipeline.robot import urdf
from pipeline.robot.packages import locate

ROBOTS = locate("package://example-robot-data/robots", "robot.urdf")
FILES = sorted(ROBOTS.rglob("*.urdf"))

REFUSED = {  # with why, and what in the file makes it so
    "quadrotor_base.urdf": "no moving joint between",  # its joints are all fixed
    "iris_simple.urdf": "no moving joint between",  # its joints are all fixed
    "ur3.urdf": "it holds no link",  # an empty <robot>
    "romeo_small.urdf": "link 'RShoulderYawLink' has an inertia that no body has",  # 0.0066 > 0.00066 + 0.00068
    "romeo_laas_small.urdf": "no mass on link r_gripper",  # the last link has no <inertial>
}


def longest(file: Path) -> str:
    """The last link of the longest chain, by moving joints, then by all; the last of several."""
    root = ET.parse(file).getroot()
    above = {}
    for joint in root.findall("joint"):
        child, parent = joint.find("child"), joint.find("parent")
        assert child is not None
        assert parent is not None
        above[child.get("link", "")] = (parent.get("link", ""), joint.get("type") != "fixed")

    def length(link: str) -> tuple[int, int]:
        moving = count = 0
        while link in above:
            link, moves = above[link]
            moving, count = moving + moves, count + 1
        return moving, count

    links = [element.get("name", "") for element in root.findall("link")]
    return max(reversed(links), key=length, default="")


def test_they_are_all_there() -> None:
    assert len(FILES) > 60
    assert len(REFUSED) <= 6
    assert set(REFUSED) <= {file.name for file in FILES}


@pytest.mark.parametrize("file", FILES, ids=[str(file.relative_to(ROBOTS)) for file in FILES])
def test_it_is_read_or_refused_for_what_it_is(file: Path) -> None:
    if file.name in REFUSED:
        with pytest.raises(RobotError, match=REFUSED[file.name]) as caught:
            urdf.read(file, longest(file))
        assert "\n" not in str(caught.value)
        return
    got = urdf.read(file, longest(file))
    assert len(got.joints) >= 1
    _require_what_was_checked(got.for_drake[0])


def _require_what_was_checked(xml: str) -> None:
    """Drake replaces in silence what it takes for impossible: it has every mass and moment as they are written here."""
    plant = MultibodyPlant(0.0)
    parser = Parser(plant)
    parser.AddModelsFromString(xml, "urdf")
    plant.Finalize()
    for link in ET.fromstring(xml).findall("link"):
        mass, inertia = link.find("inertial/mass"), link.find("inertial/inertia")
        body = plant.GetBodyByName(link.get("name", ""))
        if mass is None or inertia is None:
            assert body.default_mass() == 0.0
            continue
        assert body.default_mass() == float(mass.get("value", "nan"))
        about = body.default_spatial_inertia().Shift(body.default_com()).CalcRotationalInertia().CopyToFullMatrix3()
        stated = sum(float(inertia.get(key, "nan")) for key in ("ixx", "iyy", "izz"))
        assert np.trace(about) == pytest.approx(stated, rel=1e-9, abs=1e-12)
