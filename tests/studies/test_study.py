"""What studies ask of a run's motions, and that a result without an answer adds nothing."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import pytest

from pipeline.common.arrays import Array
from pipeline.config.run import RunConfig
from pipeline.evaluation.evaluation import Evaluation, evaluate
from pipeline.problem.problem import Problem
from pipeline.problem.solution import Solution, Status, Trajectory
from pipeline.studies.studies import STUDIES
from pipeline.studies.study import Motions, Result

ENDS = (
    ("lsv", 1, Status.SINGULAR),
    ("global", 1, Status.UNCONFIRMED),
    ("global", 2, Status.SOLVED),
    ("global", 3, Status.SOLVED),
    ("pmke", 1, Status.NOT_CONVERGED),
)


@pytest.fixture
def motions(problem: Callable[[int, int], Problem], guess: Callable[[Problem], Array]) -> Motions:
    asked = problem(1, 6)
    own = evaluate(asked, Solution("lsv", Trajectory(asked.times, guess(asked)), Status.SOLVED))
    ended = [
        replace(own, status=status, solution=replace(own.solution, method=method, optimum=optimum))
        for method, optimum, status in ENDS
    ]
    return Motions(RunConfig(), asked, ended)


def labels(found: list[Evaluation]) -> list[str]:
    return [e.label for e in found]


def test_which_motions_a_study_gets(motions: Motions) -> None:
    assert motions.methods == {"lsv", "global", "pmke"}
    assert labels(motions.solved) == ["global 2", "global 3"]
    assert labels(motions.confirmed("lsv")) == ["lsv"]
    assert labels(motions.confirmed("global")) == ["global 2", "global 3"]
    assert motions.confirmed("pmke") == []
    best = motions.best("global")
    assert best is not None
    assert best.label == "global 2"
    for method in ("lsv", "pmke", "pontryagin"):
        assert motions.best(method) is None


def test_a_result_is_empty_until_it_says_something(motions: Motions) -> None:
    class Silent(Result):
        name = "silent"

    (first, *_), silent = motions.evaluations, Silent()
    assert [silent.tables(), silent.columns(first), silent.facts(), silent.figures("run"), silent.units] == [{}] * 5
    assert (silent.section(), silent.cover, silent.hides(first)) == ([], "", False)


def test_a_run_that_asks_for_nothing_gets_nothing(motions: Motions) -> None:
    quiet = replace(motions, config=replace(motions.config, export=replace(motions.config.export, method="none")))
    assert [study(quiet) for study in STUDIES] == [None] * len(STUDIES)
