"""Motion time against energy: every point its own law, each judged by it."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from pipeline.common.errors import InputError
from pipeline.config.methods import GlobalOptions, ParetoOptions
from pipeline.evaluation.evaluation import evaluate
from pipeline.methods.pareto import pareto
from pipeline.problem.limits import Limits
from pipeline.problem.problem import Problem
from pipeline.problem.solution import Status
from pipeline.studies.front import Front, draw, table
from tests.support import free_line

FEW = GlobalOptions(nodes=60, optimised=4, budget=4)
OPTIONS = ParetoOptions(objectives=("duration", "kinetic_energy"), steps=2, planner=FEW)


def line(**more: object) -> Problem:
    """Simulation 1's line on 12 intervals, which are few."""
    problem = free_line(12)
    limits = replace(Limits.none(3), velocity=np.full(3, 2.0), acceleration=np.full(3, 10.0))
    reference = replace(problem.reference, tolerance=0.01)
    asked = replace(problem, reference=reference, limits=limits, rest=(True, True), free_law=True)
    return replace(asked.slowed(3.0), **more)  # type: ignore[arg-type]


@pytest.mark.slow
def test_more_time_costs_less_and_each_point_keeps_its_limits() -> None:
    asked = line()
    solutions = pareto(asked, OPTIONS)
    motions = [evaluate(asked, one) for one in solutions]
    assert [motion.status for motion in motions] == [Status.SOLVED] * 3
    front = Front(table(motions))
    assert list(front.table["status"]) == ["optimal"] * 3
    assert front.objectives == ["duration", "kinetic_energy"]
    times, energies = (front.table[name].to_numpy() for name in front.objectives)
    assert times[0] == pytest.approx(3.0)
    assert times[1] == pytest.approx(np.sqrt(times[0] * times[2]))
    assert np.all(np.diff(energies) > 0)
    assert np.all(energies[:2] < 0.85 * 0.0527 / times[:2])  # the raised cosine costs that at 1 s, with no limits
    for motion in motions:
        assert max(motion.limit_excess_between.values()) <= 1e-6
    assert draw(front, "a front").axes[0].get_xlabel() == "motion time [s]"
    short = replace(asked, free_law=True).slowed(0.5 * times[2] / 3.0)
    (none,) = pareto(short, OPTIONS)
    assert none.status is Status.INFEASIBLE
    assert "is less than the shortest feasible duration" in none.message


@pytest.mark.parametrize("law", [{"free_law": False}, {"free_duration": True}])
def test_the_law_must_be_free_and_the_longest_time_given(law: dict[str, bool]) -> None:
    with pytest.raises(
        InputError, match=r"^pareto: method.pareto.objectives = \[duration, kinetic_energy\]: its points"
    ):
        pareto(line(**law), OPTIONS)
