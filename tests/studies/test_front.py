"""Fronts from numbers alone: dominance, knee, hypervolume."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from pipeline.studies import front

costs = st.lists(st.tuples(st.floats(0.1, 1.0), st.floats(0.1, 1.0)), min_size=1, max_size=12)


@given(costs)
def test_dominance_is_what_it_says(points: list[tuple[float, float]]) -> None:
    values = np.array(points)
    found = front.dominated(values)
    assert not found.all()
    slack = front.EQUAL * values.max(axis=0)
    for i, value in enumerate(values):
        others = [o for o in values if (o <= value + slack).all() and (o < value - slack).any()]
        assert found[i] == bool(others)


def test_costs_that_are_equal_to_rounding_do_not_dominate_each_other() -> None:
    assert not front.dominated(np.array([[1.0, 2.0], [1.0 + 1e-9, 2.0 - 1e-9]])).any()
    assert front.dominated(np.array([[1.0, 2.0], [1.01, 2.0]])).tolist() == [False, True]


def test_the_knee_is_where_the_front_bends() -> None:
    values = np.array([[0.0, 1.0], [0.05, 0.4], [0.1, 0.1], [0.5, 0.05], [1.0, 0.0]])
    assert front.knee(values) == 2
    assert front.knee(values * [1e-3, 40.0]) == 2  # whatever the units


def test_hypervolume_of_known_fronts() -> None:
    assert front.hypervolume(np.array([[0.0, 1.0], [1.0, 0.0]])) == 0.0
    assert front.hypervolume(np.array([[2.0, 5.0], [2.5, 3.5], [4.0, 3.0]])) == pytest.approx(0.75 * 0.75)
    with_one_more = np.array([[2.0, 5.0], [2.5, 3.5], [3.0, 3.2], [4.0, 3.0]])
    assert front.hypervolume(with_one_more) > 0.75 * 0.75


@given(costs)
def test_a_dominated_point_adds_no_hypervolume(points: list[tuple[float, float]]) -> None:
    values = np.array([(0.0, 1.0), *points, (1.0, 0.0)])
    good = values[~front.dominated(values)]
    assert 0.0 <= front.hypervolume(good) <= 1.0
