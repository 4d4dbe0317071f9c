"""What other searches found, beside the planner's optima: whose motion it is, is told by its path."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from scipy.interpolate import CubicSpline

from pipeline.config.methods import DynamicProgrammingOptions, GlobalOptions
from pipeline.config.run import RunConfig
from pipeline.evaluation.evaluation import Evaluation, evaluate
from pipeline.methods.dynamic_programming import dynamic_programming
from pipeline.methods.global_planner.planner import global_planner
from pipeline.methods.method import Context
from pipeline.problem.problem import Problem
from pipeline.problem.solution import Solution, Status, Trajectory
from pipeline.search import bellman
from pipeline.search.selection import path_distance
from pipeline.studies import estimate
from pipeline.studies.study import Motions
from tests.support import free_line

OPTIONS = GlobalOptions()


@pytest.fixture(scope="module")
def line() -> Problem:
    return free_line(26)


@pytest.fixture(scope="module")
def optima(line: Problem) -> list[Solution]:
    return global_planner(line, GlobalOptions(starts="dynamic_programming"))


@pytest.fixture(scope="module")
def on_grid(line: Problem) -> Solution:
    return dynamic_programming(line, DynamicProgrammingOptions(nodes=180, intervals=13))[0]


def compared(line: Problem, optima: list[Solution], on_grid: Solution) -> estimate.Comparison:
    return estimate.compare(line, optima, on_grid, OPTIONS, Context())


def integral(line: Problem, solution: Solution) -> float:
    """By the evaluation, which has a plant and a quadrature of its own."""
    return evaluate(line, solution).objective_spline


@pytest.mark.slow
def test_the_same_motion_is_recognised_and_no_bound_is_claimed(
    line: Problem, optima: list[Solution], on_grid: Solution
) -> None:
    made, best = compared(line, optima, on_grid), integral(line, optima[0])
    assert (made.same_as, made.gone_on, made.intervals) == (1, False, 13)
    assert made.finished == made.best == pytest.approx(best, rel=1e-4)
    assert made.sentence == (
        f"its best motion on 13 intervals, finished by the planner, is the planner's best, {made.best:.5g} in "
        "continuous time"
    )
    result = estimate.Estimate((made,))
    assert "an estimate" in result.section()[0]
    for claim in ("no better", "global", "certif", "proof"):
        assert claim not in " ".join(result.section())


def test_a_motion_of_another_path_is_not_credited_to_the_planner(
    line: Problem, optima: list[Solution], on_grid: Solution
) -> None:
    """A planner that has only its second or last optimum: neither is the motion that the grid leads to."""
    for worse in (optima[1:], optima[-1:]):
        made = compared(line, worse, on_grid)
        assert (made.same_as, made.gone_on) == (0, False)
        assert made.finished == pytest.approx(integral(line, optima[0]), rel=1e-4)
        assert made.best == pytest.approx(integral(line, worse[0]), rel=1e-4)
        assert "is none of the planner's: it costs" in made.sentence
    assert compared(line, optima[:2], optima[2]).same_as == 0
    assert compared(line, optima, replace(optima[2], optimum=1)).same_as == 3


def test_a_coarser_motion_is_finished_before_it_is_compared(line: Problem, optima: list[Solution]) -> None:
    """On seven intervals the best optimum is 0.1 rad from where it is on 26."""
    grid = np.linspace(0, 1, 8)
    coarse = bellman.starts(line, grid, 90)[0]
    far = path_distance(CubicSpline(grid, coarse)(line.times), optima[0].trajectory.q, np.ones(3, bool))
    assert far > OPTIONS.same_path
    made = compared(line, optima, Solution("lower_bound", Trajectory(grid, coarse), Status.SOLVED))
    assert (made.same_as, made.method, made.intervals) == (1, "lower_bound", 7)


def test_where_the_planner_has_gone_on_is_said(line: Problem, optima: list[Solution], on_grid: Solution) -> None:
    from_grid = replace(optima[0], statistics={"continued_from": "dynamic_programming"})
    made = compared(line, [from_grid, *optima[1:]], on_grid)
    assert made.gone_on
    assert made.sentence.endswith("had led to dearer ones only, and it has gone on from this one")
    assert not compared(line, [from_grid, *optima[1:]], replace(on_grid, method="lower_bound")).gone_on


def test_which_motions_are_compared(
    line: Problem, optima: list[Solution], on_grid: Solution, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Those that the evaluation confirms, of the planner and of each of the others; nothing if one has none."""
    monkeypatch.setattr(estimate, "compare", lambda problem, planned, other, *rest: (planned, other))
    own = evaluate(line, optima[0])
    other = replace(own, solution=on_grid)
    bound = replace(own, solution=replace(optima[0], method="lower_bound"))
    second = replace(own, solution=replace(optima[0], optimum=2))
    lost, infeasible = replace(own, status=Status.UNCONFIRMED), replace(other, status=Status.INFEASIBLE)

    def asked(*motions: Evaluation) -> object:
        made = estimate.study(Motions(RunConfig(), line, motions))
        return None if made is None else made.comparisons

    assert asked(own, second, other) == (([own.solution, second.solution], other.solution),)
    assert asked(lost, second, other) == (([second.solution], other.solution),)
    assert asked(bound, own, other) == (([own.solution], other.solution), ([own.solution], bound.solution))
    for some in ((), (own, second), (other, bound), (lost, other), (own, infeasible)):
        assert asked(*some) is None
