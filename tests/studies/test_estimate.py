"""What other searches found, beside the planner's optima: whose motion it is, is told by its path."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from pipeline.config.methods import DynamicProgrammingOptions, GlobalOptions
from pipeline.config.run import RunConfig
from pipeline.evaluation.evaluation import Evaluation, evaluate
from pipeline.methods.dynamic_programming import dynamic_programming
from pipeline.methods.global_planner.planner import global_planner
from pipeline.methods.method import Context
from pipeline.problem.costs import objective_values
from pipeline.problem.problem import Problem
from pipeline.problem.solution import Solution, Status
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
def on_grid(line: Problem) -> list[Solution]:
    return dynamic_programming(line, DynamicProgrammingOptions(nodes=180, intervals=13))


def compared(line: Problem, optima: list[Solution], on_grid: list[Solution]) -> estimate.Comparison:
    return estimate.compare(line, optima, on_grid, OPTIONS, Context())


@pytest.mark.slow
def test_the_same_motion_is_recognised_and_no_bound_is_claimed(
    line: Problem, optima: list[Solution], on_grid: list[Solution]
) -> None:
    made = compared(line, optima, on_grid)
    best = objective_values(line, line.times, optima[0].trajectory.q[None])[0]
    assert made.same_as == 1
    assert made.motion is None
    assert made.finished == pytest.approx(best, rel=1e-6)
    assert made.sentence == (
        f"its best motion on 13 intervals, finished by the planner on 26, is the planner's best, {best:.5g}; nothing "
        "cheaper than the planner's best came of its motions"
    )
    result = estimate.Estimate((made,))
    assert "an estimate" in result.section()[0]
    assert not result.tables()
    for claim in ("no better", "global", "certif", "proof"):
        assert claim not in " ".join(result.section())


def test_a_motion_that_the_planner_misses_is_not_credited_to_it(
    line: Problem, optima: list[Solution], on_grid: list[Solution]
) -> None:
    """A planner that offers its second or last as its best: neither is the motion that the grid leads to."""
    for worse in (optima[1:], optima[-1:]):
        made = compared(line, worse, on_grid)
        assert made.same_as == 0
        assert made.motion is not None
        assert made.better < made.best
        own = objective_values(line, line.times, np.array([made.motion.q, optima[0].trajectory.q]))
        assert own[0] == pytest.approx(made.better, rel=1e-12)
        assert own[0] == pytest.approx(own[1], rel=1e-6)
        assert "a better motion than the planner's best" in made.sentence
        table = estimate.Estimate((made,)).tables()["better_than_planner_dynamic_programming"]
        np.testing.assert_allclose(table[["q_1", "q_2", "q_3"]], made.motion.q)


def test_a_dearer_motion_of_another_path_is_only_named(line: Problem, optima: list[Solution]) -> None:
    other = replace(optima[2], method="lower_bound")
    made = compared(line, optima[:2], [other])
    assert (made.same_as, made.motion) == (0, None)
    assert made.finished > made.best
    assert "is none of the planner's: it costs" in made.sentence
    assert compared(line, optima, [other]).same_as == 3


def test_a_motion_that_is_lost_says_so(
    line: Problem, optima: list[Solution], on_grid: list[Solution], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(estimate, "finish", lambda *arguments: (line.times, []))
    made = compared(line, optima, on_grid)
    assert np.isnan(made.finished)
    assert "was lost on the way to 26" in made.sentence


def test_which_motions_are_compared(
    line: Problem, optima: list[Solution], on_grid: list[Solution], monkeypatch: pytest.MonkeyPatch
) -> None:
    """Those that the evaluation confirms, of the planner and of each of the others; nothing if one has none."""
    monkeypatch.setattr(estimate, "compare", lambda problem, planned, others, *rest: (planned, others))
    own = evaluate(line, optima[0])
    other = replace(own, solution=on_grid[0])
    bound = replace(own, solution=replace(optima[0], method="lower_bound"))
    second = replace(own, solution=replace(optima[0], optimum=2))
    lost, infeasible = replace(own, status=Status.UNCONFIRMED), replace(other, status=Status.INFEASIBLE)

    def asked(*motions: Evaluation) -> object:
        made = estimate.study(Motions(RunConfig(), line, motions))
        return None if made is None else made.comparisons

    assert asked(own, second, other) == (([own.solution, second.solution], [other.solution]),)
    assert asked(lost, second, other) == (([second.solution], [other.solution]),)
    assert asked(bound, own, other) == (([own.solution], [other.solution]), ([own.solution], [bound.solution]))
    for some in ((), (own, second), (other, bound), (lost, other), (own, infeasible)):
        assert asked(*some) is None
