"""Distances of convex solids by Wolfe's algorithm, against coal and against what can be drawn on paper."""

from __future__ import annotations

import coal
import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from pipeline.common.arrays import Array
from pipeline.robot.separation import Solid, along, distance
from pipeline.robot.shapes import Shape
from tests.coal_solids import hull
from tests.support import robot

ACROSS = Rotation.from_euler("x", 90, degrees=True).as_matrix()
CYLINDER, ROD = (Solid.of(Shape("s", kind, (0.1, 0.4), (0.0, 0.0, 0.0))) for kind in ("cylinder", "capsule"))


def test_hulls_against_coal(rng: np.random.Generator) -> None:
    """Where they are apart the two bounds meet at coal's distance; no direction shows more."""
    solids = [Solid.of(shape) for shape in robot("panda").description.collision if shape.kind == "mesh"]
    theirs = [hull(solid.points) for solid in solids]
    apart = 0
    for turn in Rotation.random(60, rng=rng):
        i, j = rng.integers(len(solids), size=2)
        place, result = rng.normal(scale=0.2, size=3), coal.DistanceResult()
        low, high = distance(solids[i], other := solids[j].moved(turn.as_matrix(), place))
        there = coal.Transform3s(turn.as_matrix(), place)
        true = coal.distance(theirs[i], coal.Transform3s(), theirs[j], there, coal.DistanceRequest(True), result)
        if true <= 0:
            assert high <= 0
            continue
        apart += 1
        assert high - low < 1e-8
        assert low == pytest.approx(true, abs=2e-6)
        n = rng.normal(size=3)
        assert along(solids[i], other, n / np.linalg.norm(n)) <= true + 1e-6
    assert apart > 20


@pytest.mark.parametrize(
    ("first", "second", "turn", "place", "true"),
    [
        (CYLINDER, CYLINDER, np.eye(3), (0.5, 0.0, 0.0), 0.3),
        (CYLINDER, CYLINDER, np.eye(3), (0.0, 0.0, 1.0), 0.6),
        (CYLINDER, CYLINDER, ACROSS, (0.0, 0.9, 0.0), 0.6),
        (ROD, ROD, np.eye(3), (0.0, 0.0, 1.0), 0.4),
        (ROD, CYLINDER, ACROSS, (0.5, 0.0, 0.0), 0.3),
    ],
)
def test_round_solids(first: Solid, second: Solid, turn: Array, place: tuple[float, ...], true: float) -> None:
    np.testing.assert_allclose(distance(first, second.moved(turn, np.array(place))), true, atol=1e-9)


def test_capsules_whose_ends_meet() -> None:
    """Drake never comes back from these."""
    low, high = distance(ROD, ROD.moved(ACROSS, np.array([0.0, -0.2, 0.2])))
    assert low == high == pytest.approx(-0.2)
