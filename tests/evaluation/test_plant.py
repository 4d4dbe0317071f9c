"""The evaluation's own plant: the momentum that a base's velocities make, by Drake's sum over all bodies."""

from __future__ import annotations

import numpy as np
import pytest

from pipeline.evaluation.plant import SinglePlant
from pipeline.model.arm import Arm
from pipeline.model.coordinates import PLANE, SPACE, Coordinates
from pipeline.model.floating import Floating
from pipeline.model.task import PositionTask
from pipeline.robot.mounting import Mounting
from pipeline.robot.spacecraft import Spacecraft
from tests.support import robot, within_limits

PLACED = Mounting(base_position=(1.0, -2.0, 0.5), base_rpy=(0.3, -0.4, 0.5), payload=0.7)
CASES = {
    "panda": (PLACED, SPACE, (0.4, -0.3, 0.2, 0.05, -0.08, 0.1)),
    "planar3r": (Mounting(base_rpy=(0.0, 0.0, 0.7)), PLANE, (0.1, 0.2, 0.0, 0.0, 0.0, 0.05)),
}


@pytest.mark.parametrize("name", CASES)
def test_a_base_that_drifts_has_the_momentum_it_was_given(name: str, rng: np.random.Generator) -> None:
    """Linear, and angular about the place where the root link starts; with joints that stand and joints that move."""
    mounting, coordinates, momentum = CASES[name]
    arm = _floating(name, mounting, coordinates, momentum)
    plant, count = SinglePlant(arm), arm.base.count
    for joints in within_limits(arm.on_fixed_base, 4, rng):
        q, moving = np.concatenate([rng.uniform(-0.8, 0.8, count), joints]), rng.normal(size=len(joints))
        for rates in (np.zeros(len(joints)), moving):
            plant.at(q, np.zeros(arm.n))
            plant.at(q, plant.motion_map() @ rates + plant.drift())
            found = plant.plant.CalcSpatialMomentumInWorldAboutPoint(plant.context, np.array(mounting.base_position))
            np.testing.assert_allclose(
                np.concatenate([found.translational(), found.rotational()]), momentum, atol=1e-10
            )


@pytest.mark.parametrize("axes", [("x", "y", "z"), ("x", "z")])
def test_the_pace_of_the_tool_is_that_of_its_place(axes: tuple[str, ...], rng: np.random.Generator) -> None:
    """Central differences of where it is along q(t) = q + qd t + qdd t^2 / 2."""
    arm, h = robot("panda", base_rpy=(0.3, -0.4, 0.5)), 1e-4
    task, plant = PositionTask(arm, axes), SinglePlant(arm)
    q, qd, qdd = within_limits(arm, 1, rng)[0], rng.normal(size=7), rng.normal(size=7)
    places = []
    for t in (-h, 0.0, h):
        plant.at(q + qd * t + qdd * t**2 / 2, qd)
        places.append(plant.tip()[task.rows])
    plant.at(q, qd)
    speed, acceleration = plant.pace(task, qdd)
    assert speed == pytest.approx(np.linalg.norm(places[2] - places[0]) / (2 * h), rel=1e-6)
    assert acceleration == pytest.approx(np.linalg.norm(places[2] - 2 * places[1] + places[0]) / h**2, rel=1e-5)


def _floating(name: str, mounting: Mounting, coordinates: Coordinates, momentum: tuple[float, ...]) -> Arm:
    craft = Spacecraft(12.0, ((0.9, 0.0, 0.0), (0.0, 0.8, 0.0), (0.0, 0.0, 0.7)), (0.05, -0.02, 0.0), momentum)
    return Arm(robot(name).description, mounting, Floating(craft, coordinates))
