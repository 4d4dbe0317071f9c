"""The bound as a method: what it says, what it refuses, and that it looks for what it leaves open."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from pipeline.build.problem import prepare
from pipeline.common.errors import InputError
from pipeline.config.methods import LowerBoundOptions
from pipeline.evaluation.evaluation import evaluate
from pipeline.methods import lower_bound as module
from pipeline.methods.lower_bound import lower_bound, percent, sentence
from pipeline.problem.problem import Problem
from pipeline.problem.solution import Status
from tests.support import backward_differences, composed, free_line

COARSE = LowerBoundOptions(intervals=12)
# The 12-interval optimum of the independent exact-Hessian program (tests/benchmarks/peer.py) with a free start.
BEST_12 = 0.052714


@pytest.fixture(scope="module")
def line() -> Problem:
    return free_line(24)


@pytest.mark.slow
def test_a_motion_its_cost_and_its_bound(line: Problem) -> None:
    (solution,) = lower_bound(line, COARSE)
    found = solution.statistics
    assert found["cost"] == pytest.approx(BEST_12, abs=1e-6)
    assert (1 - COARSE.gap) * found["cost"] <= found["bound"] <= BEST_12 + 1e-6
    assert found["gap"] == pytest.approx(1 - found["bound"] / found["cost"])
    assert solution.message == sentence(12, found["cost"], found["gap"], found["cost_from_roadmap"])
    np.testing.assert_array_equal(solution.trajectory.time, line.times)  # finished by the planner
    judged = evaluate(line, solution)
    assert judged.status is Status.SOLVED
    own = backward_differences(line, line.times, solution.trajectory.q[None])[0]
    assert found["cost"] < own < 1.02 * found["cost"]


def test_what_it_says() -> None:
    assert sentence(50, 0.0528942, 0.00139, 0.0528942) == (
        "on 50 intervals no motion with joint steps below 2.5 rad costs more than 0.14 % less than this one does "
        "there, 0.052894; numerical bound"
    )
    found = sentence(50, 0.025, 0.00139, 0.027)
    assert found.endswith("numerical bound; found where the bound showed room, the planner's starts led to 0.027")
    assert [percent(gap) for gap in (0.0, 1.234e-4, 0.00999, 0.1231, 1.5)] == [
        *("0.001 %", "0.013 %", "1 %", "13 %", "150 %")
    ]


@pytest.mark.slow
def test_where_the_bound_shows_room_it_is_searched(monkeypatch: pytest.MonkeyPatch) -> None:
    """With a roadmap too small to lead to the best motion the cells lead there."""
    from tests.search.test_cover import on_intervals

    problem = on_intervals("fixed3")
    (whole,) = lower_bound(problem, COARSE)
    best = module._best
    calls = 0

    def worst_first(of: Problem, starts: np.ndarray) -> object:
        nonlocal calls
        calls += 1
        return best(of, starts[-1:] if calls == 1 else starts)

    monkeypatch.setattr(module, "_best", worst_first)
    (searched,) = lower_bound(problem, COARSE)
    assert searched.statistics["cost_from_roadmap"] > 1.1 * searched.statistics["cost"]
    assert searched.statistics["cost"] == pytest.approx(whole.statistics["cost"], rel=1e-6)
    assert searched.statistics["gap"] <= COARSE.gap
    assert "found where the bound showed room" in searched.message


def test_a_stop_before_the_gap_is_closed_says_what_is_open(line: Problem, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(module, "MOST_LINKS", 10)
    (solution,) = lower_bound(line, LowerBoundOptions(intervals=12, cells=30))
    assert solution.statistics["gap"] > COARSE.gap
    assert percent(solution.statistics["gap"]) in solution.message


@pytest.mark.slow
def test_nothing_to_hold_a_bound_against(line: Problem) -> None:
    limits = replace(line.bounds, velocity=np.full(3, 0.1))
    (solution,) = lower_bound(replace(line, limits=limits), COARSE)
    assert not solution.found
    assert "no motion on 12 intervals was found" in solution.message


@pytest.mark.parametrize(
    ("words", "why"),
    [
        (("robot=planar4r",), "the redundancy degree is 2; supported are r = 1"),
        (("objective=torque",), "of second order; supported are r = 1"),
        (("limits=joint_torque_power",), "torque or power limits; supported are limits of positions and velocities"),
        (("+experiment=case2",), "a secondary criterion; supported are limits of positions"),
        (("base=free", "base.mass=20", "base.inertia=1"), "the base is floating; supported are r = 1"),
    ],
)
def test_what_it_refuses(words: tuple[str, ...], why: str) -> None:
    with pytest.raises(InputError, match=f"^lower_bound: .*{why}"):
        lower_bound(prepare(composed(*words)))
