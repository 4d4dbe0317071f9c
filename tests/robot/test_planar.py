"""A planar joint is two that slide and one that turns: against Drake's own planar joint."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from pydrake.multibody.parsing import Parser
from pydrake.multibody.plant import MultibodyPlant

from pipeline.common.arrays import Array
from pipeline.model.arm import Arm
from pipeline.robot import urdf
from tests.robot.test_urdf import joint, link

TURN = joint("turn", "cart", "hand", "continuous", "1 0 0")


def robot(axis: str) -> str:
    drive = joint("drive", "floor", "cart", "planar", axis)
    return f'<robot name="r"><link name="floor"/>{drive}{link("cart")}{TURN}{link("hand")}</robot>'


def test_as_drake_moves_it(tmp_path: Path) -> None:
    text = robot("0 0 1")
    (tmp_path / "robot.urdf").write_text(text)
    arm = Arm(urdf.read(tmp_path / "robot.urdf", "hand"))
    assert arm.description.joints == ("drive_x", "drive_y", "drive_yaw", "turn")
    assert arm.description.revolute.tolist() == [False, False, True, True]
    q = np.array([[0.3, -0.7, 1.1, 0.4]])
    plant = MultibodyPlant(0.0)
    Parser(plant).AddModelsFromString(text.replace("visual", "none"), "urdf")
    plant.WeldFrames(plant.world_frame(), plant.GetFrameByName("floor"))
    plant.Finalize()
    context = plant.CreateDefaultContext()
    plant.SetPositions(context, q[0])
    np.testing.assert_allclose(
        arm.position(q)[0], plant.GetFrameByName("hand").CalcPoseInWorld(context).translation(), atol=1e-14
    )
    np.testing.assert_allclose(arm.mass_matrix(q)[0], plant.CalcMassMatrix(context), atol=1e-13)


@pytest.mark.parametrize("axis", ["0 0 -1", "1 0 0", "0.3 -0.4 0.5"])
def test_it_stays_in_its_plane(tmp_path: Path, axis: str) -> None:
    (tmp_path / "robot.urdf").write_text(robot(axis).replace('<origin xyz="0.3 0.1 0.2" rpy="0.4 -0.3 0.8"/>', ""))
    arm = Arm(urdf.read(tmp_path / "robot.urdf", "cart"))
    normal: Array = np.array(axis.split(), dtype=float)
    normal /= np.linalg.norm(normal)
    jacobian = arm.spatial_jacobian(np.zeros((1, 3)))[0]
    np.testing.assert_allclose(jacobian[:3, 2], normal, atol=1e-15)
    along = jacobian[3:, :2]
    np.testing.assert_allclose(along.T @ along, np.eye(2), atol=1e-15)
    np.testing.assert_allclose(np.cross(along[:, 0], along[:, 1]), normal, atol=1e-15)
