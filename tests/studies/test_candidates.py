from __future__ import annotations

import numpy as np
import pytest

from pipeline.config.methods import GlobalOptions
from pipeline.config.studies import CandidateStudyConfig
from pipeline.problem.problem import Problem
from pipeline.studies.candidates import Candidates, measure
from tests.support import free_line

OPTIMUM = 0.049  # [J s] just below the optimum on this coarse grid


@pytest.fixture(scope="module")
def line() -> Problem:
    return free_line(12)


@pytest.fixture(scope="module")
def curve(line: Problem) -> Candidates:
    return measure(line, OPTIMUM, GlobalOptions(configurations=12), CandidateStudyConfig(most=600, repeats=3), seed=1)


@pytest.mark.slow
def test_more_candidates_come_nearer(curve: Candidates) -> None:
    assert (np.diff(curve.distance) <= 1e-12).all()
    assert curve.distance[-1] < 0.5 * curve.distance[0]
    assert (curve.distance > 0).all()
    assert curve.exponent < 0


def test_counts_go_from_one_to_all(curve: Candidates) -> None:
    assert (curve.count[0], curve.count[-1]) == (1, 600)
    assert (np.diff(curve.count) > 0).all()
    assert curve.count.shape == curve.distance.shape


def test_the_line_is_fitted_from_the_number_of_parameters_on(curve: Candidates) -> None:
    assert curve.parameters == 39
    tail = curve.count >= 39
    slope, offset = np.polyfit(np.log(curve.count[tail]), np.log(curve.distance[tail]), 1)
    assert (curve.exponent, curve.intercept) == pytest.approx((slope, offset), rel=1e-9)


def test_a_function_of_the_seed(line: Problem) -> None:
    options, small = GlobalOptions(configurations=4), CandidateStudyConfig(most=100, repeats=1)
    first, same, other = (measure(line, OPTIMUM, options, small, seed) for seed in (5, 5, 6))
    np.testing.assert_array_equal(first.distance, same.distance)
    assert not np.array_equal(first.distance, other.distance)


@pytest.mark.parametrize("most", [100, 153, 154])
def test_few_candidates_are_no_crash(most: int) -> None:
    """Fewer candidates than parameters are allowed by the schema: there is no line to fit then, but a curve."""
    small = CandidateStudyConfig(most=most, repeats=1)
    curve = measure(free_line(50), OPTIMUM, GlobalOptions(configurations=4), small, seed=1)
    assert curve.parameters == 153
    assert curve.count[-1] == most
