from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from pipeline.config.methods import DynamicProgrammingOptions, GlobalOptions
from pipeline.methods.dynamic_programming import dynamic_programming
from pipeline.methods.global_planner.planner import global_planner
from pipeline.problem.problem import Problem
from pipeline.problem.solution import Solution, Status, Trajectory
from pipeline.studies import certificate
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
    assert 0 <= made["gap"] <= made["grid_error"]
    assert made["planner_on_grid"] + made["gap"] == pytest.approx(on_grid.statistics["cost"], rel=1e-12)
    assert "no better motion exists on this grid" in certificate.sentence(made, 13)
    assert "on 13 intervals" in certificate.sentence(made, 13)


def test_another_optimum_is_found_out(line: Problem, optima: list[Solution], on_grid: Solution) -> None:
    """A planner that missed the best motion and offers its second or last as the best."""
    for worse in optima[1:]:
        made = certificate.certify(line, worse, on_grid)
        assert made["gap"] < 0
        assert "the grid holds a better motion than the planner found" in certificate.sentence(made, 13)


def test_a_gap_larger_than_the_grid_error_is_not_called_a_proof(
    line: Problem, optima: list[Solution], on_grid: Solution
) -> None:
    cost = on_grid.statistics["cost"]
    poor = replace(on_grid, statistics={**on_grid.statistics, "cost": 1.5 * cost})
    made = certificate.certify(line, optima[0], poor)
    assert made["gap"] > made["grid_error"]
    assert "look closer" in certificate.sentence(made, 13)


def test_a_motion_that_cannot_be_carried_over_certifies_nothing(
    line: Problem, optima: list[Solution], on_grid: Solution, rng: np.random.Generator
) -> None:
    wild = Trajectory(line.times, rng.normal(scale=40.0, size=optima[0].trajectory.q.shape))
    made = certificate.certify(line, replace(optima[0], trajectory=wild), on_grid)
    sentence = certificate.sentence(made, 13)
    if np.isnan(made["planner_on_grid"]):
        assert "no better motion exists" not in sentence
        assert "better motion than the planner" not in sentence
    else:  # carried to some optimum of the grid: then it must be called by its cost
        assert ("no better motion exists" in sentence) == (0 <= made["gap"] <= made["grid_error"])


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
    made = {"planner_on_grid": 0.05, "gap": gap, "grid_error": error}
    assert verdict in certificate.sentence(made, 25)


def test_which_solutions_can_be_compared(optima: list[Solution], on_grid: Solution) -> None:
    second = replace(on_grid, optimum=2)
    failed = replace(optima[0], status=Status.NOT_CONVERGED)
    lsv = replace(optima[0], method="lsv")
    assert certificate.comparable([lsv, *optima, on_grid, second]) == (optima[0], on_grid)
    assert certificate.comparable([on_grid, second, *optima]) == (optima[0], on_grid)
    for some in (
        [],
        optima,
        [on_grid],
        [failed, on_grid],
        [lsv, on_grid],
        [*optima, replace(on_grid, status=Status.INFEASIBLE)],
    ):
        assert certificate.comparable(some) is None
