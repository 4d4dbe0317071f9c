"""Way-points: smooth where they move on, at rest where they turn back or on the spot."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from pipeline.common.errors import PathError
from pipeline.path.reference import Reference
from pipeline.path.through import TURN, through
from pipeline.path.timing import RaisedCosine, Stamped, WithStops

SQUARE = np.array([[0, 0, 0], [0.1, 0, 0], [0.1, 0.1, 0], [0, 0.1, 0], [0, 0, 0]], dtype=float)
OUT_AND_BACK = np.array([[0.0, 0.0], [0.1, 0.0], [0.0, 0.0]])


def test_a_smooth_curve_says_how_far_it_leaves_its_polygon() -> None:
    found = through(SQUARE, None)
    s = np.linspace(0.0, found.geometry.length, 4001)
    x = found.geometry.sample(s)[0]
    corners = np.clip(x[:, :2], 0.0, 0.1)  # nearest point of the filled square; inside, of its nearest side
    inside = np.minimum(x[:, :2], 0.1 - x[:, :2]).min(axis=1)
    off = np.where(inside > 0, inside, np.linalg.norm(x[:, :2] - corners, axis=1)).max()
    assert found.departure[0] == pytest.approx(off, rel=2e-3)
    assert found.stops == ()
    assert found.departure[1] in (1, 4)  # as far in the first and in the last
    assert through(np.vstack([SQUARE[:1], SQUARE]), None).departure[1] in (2, 5)  # after a dwell


def test_a_curve_that_swings_over_an_end_leaves_the_polygon_there() -> None:
    """Held against the chord itself, point by point: beyond its end the line that it lies on is nearer."""
    points = np.array([[0.0, 0.0], [0.1, 0.0], [0.02, 0.03]])
    found = through(points, None)
    worst = 0.0
    for i in range(2):
        x = found.geometry.sample(np.linspace(found.marks[i], found.marks[i + 1], 33))[0]
        chord = points[i] + np.linspace(0.0, 1.0, 2001)[:, None] * (points[i + 1] - points[i])
        worst = max(worst, np.linalg.norm(x[:, None] - chord, axis=2).min(axis=1).max())
    assert found.departure[0] == pytest.approx(worst, rel=1e-3)


def test_corners_at_rest_are_straight() -> None:
    found = through(SQUARE, None, rest=True)
    assert found.stops == (1, 2, 3)
    assert found.geometry.length == pytest.approx(0.4)
    assert found.departure[0] < 1e-15
    np.testing.assert_allclose(found.geometry.sample(found.marks)[0], SQUARE, atol=1e-15)


def test_out_and_back_rests_where_it_turns() -> None:
    found = through(OUT_AND_BACK, None)
    assert found.stops == (1,)
    law = WithStops(RaisedCosine, 2.0, (0.0, 0.5, 1.0))
    reference, t = Reference(found.geometry, law), np.linspace(0.0, 2.0, 201)
    x, xd, xdd = reference.sample(t)
    np.testing.assert_allclose(x[[0, 100, 200]], OUT_AND_BACK, atol=1e-15)
    np.testing.assert_allclose(xd[[0, 100, 200]], 0.0, atol=1e-15)
    np.testing.assert_allclose(x, x[::-1], atol=1e-15)
    assert x[:, 0].max() <= 0.1 + 1e-15
    np.testing.assert_allclose(np.gradient(x[:, 0], t)[1:-1], xd[1:-1, 0], atol=2e-3)
    np.testing.assert_allclose(np.gradient(xd[:, 0], t)[1:-1], xdd[1:-1, 0], atol=2e-2)


def test_a_turn_on_the_spot_has_a_length_of_its_own() -> None:
    points = np.array([[0.0, 0, 0], [0.2, 0, 0], [0.2, 0, 0], [0.2, 0.1, 0]])
    turns = Rotation.from_rotvec([[0, 0, 0], [0, 0, 0], [0, 0.7, 0], [0, 0.7, 0]])
    found = through(points, turns)
    assert found.orientation is not None
    assert found.stops == (1, 2)
    np.testing.assert_allclose(found.marks, [0.0, 0.2, 0.2 + 0.7 * TURN, 0.3 + 0.7 * TURN])
    s = np.linspace(0.0, found.geometry.length, 301)
    x, tangent, _ = found.geometry.sample(s)
    turned, spin, _ = found.orientation.sample(s)
    moving, turning = np.linalg.norm(tangent, axis=1), np.linalg.norm(spin, axis=1)
    assert np.all((moving > 0.5) != (turning > 0.5))  # never both, never neither
    np.testing.assert_allclose(turning[turning > 0.5], 1 / TURN, rtol=1e-9)
    np.testing.assert_allclose(x[[0, -1]], points[[0, -1]], atol=1e-15)
    np.testing.assert_allclose(turned[[0, -1]], [[0, 0, 0], [0, 0.7, 0]], atol=1e-12)


def test_a_turn_alone() -> None:
    found = through(np.ones((3, 3)), Rotation.from_rotvec([[0, 0, 0], [0, 0, 1.0], [0, 0, 2.0]]))
    assert found.geometry.length == pytest.approx(2.0 * TURN)
    np.testing.assert_array_equal(found.geometry.sample(np.linspace(0, found.geometry.length, 9))[0], np.ones((9, 3)))


def test_equal_neighbours_are_a_dwell_for_time_stamps() -> None:
    points = np.array([[0.0, 0.0], [0.1, 0.0], [0.1, 0.0], [0.2, 0.1]])
    found = through(points, None)
    assert found.marks[1] == found.marks[2]
    law = Stamped((0.0, 1.0, 3.0, 4.0), tuple((found.marks / found.geometry.length).tolist()), found.stops)
    x, xd, _ = Reference(found.geometry, law).sample(np.array([0.0, 1.0, 2.0, 3.0, 4.0]))
    np.testing.assert_allclose(x, [[0, 0], [0.1, 0], [0.1, 0], [0.1, 0], [0.2, 0.1]], atol=1e-9)
    np.testing.assert_allclose(xd, 0.0, atol=1e-12)


def test_a_curve_that_turns_on_the_spot_is_refused() -> None:
    points = np.array([[0.3, 0.8], [0.2, 0.4], [0.7, 0.9], [0.8, 0.1], [0.9, 0.8]])
    with pytest.raises(PathError, match="turns back on itself between way-points 4 and 5"):
        through(points, None)
    with pytest.raises(PathError, match="between way-points 5 and 6"):  # as the file has them
        through(np.vstack([points[:1], points]), None)
    assert through(points, None, rest=True).stops == (1, 2, 3)
