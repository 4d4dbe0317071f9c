"""Straight and round pieces joined: exact but for corners, which are rounded as asked or stopped at."""

from __future__ import annotations

import numpy as np
import pytest

from pipeline.path.blend import Blended
from pipeline.path.curves import Arc, Line
from pipeline.path.moves import joined

EAST, NORTH = np.eye(2)


def line(start: tuple[float, float], way: np.ndarray, length: float) -> Line:
    return Line(np.array(start), way, length)


def test_a_corner_is_rounded_as_a_polygons() -> None:
    found = joined([line((0, 0), EAST, 0.1), line((0.1, 0), NORTH, 0.08)], 0.005)
    polygon = Blended(np.array([[0, 0], [0.1, 0], [0.1, 0.08]]), 0.005)
    assert found.geometry.length == pytest.approx(polygon.length, rel=1e-10)
    s = np.linspace(0.0, polygon.length, 201)
    for own, other in zip(found.geometry.sample(s), polygon.sample(s), strict=True):
        np.testing.assert_allclose(own, other, atol=1e-6 * np.abs(other).max())
    assert found.departure == (pytest.approx(0.005 / np.sqrt(2), rel=1e-3), 1)
    np.testing.assert_allclose(found.marks, polygon.marks, rtol=1e-9)
    assert found.stops == ()


def test_from_a_line_into_an_arc_curvature_goes_over() -> None:
    """A line that an arc of 20 mm goes on from, and a corner back into a line: tangents and curvatures are continuous,
    and the arc is one but for its ends.
    """
    arc = Arc(np.array([0.1, 0.0]), NORTH, EAST, 0.02, np.pi / 2)
    found = joined([line((0, 0), EAST, 0.1), arc, line((0.12, 0.02), -EAST, 0.05)], 0.002)
    s = np.linspace(0.0, found.geometry.length, 8001)
    x, tangent, curvature = found.geometry.sample(s)
    np.testing.assert_allclose(np.gradient(x, s, axis=0)[1:-1], tangent[1:-1], atol=2e-3)
    assert np.abs(np.diff(curvature, axis=0)).max() < 10.0  # [1/m]: of 50 at the arc's start, and of more at the corner
    radius = np.linalg.norm(x - np.array([0.1, 0.02]), axis=1)
    assert (np.abs(radius - 0.02) < 1e-9).mean() > 0.05
    assert found.departure[0] <= 0.002
    assert found.departure[1] == 2
    assert found.stops == ()
    np.testing.assert_allclose(x[-1], [0.07, 0.02], atol=1e-12)


def test_stops_are_exact_and_a_path_that_turns_back_stops() -> None:
    pieces = [line((0, 0), EAST, 0.1), line((0.1, 0), NORTH, 0.08), line((0.1, 0.08), -NORTH, 0.04)]
    stopped = joined(pieces, None)
    assert (stopped.stops, stopped.departure) == ((1, 2), (0.0, 0))
    np.testing.assert_allclose(stopped.marks, [0.0, 0.1, 0.18, 0.22])
    assert joined(pieces, 0.01).stops == (2,)
    straight = joined([line((0, 0), EAST, 0.1), line((0.1, 0), EAST, 0.1)], 0.01)
    assert straight.geometry.length == pytest.approx(0.2)
    assert (straight.stops, straight.departure[0]) == ((), 0.0)
    short = joined([line((0, 0), EAST, 0.1), line((0.1, 0), NORTH, 0.001)], 0.01)
    assert short.closer == (1,)
