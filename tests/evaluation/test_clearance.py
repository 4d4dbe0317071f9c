"""The evaluation's clearance, against distances of segments and against the solver's, which shares no code with it."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from pipeline.evaluation.clearance import Clearance
from pipeline.model import clearance as solver
from pipeline.model.arm import Arm
from pipeline.model.coordinates import PLANE, SPACE
from pipeline.model.floating import Floating
from pipeline.model.obstacles import Obstacles
from pipeline.robot.mounting import Mounting
from pipeline.robot.shapes import Shape
from pipeline.robot.spacecraft import Spacecraft
from tests.support import BALL, BOX, ROBOTS, ROD, segment_distances, with_shapes, within_limits

AMONG = Obstacles((BALL, ROD, BOX, Shape("near", "sphere", (0.04,), (0.3, 0.15, 0.2))), 0.02)


@pytest.mark.parametrize("name", ["planar4r", "panda", "xarm7"])
def test_distances_equal_those_of_segments(name: str, rng: np.random.Generator) -> None:
    arm = with_shapes(name)
    q = within_limits(arm, 5, rng)
    distances = Clearance(arm, Obstacles((BALL, ROD), 0.02))(q)
    np.testing.assert_allclose(distances, segment_distances(arm, (BALL, ROD), q), atol=1e-6)


@pytest.mark.parametrize("floats", [False, True], ids=["fixed", "floating"])
@pytest.mark.parametrize("name", ROBOTS)
def test_the_solver_measures_the_same(name: str, floats: bool, rng: np.random.Generator) -> None:
    """Placed and turned, with a tool and a payload; on a base that floats the root link's solids count too."""
    description = with_shapes(name).description
    mounting = Mounting((0.1, 0.0, 0.0), base_position=(0.1, -0.05, 0.2), base_rpy=(0.1, 0.2, 0.3), payload=0.5)
    craft = Spacecraft(20.0, ((1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0)))
    coordinates = SPACE if len(description.joints) > 4 else PLANE
    arm = Arm(description, mounting, Floating(craft, coordinates)) if floats else Arm(description, mounting)
    joints = within_limits(arm.on_fixed_base, 60, rng)
    q = np.hstack([rng.uniform(-0.5, 0.5, size=(60, arm.base.count)), joints])
    ours, measured = Clearance(arm, AMONG)(q), solver.Clearance(arm, AMONG)
    theirs = [close.distance for one in q for close in measured.closest(one)]
    # Drake's distances of capsules and boxes come from an iteration, which stops short of the least one.
    assert (ours <= np.array(theirs) + 1e-9).all()
    np.testing.assert_allclose(ours, theirs, atol=1e-4)
    assert ours.min() < 0 < ours.max(), "nothing collides or all does: the test shows nothing"


def test_nothing_to_keep_clear_of(rng: np.random.Generator) -> None:
    arm = with_shapes("panda")
    q = within_limits(arm, 3, rng)
    assert np.all(np.isinf(Clearance(arm, None)(q)))
    standing = tuple(shape for shape in arm.description.collision if shape.frame == arm.description.base)
    assert standing
    assert np.all(np.isinf(Clearance(Arm(replace(arm.description, collision=standing)), AMONG)(q)))


def test_values_that_are_not_finite(rng: np.random.Generator) -> None:
    arm = with_shapes("panda")
    q = within_limits(arm, 3, rng)
    q[1, 2] = np.nan
    np.testing.assert_array_equal(np.isnan(Clearance(arm, AMONG)(q)), [False, True, False])
