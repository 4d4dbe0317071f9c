"""Which inertias are taken, mended or summed up, against matrices by hand and Drake's own sums."""

from __future__ import annotations

import re
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from pydrake.multibody.parsing import Parser
from pydrake.multibody.plant import MultibodyPlant
from scipy.spatial.transform import Rotation

from pipeline.common.errors import RobotError
from pipeline.model.arm import Arm
from pipeline.robot import formats, urdf
from pipeline.robot.inertia import combined, nearest
from pipeline.robot.tree import Inertial
from tests.robot.test_urdf import ROBOT, joint, link


@pytest.fixture
def write(tmp_path: Path) -> Callable[[str], Path]:
    def to_file(text: str) -> Path:
        (tmp_path / "robot.urdf").write_text(text)
        return tmp_path / "robot.urdf"

    return to_file


def test_the_nearest_possible_inertia() -> None:
    """diag(0.01, 0.01, 0.5) has second moments 0.25, 0.25 and -0.24; without the last one, diag(0.25, 0.25, 0.5)."""
    mended = nearest(Inertial(2.0, (1.0, 2.0, 3.0), moments=(0.01, 0.01, 0.5, 0.0, 0.0, 0.0)))
    np.testing.assert_allclose(mended.moments, (0.25, 0.25, 0.5, 0.0, 0.0, 0.0), atol=1e-15)
    assert (mended.mass, mended.com) == (2.0, (1.0, 2.0, 3.0))
    possible = Inertial(1.0, moments=(0.01, 0.012, 0.015, 0.001, 0.0, 0.002))
    np.testing.assert_allclose(nearest(possible).moments, possible.moments, atol=1e-17)


def test_a_rigid_group_weighs_what_drake_says(write: Callable[[str], Path]) -> None:
    """All joints fixed: the whole robot is one body."""
    text = ROBOT
    for kind in ("revolute", "prismatic", "continuous"):
        text = text.replace(f'type="{kind}"', 'type="fixed"')
    tree = formats.load(write(text), "hand")
    ours = combined(tree, tree.group("base", set()))
    plant = MultibodyPlant(0.0)
    Parser(plant).AddModelsFromString(re.sub(r"<(visual|transmission)\b.*?</\1>", "", text), "urdf")
    plant.Finalize()
    bodies = [plant.GetBodyByName(name) for name in tree.links]
    frame = plant.GetFrameByName("base")
    theirs = plant.CalcSpatialInertia(plant.CreateDefaultContext(), frame, [body.index() for body in bodies])
    about = theirs.Shift(theirs.get_com()).CalcRotationalInertia().CopyToFullMatrix3()
    assert ours.mass == pytest.approx(theirs.get_mass())
    np.testing.assert_allclose(ours.com, theirs.get_com(), atol=1e-14)
    np.testing.assert_allclose(ours.matrix, about, atol=1e-13)


BAD = 'ixx="0.01" iyy="0.012" izz="0.05"'
GOOD = 'ixx="0.01" iyy="0.012" izz="0.015"'


def test_repair_is_asked_for_and_reported(write: Callable[[str], Path]) -> None:
    file = write(ROBOT.replace(GOOD, BAD, 1))
    with pytest.raises(
        RobotError, match=r"link 'upper' has an inertia that no body has .* robot\.repair_inertia=true$"
    ):
        urdf.read(file, "hand")
    mended = urdf.read(file, "hand", repair_inertia=True)
    assert any(note.startswith("robot.repair_inertia: link upper has the principal moments") for note in mended.notes)
    assert not urdf.read(write(ROBOT), "hand", repair_inertia=True).notes


def test_what_one_link_cannot_have_a_heavier_one_may_carry(write: Callable[[str], Path]) -> None:
    """A foot of a milligram, with the mass matrix of the sum as stated."""
    foot = (
        '<link name="foot"><inertial><mass value="1e-6"/>'
        '<inertia ixx="1e-6" ixy="1e-6" ixz="1e-6" iyy="1e-6" iyz="1e-6" izz="1e-6"/></inertial></link>'
    )
    bolted = ROBOT.replace("</robot>", foot + joint("ankle", "hand", "foot", "fixed") + "</robot>")
    described = urdf.read(write(bolted), "foot")
    (note,) = described.notes
    assert note.startswith("foot: no body alone has that inertia; hand has the sum")
    q = np.array([[0.7, 0.15, -1.2, 2.1]])
    masses = [Arm(urdf.read(write(text), "hand")).mass_matrix(q)[0] for text in (bolted, ROBOT)]
    # The wrist turns about x of the hand's frame: e' I e of the foot's stated moments there, and its lever.
    axis = Rotation.from_euler("xyz", (0.4, -0.3, 0.8)).inv().apply([1.0, 0.0, 0.0])
    lever = np.cross([1.0, 0.0, 0.0], [0.3, 0.1, 0.2])
    added = axis @ (1e-6 * np.ones((3, 3))) @ axis + 1e-6 * lever @ lever
    assert (masses[0] - masses[1])[3, 3] == pytest.approx(added, rel=1e-6)
    heavy = bolted.replace("1e-6", "1")
    with pytest.raises(RobotError, match="link 'foot' has an inertia that no body has"):
        urdf.read(write(heavy.replace('mass value="1"', 'mass value="1e-3"')), "foot")


def test_the_root_counts_where_it_floats(write: Callable[[str], Path]) -> None:
    root = '<link name="base"/>'
    bad = link("base").replace(GOOD, BAD)
    described = urdf.read(write(ROBOT.replace(root, bad)), "hand")
    with pytest.raises(RobotError, match="link 'base' has an inertia that no body has"):
        urdf.check_root(described)
    urdf.check_root(urdf.read(write(ROBOT.replace(root, link("base"))), "hand"))
    bolted = ROBOT.replace(root, link("base") + link("box", 0.1).replace(GOOD, BAD.replace("0.05", "5")))
    described = urdf.read(
        write(bolted.replace("</robot>", joint("bolts", "base", "box", "fixed") + "</robot>")), "hand"
    )
    with pytest.raises(RobotError, match="link 'box' has an inertia that no body has"):
        urdf.check_root(described)


def test_moments_without_a_mass(write: Callable[[str], Path]) -> None:
    with pytest.raises(RobotError, match="link 'upper' has moments of inertia and no mass"):
        urdf.read(write(ROBOT.replace('mass value="1.0"', 'mass value="0"', 1)), "hand")
