"""The front of the Global paper's Fig. 14 problem, on fewer knots and with fewer starts than the paper's."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pandas as pd
import pytest
from hydra import compose, initialize_config_dir

from pipeline.build.problem import prepare
from pipeline.common.workers import Workers
from pipeline.config.compose import checked
from pipeline.config.methods import GlobalOptions, ParetoOptions
from pipeline.evaluation.evaluation import Evaluation, evaluate
from pipeline.methods.global_planner.planner import global_planner
from pipeline.methods.method import Context
from pipeline.methods.pareto import pareto
from pipeline.problem.objective import Objective
from pipeline.problem.problem import Problem
from pipeline.problem.solution import Status
from pipeline.program.transcription import transcribe
from pipeline.run.main import CONF
from pipeline.studies import front

FEW = GlobalOptions(configurations=10, candidates=60, optimised=4)
OPTIONS = ParetoOptions(steps=3, planner=FEW)


@pytest.fixture(scope="module")
def problem() -> Problem:
    with initialize_config_dir(CONF, version_base="1.3"):
        return prepare(checked(compose("config", overrides=["+experiment=pareto", "timing.steps=18"])))


@pytest.fixture(scope="module")
def evaluations(problem: Problem) -> list[Evaluation]:
    return [evaluate(problem, solution) for solution in pareto(problem, OPTIONS)]


@pytest.fixture(scope="module")
def table(evaluations: list[Evaluation]) -> pd.DataFrame:
    return front.table(evaluations)


@pytest.mark.slow
def test_the_ends_are_the_single_objective_optima(problem: Problem, table: pd.DataFrame) -> None:
    for name, row in (("kinetic_energy", table.iloc[0]), ("torque", table.iloc[-1])):
        alone = global_planner(replace(problem, objective=Objective({name: 1.0})), FEW)[0]
        found = evaluate(problem, alone)
        best = found.energy_integral[-1] if name == "kinetic_energy" else found.torque_integral[-1]
        assert row["extreme"]
        assert row[name] == pytest.approx(best, rel=1e-6)


@pytest.mark.slow
def test_no_reported_point_is_dominated_and_every_bound_is_met(table: pd.DataFrame) -> None:
    assert len(table) == 2 * OPTIONS.steps
    good = table[table["status"] == "optimal"]
    assert len(good) >= 2 * OPTIONS.steps - 1
    values = good[["kinetic_energy", "torque"]].to_numpy()
    for i, value in enumerate(values):
        assert not any((other < value * (1 - 1e-6)).all() for j, other in enumerate(values) if j != i)
    assert table["bound_excess"].dropna().max() <= 1e-6
    assert (table["bound_excess"].dropna() > -1e-3).all()  # a bound that does not bind states no trade
    assert good["knee"].sum() == 1
    assert set(good["direction"]) == {"minimise:kinetic_energy", "minimise:torque"}


@pytest.mark.slow
def test_limits_and_path_are_kept_by_every_point(problem: Problem, evaluations: list[Evaluation]) -> None:
    for e in evaluations:
        assert e.status is Status.SOLVED
        assert e.tracking_error.max() <= 1e-8
        assert np.abs(e.qd).max() <= 3.8 * (1 + 1e-6)
        assert (e.q <= problem.bounds.upper + 1e-6).all()
        assert (e.q >= problem.bounds.lower - 1e-6).all()


@pytest.mark.slow
def test_the_front_does_not_depend_on_the_workers(problem: Problem, evaluations: list[Evaluation]) -> None:
    again = pareto(problem, OPTIONS, Context(workers=Workers(2)))
    for solution, e in zip(again, evaluations, strict=True):
        np.testing.assert_array_equal(solution.trajectory.q, e.q)


@pytest.mark.slow
def test_weighting_gives_points_that_the_epsilon_constraint_does_not_beat(
    problem: Problem, table: pd.DataFrame
) -> None:
    weighted = front.table([evaluate(problem, s) for s in pareto(problem, replace(OPTIONS, method="weighting"))])
    assert len(weighted) == len(table)
    both = pd.concat([table, weighted])[["kinetic_energy", "torque"]].to_numpy()
    assert not front.dominated(both)[len(table) :].any()


@pytest.mark.slow
def test_a_bounded_integral_is_met_exactly(problem: Problem) -> None:
    """Bound the energy between its optimum and what the least torques need: the bound binds."""
    start = global_planner(problem, replace(FEW, optimised=2))[0].trajectory.q
    free = evaluate(problem, global_planner(problem, replace(FEW, optimised=2))[0])
    bound = 1.05 * free.energy_integral[-1]
    stated = replace(problem, objective=Objective({"torque": 1.0}), bounds_of_integrals={"kinetic_energy": bound})
    q, outcome, _ = transcribe(stated, problem.times, start).solve()
    assert outcome.converged
    solution = replace(free.solution, trajectory=replace(free.solution.trajectory, q=q))
    assert evaluate(problem, solution).energy_integral[-1] == pytest.approx(bound, rel=1e-6)


@pytest.mark.slow
def test_an_extreme_that_cannot_be_found_is_said(problem: Problem) -> None:
    tight = replace(problem, limits=replace(problem.bounds, velocity=np.full(3, 0.5)))
    (answer,) = pareto(tight, replace(OPTIONS, planner=replace(FEW, optimised=2, candidates=20)))
    assert answer.status is Status.INFEASIBLE
    assert "extreme of kinetic_energy" in answer.message
    assert "velocity limit" in answer.message
