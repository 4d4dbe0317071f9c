from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from pipeline.config.methods import DynamicProgrammingOptions, GlobalOptions
from pipeline.config.run import RunConfig
from pipeline.evaluation.evaluation import Evaluation, evaluate
from pipeline.methods.dynamic_programming import dynamic_programming
from pipeline.methods.global_planner.planner import global_planner
from pipeline.problem.problem import Problem
from pipeline.problem.solution import Solution, Status, Trajectory
from pipeline.studies import certificate
from pipeline.studies.study import Motions
from tests.support import free_line


@pytest.fixture(scope="module")
def line() -> Problem:
    return free_line(26)


@pytest.fixture(scope="module")
def optima(line: Problem) -> list[Solution]:
    return global_planner(line, GlobalOptions(starts="dynamic_programming"))


@pytest.fixture(scope="module")
def on_grid(line: Problem) -> Solution:
    return dynamic_programming(line, DynamicProgrammingOptions(nodes=180, intervals=13))[0]


def test_the_true_optimum_is_certified(line: Problem, optima: list[Solution], on_grid: Solution) -> None:
    made = certificate.certify(line, optima[0], on_grid)
    assert 0 <= made.gap <= made.grid_error
    assert made.planner_on_grid + made.gap == pytest.approx(on_grid.statistics["cost"], rel=1e-12)
    assert "no better motion exists on this grid" in made.sentence
    assert "on 13 intervals" in made.sentence


def test_another_optimum_is_found_out(line: Problem, optima: list[Solution], on_grid: Solution) -> None:
    """A planner that missed the best motion and offers its second or last as the best."""
    for worse in optima[1:]:
        made = certificate.certify(line, worse, on_grid)
        assert made.gap < 0
        assert "the grid holds a better motion than the planner found" in made.sentence


def test_a_gap_larger_than_the_grid_error_is_not_called_a_proof(
    line: Problem, optima: list[Solution], on_grid: Solution
) -> None:
    cost = on_grid.statistics["cost"]
    poor = replace(on_grid, statistics={**on_grid.statistics, "cost": 1.5 * cost})
    made = certificate.certify(line, optima[0], poor)
    assert made.gap > made.grid_error
    assert "look closer" in made.sentence


def test_a_motion_that_cannot_be_carried_over_certifies_nothing(
    line: Problem, optima: list[Solution], on_grid: Solution, rng: np.random.Generator
) -> None:
    wild = Trajectory(line.times, rng.normal(scale=40.0, size=optima[0].trajectory.q.shape))
    made = certificate.certify(line, replace(optima[0], trajectory=wild), on_grid)
    sentence = made.sentence
    if np.isnan(made.planner_on_grid):
        assert "no better motion exists" not in sentence
        assert "better motion than the planner" not in sentence
    else:  # carried to some optimum of the grid: then it must be called by its cost
        assert ("no better motion exists" in sentence) == (0 <= made.gap <= made.grid_error)


@pytest.mark.parametrize(
    ("gap", "error", "verdict"),
    [
        (0.0, 1e-4, "no better motion exists"),
        (1e-4, 1e-4, "no better motion exists"),
        (1.1e-4, 1e-4, "look closer"),
        (-1e-3, 1e-4, "the grid holds a better motion"),
        (float("nan"), 1e-4, "look closer"),
        (1e-4, float("nan"), "look closer"),
    ],
)
def test_verdicts(gap: float, error: float, verdict: str) -> None:
    made = certificate.Certificate(0.05, gap, error, intervals=25)
    assert verdict in made.sentence
    assert made.sentence.startswith("on 25 intervals")


def test_which_motions_are_compared(
    line: Problem, optima: list[Solution], on_grid: Solution, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The first of either method that the evaluation confirms; nothing if one has none."""
    monkeypatch.setattr(certificate, "certify", lambda problem, *pair: pair)
    own = evaluate(line, optima[0])
    on_grid_too = replace(own, solution=on_grid)
    second = [replace(e, solution=replace(e.solution, optimum=2)) for e in (own, on_grid_too)]
    lost, infeasible = replace(own, status=Status.UNCONFIRMED), replace(on_grid_too, status=Status.INFEASIBLE)
    lsv = replace(own, solution=replace(optima[0], method="lsv"))

    def compared(*motions: Evaluation) -> object:
        return certificate.study(Motions(RunConfig(), line, motions))

    assert compared(lsv, own, on_grid_too, *second) == (optima[0], on_grid)
    assert compared(on_grid_too, *second, own) == (second[0].solution, on_grid)
    assert compared(lost, on_grid_too, second[0]) == (second[0].solution, on_grid)
    for some in ((), (own, second[0]), (on_grid_too,), (lost, on_grid_too), (lsv, on_grid_too), (own, infeasible)):
        assert compared(*some) is None
