from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from pipeline.build.problem import prepare
from pipeline.common.arrays import Array
from pipeline.common.errors import ConfigError
from pipeline.evaluation.evaluation import evaluate
from pipeline.methods.global_planner.planner import global_planner
from pipeline.model.arm import Arm
from pipeline.model.clearance import Clearance, Obstacles
from pipeline.problem.problem import Problem
from pipeline.problem.solution import Solution, Status, Trajectory
from pipeline.robot.shapes import Shape, capsule, link_shapes
from tests.support import ROBOTS, composed, robot, within_limits

BALL = Shape("ball", "sphere", (0.06,), (0.25, 0.2, 0.3))
ROD = capsule("rod", np.array([-0.4, 0.3, 0.1]), np.array([-0.2, 0.5, 0.7]), 0.04)
BOX = Shape("box", "box", (0.2, 0.1, 0.3), (0.1, -0.4, 0.4), (0.3, 0.2, -0.5))


def with_shapes(name: str) -> Arm:
    """planar3r has no shapes of its own: capsules along its links."""
    arm = robot(name)
    if arm.description.collision:
        return arm
    rods = [
        capsule(f"r{i}", np.zeros(3), np.array([length, 0, 0]), 0.02, f"link{i}")
        for i, length in ((1, 0.25), (2, 0.25), (3, 0.3))
    ]
    links = [link for link in arm.description.links if link != arm.description.base]
    rods = [replace(rod, frame=link) for rod, link in zip(rods, links, strict=False)]
    return Arm(replace(arm.description, collision=tuple(rods)))


def ends(shape: Shape, position: Array, rotation: Array) -> Array:
    """The segment (2, 3) that a sphere or capsule surrounds, in the world."""
    half = np.array([0, 0, (shape.size[1] if shape.kind == "capsule" else 0.0) / 2])
    inner = Rotation.from_rotvec(shape.rotation)
    own = [np.array(shape.position) + inner.apply(sign * half) for sign in (-1, 1)]
    return np.array([position + rotation @ point for point in own])


def between_segments(a: Array, b: Array) -> float:
    """By brute force, refined: no closed form to get wrong."""
    s = t = 0.5
    width = 0.5
    for _ in range(40):
        grid = np.linspace(-width, width, 9)
        u, v = np.clip(s + grid, 0, 1)[:, None], np.clip(t + grid, 0, 1)[None, :]
        points = (a[0] + u[..., None] * (a[1] - a[0])) - (b[0] + v[..., None] * (b[1] - b[0]))
        distance = np.linalg.norm(points, axis=2)
        i, j = np.unravel_index(np.argmin(distance), distance.shape)
        s, t, width = float(u[i, 0]), float(v[0, j]), width * 0.6
    return float(distance.min())


@pytest.mark.parametrize("name", ["planar4r", "panda", "xarm7"])
def test_distances_equal_those_of_segments(name: str, rng: np.random.Generator) -> None:
    arm = with_shapes(name)
    clearance = Clearance(arm, Obstacles((BALL, ROD), 0.02))
    frames = {
        s.frame: Arm.from_urdf(arm.description.file, str(s.frame))
        for s in arm.description.collision
        if s.frame != arm.description.base and s.frame in reachable(arm)
    }
    for q in within_limits(arm, 5, rng):
        best = np.inf
        for shape in arm.description.collision:
            if shape.frame not in frames:
                continue
            frame = frames[shape.frame]
            position, rotation = (value[0] for value in frame.pose(q[None, : frame.n]))
            mine = ends(shape, position, rotation)
            for other in (BALL, ROD):
                gap = between_segments(mine, ends(other, np.zeros(3), np.eye(3)))
                best = min(best, gap - shape.size[0] - other.size[0])
        assert clearance.closest(q)[0] == pytest.approx(best, abs=2e-5)


def reachable(arm: Arm) -> set[str]:
    """Links whose place depends on the chain's joints alone, with at least one of them."""
    found = set()
    for link in arm.description.links:
        try:
            if (
                Arm.from_urdf(arm.description.file, link).description.joints
                == arm.description.joints[: Arm.from_urdf(arm.description.file, link).n]
            ):
                found.add(link)
        except ValueError:
            continue
    return found


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
    rows = Clearance(arm, obstacles).rows()
    q = within_limits(arm, 100, rng)
    value, gradient = rows(q)
    smallest = Clearance(arm, obstacles).smallest(q)
    assert (value[smallest < obstacles.margin] > rows.UPPER).all()
    assert (smallest[value <= rows.UPPER] >= obstacles.margin - 1e-9).all()
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


def test_the_planner_keeps_its_clearance_between_knots_too() -> None:
    free = replace(line(0.03), obstacles=None)
    there = line(0.03)
    without = global_planner(free)[0]
    assert evaluate(there, without).clearance_between < 0.02, "the ball is not in the way: the test shows nothing"
    best = evaluate(there, global_planner(there)[0])
    assert best.status is Status.SOLVED
    assert best.clearance.min() >= 0.03 - 1e-9
    assert best.clearance_between >= 0.03 - 1e-9
    assert best.energy_integral[-1] > evaluate(free, without).energy_integral[-1]


def test_a_motion_that_breaks_a_promised_clearance_is_unconfirmed() -> None:
    there = line(0.03)
    through = global_planner(replace(there, obstacles=None))[0]
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


def test_an_obstacle_on_the_path_is_named() -> None:
    blocked = composed(
        "robot=planar4r",
        "path.length=0.3",
        "path.direction=170",
        "timing.duration=2",
        "timing.steps=12",
        "method.global.optimised=4",
        "+obstacles.shapes.wall={kind: box, center: [0.563, 0.24, 0.0], size: [0.04, 0.04, 0.1]}",
        "obstacles.margin=0.01",
    )
    solution = global_planner(prepare(blocked), blocked.method.global_)[0]
    assert not solution.found
    assert "clearance limit of link" in solution.message
    assert "from wall (0.01 m) cannot be met" in solution.message


def test_no_shapes_no_obstacles() -> None:
    with pytest.raises(ConfigError, match="has no primitive collision shapes"):
        prepare(composed("+obstacles.shapes.ball={kind: sphere}", "robot=planar3r"))
    with pytest.raises(ConfigError, match=r"robot\.collision\.link9: no such link; did you mean link"):
        prepare(composed("robot=planar4r", "robot.collision={link9: [{kind: sphere}]}"))


def test_shapes_of_a_description() -> None:
    import xml.etree.ElementTree as ET

    root = ET.fromstring(
        '<robot><link name="a"><collision><geometry><sphere radius="0.1"/></geometry></collision>'
        '<collision><origin xyz="1 2 3" rpy="0 0 1.5"/><geometry><cylinder radius="0.2" length="0.5"/></geometry></collision></link>'
        '<link name="b"><collision><geometry><box size="1 2 3"/></geometry></collision>'
        '<collision><geometry><mesh filename="x.stl"/></geometry></collision></link></robot>'
    )
    shapes, meshes = link_shapes(root)
    assert [(s.frame, s.kind, s.size) for s in shapes] == [
        ("a", "sphere", (0.1,)),
        ("a", "capsule", (0.2, 0.5)),
        ("b", "box", (1.0, 2.0, 3.0)),
    ]
    assert shapes[1].position == (1.0, 2.0, 3.0)
    np.testing.assert_allclose(shapes[1].rotation, (0, 0, 1.5))
    assert meshes == ["b"]
