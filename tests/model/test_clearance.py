from __future__ import annotations

from dataclasses import replace
from functools import cache

import numpy as np
import pytest

from pipeline.build.problem import prepare
from pipeline.common.arrays import Array
from pipeline.common.errors import ConfigError, RobotError
from pipeline.evaluation.evaluation import evaluate
from pipeline.methods.global_planner.planner import global_planner
from pipeline.model.clearance import Clearance
from pipeline.model.obstacles import Obstacles
from pipeline.model.task import PositionTask
from pipeline.problem.problem import Problem
from pipeline.problem.solution import Solution, Status, Trajectory
from pipeline.robot.shapes import Shape, link_shapes
from tests.support import (
    BALL,
    BOX,
    FEW,
    FEW_STARTS,
    ROBOTS,
    ROD,
    composed,
    segment_distances,
    with_shapes,
    within_limits,
)


def smallest(clearance: Clearance, q: Array) -> Array:
    """The smallest distance (K,) [m] of any kind."""
    return np.array([min(close.distance for close in clearance.closest(one)) for one in q])


@pytest.mark.parametrize("name", ["planar4r", "panda", "xarm7"])
def test_distances_equal_those_of_segments(name: str, rng: np.random.Generator) -> None:
    arm = with_shapes(name)
    clearance, q = Clearance(arm, Obstacles((BALL, ROD), 0.02)), within_limits(arm, 5, rng)
    np.testing.assert_allclose(smallest(clearance, q), segment_distances(arm, (BALL, ROD), q), atol=2e-5)
    margin = clearance.kinds[0].margin
    np.testing.assert_array_equal(clearance.clear(q), smallest(clearance, q) >= margin)


@pytest.mark.parametrize(("solid", "accuracy"), [(BALL, 1e-6), (ROD, 2e-3), (BOX, 2e-3)], ids=["ball", "rod", "box"])
@pytest.mark.parametrize("name", ROBOTS)
def test_the_constraint_and_its_derivative(name: str, solid: Shape, accuracy: float, rng: np.random.Generator) -> None:
    """100 random configurations each: at most 1 where the margin is kept, gradient by central differences.

    Distances from spheres are exact; those between capsules and boxes come from an iteration, and so do their normals.
    """
    arm = with_shapes(name)
    if arm.n < 6:
        solid = replace(solid, position=(0.3, 0.3, 0.0))
    obstacles = Obstacles((solid,), 0.03, 0.2)
    (rows,) = Clearance(arm, obstacles).rows()
    q = within_limits(arm, 100, rng)
    value, gradient = rows(q)
    least = smallest(Clearance(arm, obstacles), q)
    assert (value[least < obstacles.margin] > rows.UPPER).all()
    assert (least[value <= rows.UPPER] >= obstacles.margin - 1e-9).all()
    h = 1e-5
    expected = np.stack([(rows(q + h * e)[0] - rows(q - h * e)[0]) / (2 * h) for e in np.eye(arm.n)], axis=1)
    off = np.abs(gradient - expected).max(axis=1) / np.abs(expected).max()
    # Where the closest point leaps from one side of a solid to another there is no derivative.
    assert (off < accuracy).mean() >= 0.95


def line(margin: float, **changes: str) -> Problem:
    """The planar 4R's path with a ball beside it."""
    overrides = ["robot=planar4r", "path.length=0.3", "path.direction=170", "timing.duration=2", "timing.steps=24"]
    ball = "+obstacles.shapes.ball={kind: sphere, center: [0.69, 0.49, 0.0], radius: 0.04}"
    return prepare(composed(*overrides, ball, f"obstacles.margin={margin}", *[f"{k}={v}" for k, v in changes.items()]))


@cache
def through_the_ball() -> tuple[Problem, Solution]:
    free = replace(line(0.03), obstacles=None)
    return free, global_planner(free, FEW)[0]


@pytest.mark.slow
def test_the_planner_keeps_its_clearance_between_knots_too() -> None:
    there, free, without = line(0.03), *through_the_ball()
    assert evaluate(there, without).clearance_between < 0.02, "the ball is not in the way: the test shows nothing"
    best = evaluate(there, global_planner(there, FEW)[0])
    assert best.status is Status.SOLVED
    assert best.clearance.min() >= 0.03 - 1e-9
    assert best.clearance_between >= 0.03 - 1e-9
    assert best.energy_integral[-1] > evaluate(free, without).energy_integral[-1]


def test_a_motion_that_breaks_a_promised_clearance_is_unconfirmed() -> None:
    there, (_, through) = line(0.03), through_the_ball()
    judged = evaluate(
        there,
        Solution(
            "x", Trajectory(through.trajectory.time, through.trajectory.q), Status.SOLVED, limits_kept=("clearance",)
        ),
    )
    assert judged.status is Status.UNCONFIRMED
    assert "clearance limit is exceeded" in judged.message


def test_a_start_too_close_is_refused() -> None:
    with pytest.raises(
        ConfigError, match=r"robot\.q_init: link\d is .* m from obstacle ball, less than obstacles\.margin = 0\.5 m"
    ):
        line(0.5)


@pytest.mark.slow
def test_an_obstacle_on_the_path_is_named() -> None:
    blocked = composed(
        "robot=planar4r",
        "path.length=0.3",
        "path.direction=170",
        "timing.duration=2",
        "timing.steps=12",
        *FEW_STARTS,
        "method.global.optimised=1",
        "+obstacles.shapes.wall={kind: box, center: [0.563, 0.24, 0.0], size: [0.04, 0.04, 0.1]}",
        "obstacles.margin=0.01",
    )
    problem = prepare(blocked)
    around = replace(problem, task=PositionTask(with_shapes("planar4r"), problem.task.axes))
    solution = global_planner(around, blocked.method.global_)[0]
    assert not solution.found
    assert "clearance limit of link" in solution.message
    assert "from wall (0.01 m); the least violation found is" in solution.message


def test_no_shapes_no_obstacles() -> None:
    with pytest.raises(ConfigError, match="has no collision shapes"):
        prepare(composed("+obstacles.shapes.ball={kind: sphere}", "robot=planar3r"))
    with pytest.raises(ConfigError, match=r"robot\.collision\.link9: no such link; did you mean link"):
        prepare(composed("robot=planar4r", "robot.collision={link9: [{kind: sphere}]}"))


def test_shapes_of_a_description() -> None:
    import xml.etree.ElementTree as ET

    root = ET.fromstring(
        '<robot><link name="a"><collision><geometry><sphere radius="0.1"/></geometry></collision>'
        '<collision><origin xyz="1 2 3" rpy="0 0 1.5"/>'
        '<geometry><cylinder radius="0.2" length="0.5"/></geometry></collision></link>'
        '<link name="b"><collision><geometry><box size="1 2 3"/></geometry></collision>'
        '<collision><geometry><mesh filename="x.stl"/></geometry></collision></link></robot>'
    )
    shapes = link_shapes(root)
    assert [(s.frame, s.kind, s.size) for s in shapes] == [
        ("a", "sphere", (0.1,)),
        ("a", "cylinder", (0.2, 0.5)),
        ("b", "box", (1.0, 2.0, 3.0)),
        ("b", "mesh", (1.0, 1.0, 1.0)),
    ]
    assert shapes[1].position == (1.0, 2.0, 3.0)
    np.testing.assert_allclose(shapes[1].rotation, (0, 0, 1.5))
    with pytest.raises(RobotError, match=r"link 'b': the mesh .*x\.stl was not found"):
        _ = shapes[3].points  # what is not looked at does not matter
