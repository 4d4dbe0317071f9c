"""The planner's lots of starts, by any of its generators together, and when it stops drawing them."""

from __future__ import annotations

import numpy as np
import pytest

from pipeline.build.problem import prepare
from pipeline.common.errors import ConfigError
from pipeline.config.methods import GlobalOptions
from pipeline.evaluation.evaluation import evaluate
from pipeline.methods.global_planner.basins import basins
from pipeline.methods.global_planner.optimum import Optimum
from pipeline.methods.global_planner.planner import global_planner
from pipeline.methods.global_planner.ranking import in_order
from pipeline.methods.global_planner.starts import GENERATORS, Starts
from pipeline.problem.solution import Solution, Status, Trajectory
from tests.support import composed, free_line

SMALL = {"nodes": 40, "configurations": 4, "candidates": 20, "optimised": 6}


def lots(*names: str) -> Starts:
    problem = free_line(12)
    return Starts(problem, problem.times, GlobalOptions(starts=names, **SMALL), np.random.default_rng(1))


def test_any_list_of_generators_brings_the_starts_of_each() -> None:
    alone = {name: lots(name).first for name in GENERATORS}
    everything = lots(*GENERATORS)
    assert all(len(first) for first in alone.values())
    assert len(everything.first) == sum(map(len, alone.values()))
    np.testing.assert_array_equal(everything.first[: len(alone["roadmap"])], alone["roadmap"])
    np.testing.assert_array_equal(everything.first[-len(alone["dynamic_programming"]) :], alone["dynamic_programming"])
    assert {"roadmap_paths", "candidates", "dynamic_programming_paths"} <= set(everything.log)


@pytest.mark.parametrize(("names", "more"), [(["roadmap"], 8), (["population"], 8), (["dynamic_programming"], 0)])
def test_further_lots_are_new_where_there_are_more(names: list[str], more: int) -> None:
    drawn = lots(*names)
    problem, again = drawn.problem, drawn.further(8, drawn.grid)
    assert len(again) == more
    for q in again:
        error = problem.task.error(q, problem.reference.position(drawn.grid))
        assert np.abs(error).max() < 1e-5
        assert np.abs(drawn.first - q).max(axis=(1, 2)).min() > 1e-6


def test_a_word_that_is_no_generator_is_told() -> None:
    with pytest.raises(ConfigError, match="roadmap, population, dynamic_programming"):
        GlobalOptions(starts=["roadmap", "guesses"])
    with pytest.raises(ConfigError, match="roadmap, population, dynamic_programming"):
        composed("method.global.starts=both")
    assert composed("method.global.starts=[roadmap,population]").method.of("global").generators == (
        "roadmap",
        "population",
    )


def ends(*values: float | None, cost: float = 1.0) -> list[Optimum]:
    """Motions that stand on sim1's path shifted by so much in cost and joints; None: did not converge."""
    problem = free_line(12)
    q = np.tile(problem.q_init, (13, 1))
    return [Optimum(q + (v or 0.0), cost + (v or 0.0), v is not None, "") for v in values]


def test_distinct_optima_their_members_and_the_starts_that_brought_nothing_new() -> None:
    problem = free_line(12)
    found = basins(problem, problem.times, ends(0.5, 0.0, 0.01, None, 1.0, 0.5, 0.02, None), 0.05)
    assert [optimum.cost for optimum in found.optima] == [1.0, 1.5, 2.0]
    assert found.members == [3, 2, 1]
    assert found.barren == 3  # after the fifth
    assert basins(problem, problem.times, ends(None, None), 0.05).barren == 2
    near = basins(problem, problem.times, ends(0.5, 0.0, 0.01, None, 1.0), 0.05, dearest=1.8)
    assert [optimum.cost for optimum in near.optima] == [1.0, 1.5]
    assert near.barren == 3
    jumping = basins(problem, problem.times, ends(0.5, 0.0), 0.05, jumps=0.1)  # it stands still: far off its path
    assert (jumping.optima, jumping.jumping) == ([], 2)


@pytest.mark.slow
def test_drawing_ends_when_half_of_the_starts_brought_nothing_new_or_with_the_budget() -> None:
    problem = prepare(composed("+experiment=traj3", "timing.steps=25"))
    options = GlobalOptions(nodes=60, optimised=8)
    log = global_planner(problem, options)[0].statistics
    assert len(log["starts"]) >= 16
    assert 2 * log["barren_starts"] >= len(log["starts"]) or len(log["starts"]) == options.budget
    log = global_planner(problem, GlobalOptions(nodes=60, optimised=8, budget=11))[0].statistics
    assert len(log["starts"]) == 11


def test_whole_turns_are_one_optimum_and_the_first_start_of_a_basin_dates_it() -> None:
    problem = free_line(12)
    turned = basins(problem, problem.times, ends(0.0, 2 * np.pi), 0.05)
    assert turned.members == [2]
    found = basins(problem, problem.times, ends(0.01, 0.5, 0.0), 0.05)  # the best came last, to a basin known first
    assert [optimum.cost for optimum in found.optima] == [1.0, 1.5]
    assert found.barren == 1
    near = basins(problem, problem.times, ends(0.0, 0.5, 1.0, cost=2.0), 0.05, dearest=1.3)
    assert [optimum.cost for optimum in near.optima] == [2.0, 2.5]
    below = basins(problem, problem.times, ends(0.0, 0.5, 1.0, cost=-2.0), 0.05, dearest=1.3)  # as a criterion makes it
    assert [optimum.cost for optimum in below.optima] == [-2.0, -1.5]


def test_optima_are_ranked_by_the_integral_and_not_by_the_sum_on_their_knots() -> None:
    """The integrals are the evaluation's, which has a plant and a quadrature of its own."""
    drawn = lots("population")
    problem, motions = drawn.problem, drawn.first[:2]
    told = [
        evaluate(problem, Solution("global", Trajectory(problem.times, q), Status.SOLVED)).objective_spline
        for q in motions
    ]
    dear, cheap = np.argsort(told)[::-1]
    optima = [Optimum(motions[k], cost, True, "") for k, cost in ((dear, 1.0), (cheap, 1.01))]  # as sums mis-rank them
    (first, why), (second, moved) = in_order(problem, optima)
    assert (first, second) == (optima[1], optima[0])
    assert float(why.split(", ")[1].split(";")[0]) == pytest.approx(told[cheap], rel=0.01)
    assert why.endswith("by its sum on these knots, 1.01, it would be number 2")
    assert moved.endswith("it would be number 1")
    assert [said for _, said in in_order(problem, optima[::-1])] == ["", ""]


def test_further_starts_stand_on_the_knots_asked_for() -> None:
    drawn = lots("population")
    finer = np.linspace(0.0, drawn.grid[-1], 2 * len(drawn.grid) - 1)
    more = drawn.further(3, finer)
    assert 0 < len(more) <= 3
    assert more.shape[1:] == (len(finer), 3)
