"""Solids in pictures: as large as they are, where they are, half spaces as a plate, the tool where its link is."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace
from typing import Any, cast

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from pipeline.artifacts import scene
from pipeline.artifacts.figures import solids
from pipeline.artifacts.page import content
from pipeline.artifacts.recording.solids import solid
from pipeline.common.arrays import Array
from pipeline.evaluation.evaluation import Evaluation
from pipeline.model.arm import Arm
from pipeline.model.floating import Floating
from pipeline.model.places import Places
from pipeline.problem.problem import Problem
from pipeline.robot.mounting import Mounting
from pipeline.robot.shapes import SLAB, Shape
from pipeline.robot.spacecraft import Spacecraft
from pipeline.robot.tool import with_tool
from tests.support import BALL, BOX, ROD, robot

TURN = (0.3, -0.2, 0.5)
DRUM = Shape("drum", "cylinder", (0.1, 0.3), (0.5, 0.3, 0.2), TURN)


def volume(corners: Array, faces: list[list[int]]) -> float:
    """Of a solid by its faces, each in turn about its outer normal or against it."""
    middle, total = corners.mean(axis=0), 0.0
    for face in faces:
        own = corners[face] - middle
        fans = [np.linalg.det([own[0], own[i], own[i + 1]]) / 6 for i in range(1, len(face) - 1)]
        assert min(fans) * max(fans) >= 0.0, "its corners are not in turn"
        total += abs(sum(fans))
    return total


@pytest.mark.parametrize(
    ("shape", "faces", "size"),
    [(BOX, 6, 0.006), (DRUM, 26, 0.0094), (replace(BOX, kind="half_space"), 6, 0.006)],
    ids=["box", "drum", "plate"],
)
def test_the_page_draws_faces(shape: Shape, faces: int, size: float) -> None:
    made = content._solid(shape)
    corners = np.array(made["corners"])
    assert len(made["faces"]) == faces
    assert volume(corners, made["faces"]) == pytest.approx(size, rel=0.02)
    np.testing.assert_allclose(np.ptp(corners, axis=0), np.ptp(solids.surface(shape), axis=0), rtol=0.02)
    assert made.get("ground", False) is (shape.kind == "half_space")


def test_rods_and_balls_are_round_on_the_page() -> None:
    assert content._solid(BALL)["ends"] == [list(BALL.position)] * 2
    rod = content._solid(ROD)
    np.testing.assert_allclose(sorted(rod["ends"]), sorted([[-0.4, 0.3, 0.1], [-0.2, 0.5, 0.7]]), atol=1e-12)
    assert rod["radius"] == 0.04


def test_half_spaces_are_plates_beside_what_is_seen() -> None:
    slope = Shape("slope", "half_space", SLAB, (5.0, 5.0, -1.0), (0.4, 0.0, 0.0))
    problem = cast(Problem, SimpleNamespace(obstacles=SimpleNamespace(shapes=(BALL, slope))))
    points = np.array([[0.0, 0.0, 0.5], [1.0, 0.4, 0.2], [np.nan, 0.0, 0.0]])
    ball, plate = scene.around(problem, points)
    assert ball == BALL
    turn = Rotation.from_rotvec(slope.rotation)
    inside = turn.inv().apply(np.vstack([points[:2], BALL.position]) - plate.position)
    assert (np.abs(inside[:, :2]) < np.array(plate.size[:2]) / 2).all()
    assert plate.size[0] < 20
    top = plate.placed(np.array([[0.0, 0.0, 0.0]]))[0] - slope.position
    assert float(top @ turn.apply([0.0, 0.0, 1.0])) == pytest.approx(0.0, abs=1e-12)
    drawn: Any = solid(plate, (0, 0, 0, 255))
    middle = np.array(drawn.centers.as_arrow_array().to_pylist()[0])
    np.testing.assert_allclose(middle, plate.placed(np.array([[0.0, 0.0, -plate.size[2] / 2]]))[0], atol=1e-6)
    above = replace(slope, rotation=(0.0, 0.0, 0.0))
    assert solids.below(above)
    assert not solids.below(above, (0, 2))


@pytest.mark.parametrize("floats", [False, True])
def test_the_tool_is_where_its_link_is(floats: bool, rng: np.random.Generator) -> None:
    """On a base that floats too: as if the arm stood where that is."""
    held = Shape("bar", "box", (0.1, 0.02, 0.02), (0.05, 0.0, 0.0))
    description, start = with_tool(robot("planar3r").description, [held]), Mounting(base_rpy=(0.1, 0.2, 0.3))
    arm = (
        Arm(description, start, Floating(Spacecraft(20.0, ((1.0, 0, 0), (0, 1.0, 0), (0, 0, 1.0)))))
        if floats
        else (Arm(description, start))
    )
    q, turns = rng.normal(size=(2, 3)), rng.normal(size=(2, 3))
    base = SimpleNamespace(position=rng.normal(size=(2, 3)), rotation=Rotation.from_rotvec(turns).as_matrix())
    e = cast(Evaluation, SimpleNamespace(q=q, base=base))
    rotation, position = scene.tool_poses(arm, e, np.array([1]))
    rpy = tuple(Rotation.from_rotvec(turns[1]).as_euler("xyz").tolist())
    there = Mounting(base_position=tuple(base.position[1].tolist()), base_rpy=rpy) if floats else start
    wanted = Places(Arm(description, there))(q[1])["tool"]
    np.testing.assert_allclose(rotation[0], wanted[0], atol=1e-12)
    np.testing.assert_allclose(position[0], wanted[1], atol=1e-12)
    (bar,) = scene.carried(arm, e, np.array([1]))
    middle = wanted[0] @ np.array([0.05, 0.0, 0.0]) + wanted[1]
    np.testing.assert_allclose(bar.position, middle, atol=1e-12)
