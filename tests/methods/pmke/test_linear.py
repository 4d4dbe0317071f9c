"""Rows of a window that are linear: what they say is what the evaluation finds of the whole motion."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from pipeline.common.arrays import Array
from pipeline.evaluation.sums import derivatives
from pipeline.methods.pmke.linear import linear_rows
from pipeline.methods.pmke.receding import continued
from pipeline.problem.limits import Limits
from pipeline.problem.problem import Boundary, Problem
from pipeline.problem.solution import Trajectory
from pipeline.program.newton import stencils
from pipeline.program.newton.knots import Knots
from tests.support import free_line

TIMES = np.array([0.0, 0.1, 0.2, 0.3, 0.45, 0.7, 1.0])
BOUND = np.array([2.0, 3.0, 5.0])


@pytest.fixture(scope="module")
def line() -> Problem:
    return free_line(2)


def asked(problem: Problem, q: Array, entered: bool, **limits: Array) -> Problem:
    timing = replace(problem.reference.timing, at_rest=not entered)
    reference = replace(problem.reference, timing=timing)
    return replace(
        problem, boundary=Boundary.FIXED, q_init=q[0], reference=reference, limits=replace(Limits.none(3), **limits)
    )


def rows(window: Problem, q: Array) -> Array:
    """c (U, R) of the window's knots q (U + 1, n)."""
    offset, *by = linear_rows(window)
    knots = Knots(Boundary.FIXED, window.times)
    return offset + stencils.change(knots, tuple(g[None] for g in by), q[None, 1:])[0]


@pytest.mark.parametrize("entered", [False, True])
@pytest.mark.parametrize("begin", [0, 1, 2, 3])
def test_a_window_goes_on_from_what_has_been_executed(
    line: Problem, rng: np.random.Generator, begin: int, entered: bool
) -> None:
    """Its accelerations and jerks are those of the whole motion, wherever the window begins."""
    q = rng.normal(size=(len(TIMES), 3))
    _, qdd, jerk = derivatives(Trajectory(TIMES, q), Boundary.FIXED, at_rest=not entered)
    for limits, expected in (({"acceleration": BOUND}, qdd), ({"jerk": BOUND}, jerk)):
        problem = asked(line, q, entered, **limits)
        window = replace(continued(problem, TIMES, q[: begin + 1]), times=TIMES[begin:])
        found = rows(window, q[begin:])
        np.testing.assert_allclose(found[:, :3], 1 - expected[begin + 1 :] / BOUND, rtol=1e-9, atol=1e-9)
        np.testing.assert_allclose(found[:, 3:], 1 + expected[begin + 1 :] / BOUND, rtol=1e-9, atol=1e-9)


def test_a_motion_that_rests_at_its_end_stands_still_from_there_on(line: Problem, rng: np.random.Generator) -> None:
    q = rng.normal(size=(len(TIMES), 3))
    times = np.append(TIMES, [1.3, 1.6])
    _, qdd, jerk = derivatives(Trajectory(times, np.vstack([q, q[-1:], q[-1:]])), Boundary.FIXED, at_rest=True)
    for limits, expected in (({"acceleration": BOUND}, qdd[-2:-1]), ({"jerk": BOUND}, jerk[-2:])):
        problem = replace(asked(line, q, entered=False, **limits), rest=(True, True), times=TIMES)
        found = rows(problem, q)[:, 6:]
        both = np.hstack([sign * one / BOUND for one in expected for sign in (-1, 1)])
        np.testing.assert_allclose(found[-1], 1 + both, rtol=1e-9, atol=1e-9)
        np.testing.assert_array_equal(found[:-1], 1.0)
        before_the_end = replace(problem, times=TIMES[:-1])
        np.testing.assert_array_equal(rows(before_the_end, q[:-1])[:, 6:], 1.0)
