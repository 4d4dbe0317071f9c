"""Rounded corners: how far they are off, that they are smooth, and that they leave room for each other."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from pipeline.path.blend import Blended
from pipeline.path.through import through

SQUARE = np.array([[0, 0], [0.1, 0], [0.1, 0.1], [0, 0.1], [0, 0]], dtype=float)


@pytest.mark.slow
@given(st.floats(0.05, 2.9), st.sampled_from([0.001, 0.005, 0.02]))
def test_the_deviation_at_a_corner_is_the_one_asked_for(turn: float, blend: float) -> None:
    """Measured on a fine grid, from the corner itself."""
    corner = np.array([9.0, 0.0])
    points = np.array([np.zeros(2), corner, corner + 9.0 * np.array([np.cos(turn), np.sin(turn)])])
    curve = Blended(points, blend)
    s = curve.marks[1] + np.linspace(-0.01, 0.01, 501) * blend
    assert np.linalg.norm(curve.sample(s)[0] - corner, axis=1).min() == pytest.approx(blend, rel=1e-6)
    assert curve.closer == ()


def test_tangent_and_curvature_are_continuous_and_derivatives_of_the_curve() -> None:
    curve, h = Blended(SQUARE, 0.005), 1e-6
    s = np.linspace(1e-3, curve.length - 1e-3, 5001)
    _, tangent, curvature = curve.sample(s)
    ahead, behind = curve.sample(s + h), curve.sample(s - h)
    np.testing.assert_allclose((ahead[0] - behind[0]) / (2 * h), tangent, atol=1e-8)
    np.testing.assert_allclose(np.linalg.norm(tangent, axis=1), 1.0, atol=1e-12)
    np.testing.assert_allclose((ahead[1] - behind[1]) / (2 * h), curvature, atol=1e-3)
    assert np.abs(np.diff(curvature, axis=0)).max() < 0.05 * np.abs(curvature).max()  # an arc: 1
    assert np.linalg.norm(curvature, axis=1).max() == pytest.approx(88.0, rel=0.01)  # of the arc: 83


def test_legs_that_are_too_short_keep_the_curve_closer() -> None:
    curve = Blended(SQUARE, 0.03)
    assert curve.closer == (1, 2, 3)
    off = np.linalg.norm(curve.sample(curve.marks[1:-1])[0] - SQUARE[1:-1], axis=1)
    np.testing.assert_allclose(off, off[0], rtol=1e-9)
    assert off[0] < 0.03


def test_straight_on_and_back() -> None:
    """A way-point on a side is none to round; where the path turns back it stops."""
    straight = Blended(np.array([[0.0, 0.0], [0.1, 0.0], [0.3, 0.0]]), 0.005)
    assert straight.length == pytest.approx(0.3)
    np.testing.assert_allclose(straight.marks, [0.0, 0.1, 0.3], atol=1e-12)
    found = through(np.array([[0.0, 0.0], [0.1, 0.0], [0.1, 0.1], [0.1, 0.0]]), None, blend=0.005)
    assert found.stops == (2,)
    assert found.departure[0] == pytest.approx(0.005 / np.sqrt(2), rel=1e-6)
