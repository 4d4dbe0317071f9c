"""The planner goes on from better motions of other methods; what is its own already, or dearer, changes nothing."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from pipeline.build.problem import prepare
from pipeline.config.methods import GlobalOptions
from pipeline.evaluation.evaluation import evaluate
from pipeline.methods.global_planner.continued import continued
from pipeline.methods.global_planner.planner import global_planner
from pipeline.methods.method import Context
from pipeline.problem.problem import Problem
from pipeline.problem.solution import Solution, Status, Trajectory
from pipeline.run.solve import solve
from pipeline.search import bellman
from tests.support import backward_differences, composed, free_line

OPTIONS = GlobalOptions()


@pytest.fixture(scope="module")
def line() -> Problem:
    return free_line(24)


@pytest.fixture(scope="module")
def optima(line: Problem) -> list[Solution]:
    """Four at least, best first."""
    return global_planner(line, GlobalOptions(starts="dynamic_programming"))


@pytest.fixture(scope="module")
def on_grid(line: Problem) -> list[Solution]:
    """Raw paths of a coarse grid, best first."""
    times = np.linspace(0, 1, 13)
    paths = bellman.starts(line, times, 120)
    return [Solution("dynamic_programming", Trajectory(times, q), Status.SOLVED) for q in paths]


def costs(line: Problem, solutions: list[Solution]) -> list[float]:
    return [float(backward_differences(line, s.trajectory.time, s.trajectory.q[None])[0]) for s in solutions]


def numbered(solutions: list[Solution]) -> list[Solution]:
    return [replace(solution, optimum=rank + 1) for rank, solution in enumerate(solutions)]


def test_what_is_better_becomes_the_planners_own(
    line: Problem, optima: list[Solution], on_grid: list[Solution]
) -> None:
    missed = numbered(optima[2:])  # a planner that has not found its first two
    lsv = replace(optima[0], method="lsv")
    found = continued(line, [lsv, *missed, *on_grid], OPTIONS, Context())
    assert [s.method for s in found] == ["lsv", *["global"] * len(optima), *["dynamic_programming"] * len(on_grid)]
    planned = found[1 : 1 + len(optima)]
    np.testing.assert_allclose(costs(line, planned), costs(line, optima), rtol=1e-6)
    assert [s.optimum for s in planned] == list(range(1, len(optima) + 1))
    assert [s.statistics.get("continued_from") for s in planned[:3]] == [*["dynamic_programming"] * 2, None]
    assert planned[0].message == (
        "gone on from what dynamic_programming found; the planner's own starts led to optimum 3 at best"
    )
    for solution in planned[:2]:
        judged = evaluate(line, solution)
        assert judged.status is Status.SOLVED
        assert "confirmed by IPOPT" in solution.evidence


def test_nothing_changes_where_nothing_is_better(
    line: Problem, optima: list[Solution], on_grid: list[Solution]
) -> None:
    for some in ([*optima, *on_grid], [optima[0], *on_grid], on_grid, optima):
        assert continued(line, some, OPTIONS, Context()) == some
    nearly = [optima[1], replace(optima[2], method="dynamic_programming")]  # of another path, and dearer by 1.6 %
    assert continued(line, nearly, OPTIONS, Context()) == nearly
    lost = [replace(on_grid[0], status=Status.NOT_CONVERGED), replace(on_grid[0], found=False)]
    assert continued(line, [optima[2], *lost], OPTIONS, Context()) == [optima[2], *lost]


def test_a_planner_without_a_motion_has_one(line: Problem, optima: list[Solution], on_grid: list[Solution]) -> None:
    none = replace(optima[0], found=False, status=Status.NOT_CONVERGED)
    first, *_ = continued(line, [none, on_grid[0]], OPTIONS, Context())
    assert (first.found, first.status) == (True, Status.SOLVED)
    assert first.message.endswith("the planner's own starts led to no motion")
    assert costs(line, [first]) == pytest.approx(costs(line, optima[:1]), rel=1e-6)


@pytest.mark.slow
def test_a_run_with_too_few_starts_has_the_better_motion_from_its_grid() -> None:
    """Trajectory 4: 0.02301 with joint 3 the other way round, of which one start knows nothing."""
    words = ("+experiment=traj4", "methods=[global,dynamic_programming]", "method.dynamic_programming.nodes=90")
    config = composed(*words, "method.global.candidates=3", "method.global.optimised=1", "method.global.solver=newton")
    problem = prepare(config)
    solutions, _ = solve(problem, config, Context())
    planned = [solution for solution in solutions if solution.method == "global"]
    assert costs(problem, planned)[0] == pytest.approx(0.02301, abs=5e-6)
    assert costs(problem, planned)[-1] > 0.0303
    assert planned[0].statistics["continued_from"] == "dynamic_programming"
