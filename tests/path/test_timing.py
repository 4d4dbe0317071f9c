"""Laws with stops, and laws from time stamps."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from pipeline.common.arrays import Array
from pipeline.path.timing import Cruise, Feeds, Quintic, RaisedCosine, Stamped, Timing, WithStops


def knots() -> st.SearchStrategy[tuple[Array, Array]]:
    """Increasing times from 0, and fractions from 0 to 1 that may stand still between."""
    row = st.tuples(st.floats(0.05, 3.0), st.floats(0.0, 1.0))
    return st.lists(row, min_size=1, max_size=8).map(_cumulated)


def _cumulated(rows: list[tuple[float, float]]) -> tuple[Array, Array]:
    steps = np.array(rows)
    steps[0, 1] = max(steps[0, 1], 0.1)
    return tuple(np.concatenate([[0.0], np.cumsum(part)]) for part in (steps[:, 0], steps[:, 1] / steps[:, 1].sum()))  # type: ignore[return-value]


@given(knots())
def test_time_stamps_are_met_without_running_backwards(rows: tuple[Array, Array]) -> None:
    times, fractions = rows
    law = Stamped(tuple(times.tolist()), tuple(fractions.tolist()))
    assert law.duration == times[-1]
    np.testing.assert_allclose(law.sample(times, 2.0)[0], 2.0 * fractions, atol=1e-12)
    t = np.linspace(0.0, times[-1], 2001)
    s, sd, _ = law.sample(t, 2.0)
    assert sd.min() >= -1e-11 * sd.max()
    assert np.all(np.diff(s) >= -1e-12)
    np.testing.assert_allclose(sd[[0, -1]], 0.0, atol=1e-12)
    _is_the_derivative(law, t)


def test_time_stamps_rest_at_stops() -> None:
    """Which could be passed at speed, as they are without them."""
    times, fractions = (0.0, 1.0, 2.0, 3.0), (0.0, 0.3, 0.7, 1.0)
    assert Stamped(times, fractions).sample(np.array([1.0, 2.0]), 2.0)[1].min() > 0.5
    np.testing.assert_allclose(Stamped(times, fractions, (1,)).sample(np.array([1.0]), 2.0)[1], 0.0, atol=1e-12)
    assert Stamped(times, fractions, (1,)).sample(np.array([2.0]), 2.0)[1] > 0.5


@given(st.sampled_from([RaisedCosine, Quintic]), st.lists(st.floats(0.05, 0.95), min_size=1, max_size=4, unique=True))
def test_a_law_with_stops_rests_there_and_shares_its_time_by_length(law: type[Timing], stops: list[float]) -> None:
    stops = [stop for i, stop in enumerate(sorted(stops)) if i == 0 or stop - sorted(stops)[i - 1] > 0.01]
    stopping = WithStops(law, 3.0, (0.0, *stops, 1.0))
    s, sd, sdd = stopping.sample(3.0 * np.array([0.0, *stops, 1.0]), 0.5)
    np.testing.assert_allclose(s, 0.5 * np.array([0.0, *stops, 1.0]), atol=1e-12)
    np.testing.assert_allclose(sd, 0.0, atol=1e-9)
    np.testing.assert_allclose(sdd, 0.0, atol=1e-6)
    ends = np.array([0.0, *stops, 1.0])
    middles = 1.5 * (ends[1:] + ends[:-1])
    plain = law(3.0).sample(np.array([1.5]), 0.5)[1][0]
    np.testing.assert_allclose(stopping.sample(middles, 0.5)[1], plain, rtol=1e-9)  # the same speed in all parts


@given(st.floats(0.01, 0.5))
def test_cruise(ramp: float) -> None:
    """Its acceleration is zero where it begins, cruises and ends, and with half the time for each end it is the
    papers' law.
    """
    law, t = Cruise(3.0, ramp), np.linspace(0.0, 3.0, 2001)
    s, sd, sdd = law.sample(np.array([0.0, 3.0 * ramp, 3.0 * (1 - ramp), 3.0]), 2.0)
    speed = 2.0 / (3.0 - 3.0 * ramp)
    np.testing.assert_allclose(s, [0.0, speed * 1.5 * ramp, 2.0 - speed * 1.5 * ramp, 2.0], atol=1e-9)
    np.testing.assert_allclose(sd, [0.0, speed, speed, 0.0], atol=1e-9)
    np.testing.assert_allclose(sdd, 0.0, atol=1e-6)
    assert law.sample(t, 2.0)[1].max() <= speed * (1 + 1e-9)
    _is_the_derivative(law, t)
    for ours, papers in zip(Cruise(3.0, 0.5).sample(t, 2.0), RaisedCosine(3.0).sample(t, 2.0), strict=True):
        np.testing.assert_allclose(ours, papers, atol=1e-9)


def _is_the_derivative(law: Timing, t: Array) -> None:
    h, inner = 1e-6 * law.duration, t[1:-1]
    ahead, behind, now = law.sample(inner + h, 2.0), law.sample(inner - h, 2.0), law.sample(inner, 2.0)
    scale = np.abs(now[1]).max() + 1e-9
    np.testing.assert_allclose((ahead[0] - behind[0]) / (2 * h), now[1], atol=1e-4 * scale)
    top = np.abs(now[2]).max() + 1e-9
    np.testing.assert_allclose((ahead[1] - behind[1]) / (2 * h), now[2], atol=1e-3 * top)


def test_one_feed_is_a_cruise() -> None:
    law = Feeds((0.0, 1.0), (3.0,), (), 0.3)
    t = np.linspace(0.0, law.duration, 101)
    for own, other in zip(law.sample(t, 2.0), Cruise(law.duration, 0.3).sample(t, 2.0), strict=True):
        np.testing.assert_allclose(own, other, atol=1e-12)


def test_feeds_are_reached_and_not_exceeded() -> None:
    """0.2, 0.4 and 0.1 m/s over 0.6, 0.4 and 1 m, with a stop after the second: rises take a tenth of either part."""
    law = Feeds((0.0, 0.3, 0.5, 1.0), (3.0, 1.0, 10.0), (2,), 0.1)
    assert law.duration == pytest.approx(14.0 / 0.9)
    t = np.linspace(0.0, law.duration, 20_001)
    s, sd, _ = law.sample(t, 2.0)
    _is_the_derivative(law, t)
    assert s[[0, -1]] == pytest.approx([0.0, 2.0])
    assert sd.min() >= -1e-12
    for begin, end, speed in ((1.0, 2.9, 0.2), (3.5, 3.9, 0.4), (6.0, 14.0, 0.1)):
        np.testing.assert_allclose(sd[(t > begin) & (t < end)], speed, atol=1e-12)
    assert sd.max() == pytest.approx(0.4)
    rest = 4.0 / 0.9
    assert law.sample(np.array([rest]), 2.0)[0] == pytest.approx(1.0)
    assert law.sample(np.array([rest]), 2.0)[1] == pytest.approx(0.0, abs=1e-12)
    assert law.slowed(2.0).sample(2 * t, 2.0)[1] == pytest.approx(sd / 2)
