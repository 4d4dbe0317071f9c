from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
import pandas as pd
import pytest

from pipeline.common.arrays import Array
from pipeline.config.run import RunConfig
from pipeline.evaluation.evaluation import Evaluation, evaluate
from pipeline.problem.problem import Problem
from pipeline.problem.solution import Solution, Status, Trajectory
from pipeline.search.population import population
from pipeline.search.selection import distinct
from pipeline.studies import validation
from pipeline.studies.study import Motions

Make = Callable[[int, int], Problem]
ENERGIES = {"minimum": 0.05, "saddle": 0.07}


@pytest.fixture
def line(problem: Make) -> Problem:
    return problem(3, 20)


@pytest.fixture
def paths(line: Problem) -> list[Array]:
    """Three motions (N + 1, n) on the path, far from one another."""
    motions = population(line, line.times, line.q_init[None], 60, np.random.default_rng(1))
    kept = distinct(motions, np.zeros(len(motions)), 3, 0.6, np.ones(3, dtype=bool))
    assert len(kept) == 3
    return [motions[index] for index in kept]


def planner(problem: Problem, q: Array, optimum: int = 1, status: Status = Status.SOLVED) -> Evaluation:
    return evaluate(problem, Solution("global", Trajectory(problem.times, q), status, optimum=optimum))


def stationary(problem: Problem, q: Array, optimum: int = 1, kind: str = "minimum") -> Evaluation:
    facts: dict[str, Any] = {"kind": kind, "integral": ENERGIES[kind]}
    solution = Solution(
        "calculus_of_variations", Trajectory(problem.times, q), Status.SOLVED, "", optimum, statistics=facts
    )
    return evaluate(problem, solution)


def table(problem: Problem, motions: list[Evaluation]) -> pd.DataFrame:
    return validation.table(Motions(RunConfig(), problem, motions))


def test_pairs_are_made_by_path_not_by_rank(line: Problem, paths: list[Array]) -> None:
    shift = 0.01 * np.sin(np.linspace(0, np.pi, len(line.times)))[:, None]
    made = table(
        line,
        [
            planner(line, paths[0] + shift, 1),
            planner(line, paths[1], 2),
            stationary(line, paths[1], 1),
            stationary(line, paths[0], 2, "saddle"),
        ],
    )
    assert list(made["planner_optimum"]) == [1, 2]
    assert list(made["stationary_motion"]) == [2, 1]
    assert list(made["kind"]) == ["saddle", "minimum"]
    assert list(made["stationary_objective"]) == [0.07, 0.05]
    assert made["remark"].isna().all()
    np.testing.assert_allclose(made["mean_absolute_difference"], [shift.mean(), 0.0], atol=1e-12)


def test_full_turns_do_not_part_a_pair(line: Problem, paths: list[Array]) -> None:
    turned = paths[0] + 2 * np.pi * np.array([1.0, 0.0, -1.0])
    (row,) = table(line, [planner(line, turned), stationary(line, paths[0])]).to_dict("records")
    assert row["stationary_motion"] == 1
    assert row["mean_absolute_difference"] == pytest.approx(0.0, abs=1e-12)


def test_what_has_no_partner_says_why(line: Problem, paths: list[Array]) -> None:
    motions = [
        stationary(line, paths[1], 1, "minimum"),
        planner(line, paths[0], 1),
        stationary(line, paths[2], 2, "saddle"),
    ]
    made = table(line, motions)
    alone, missed, saddle = made.to_dict("records")
    assert "continuous time" in alone["remark"]
    assert "timing.steps" in alone["remark"]
    assert pd.isna(alone["stationary_motion"])
    assert alone["planner_objective"] == motions[1].objective
    assert (missed["stationary_motion"], saddle["stationary_motion"]) == (1, 2)
    assert missed["remark"] == "the planner did not find it"
    assert saddle["remark"].startswith("not a minimum")
    assert pd.isna(missed["planner_optimum"])


def test_a_motion_has_one_partner(line: Problem, paths: list[Array]) -> None:
    """Two optima of the planner near one stationary motion: the nearer is its partner, the other has none."""
    near, nearer = (paths[0] + step for step in (0.02, 0.001))
    made = table(line, [planner(line, near, 1), planner(line, nearer, 2), stationary(line, paths[0], 1)])
    partners = dict(zip(made["planner_optimum"], made["stationary_motion"], strict=True))
    assert partners[2] == 1
    assert pd.isna(partners[1])


def test_what_failed_is_no_optimum(line: Problem, paths: list[Array]) -> None:
    lost = planner(line, paths[0], status=Status.NOT_CONVERGED)
    made = table(line, [lost, stationary(line, paths[0])])
    assert list(made["remark"]) == ["the planner did not find it"]
    assert made["planner_optimum"].isna().all()


def test_columns_are_there_without_any_row(line: Problem) -> None:
    made = table(line, [])
    assert len(made) == 0
    assert {"planner_optimum", "stationary_objective", "kind", "remark"} <= set(made.columns)
