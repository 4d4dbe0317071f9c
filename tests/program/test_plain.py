"""The program in positions alone, and what IPOPT says on it of optima and of motions that are none."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from pipeline.build.problem import prepare
from pipeline.common.arrays import Array
from pipeline.problem.costs import objective_values
from pipeline.problem.limits import Limits
from pipeline.problem.problem import Problem
from pipeline.program.confirm import Confirm
from pipeline.program.newton.serve import Solver
from pipeline.program.plain import Plain
from pipeline.program.scaling import POSITION_SCALE
from pipeline.search.roadmap import Roadmap
from tests.support import composed, differences

FEW = ("timing.steps=12",)


def optimum(problem: Problem) -> tuple[Array, float]:
    """A motion (N + 1, n) and its cost."""
    starts = Roadmap(problem, problem.times, np.random.default_rng(1), nodes=60).cheapest(4)
    answer = Solver(problem).on(problem.times).solve(starts)
    best = int(np.argmin(np.where(answer.converged, answer.cost, np.inf)))
    return answer.q[best], float(answer.cost[best])


@pytest.fixture(scope="module")
def free() -> Problem:
    return prepare(composed("+experiment=sim1", *FEW))


def test_its_cost_and_its_gradient(free: Problem, rng: np.random.Generator) -> None:
    """The documents' sum on any motion, over more than one binding, divided by the cost it is told."""
    problem = replace(free, times=np.linspace(0, 2, 30))
    q = 0.3 * rng.normal(size=(30, 3))
    program = Plain(problem, problem.times, q)
    program.cost = 2.0

    def cost(x: Array) -> Array:
        parts = [b.evaluator().Eval(x[program.drake.FindDecisionVariableIndices(b.variables())]) for b in costs]
        return np.array([sum(float(part[0]) for part in parts)])

    costs, x = program.drake.GetAllCosts(), POSITION_SCALE * q.ravel()
    assert len(costs) > 1
    assert cost(x)[0] == pytest.approx(objective_values(problem, problem.times, q[None])[0] / 2, rel=1e-12)
    gradient = np.zeros(len(x))
    for binding in costs:
        part = program.drake.FindDecisionVariableIndices(binding.variables())
        gradient[part] += program.functions[binding.evaluator()].at(x[part])[1]
    exact = differences(cost, x, 1e-6)[0]
    np.testing.assert_allclose(gradient, exact, atol=1e-6 * np.abs(exact).max())


@pytest.mark.slow
@pytest.mark.parametrize("words", [("+experiment=traj3",), ("+experiment=sim1",), ("+experiment=panda_pose",)])
def test_ipopt_stops_at_once_at_an_optimum(words: tuple[str, ...]) -> None:
    """panda_pose: without the velocity limits and the arm itself, which it does not reach; its positions stay limited,
    and the planner leaves the arm itself out too where it is not reached.
    """
    problem = prepare(composed(*words, *FEW))
    bounds, free = problem.bounds, np.full(problem.task.arm.n, np.inf)
    problem = replace(problem, limits=Limits(bounds.lower, bounds.upper, free, free, free), own=None)
    q, cost = optimum(problem)
    told = Confirm(problem, problem.times, 1e-8, 20)(q, cost)
    assert Plain.serves(problem)
    assert told.converged
    assert told.iterations == 0
    assert told.moved < 1e-9
    assert max(told.violation, told.optimality) < 1e-6


def test_a_position_limit_is_a_bound(free: Problem) -> None:
    """Below what the second joint takes without it: it holds, and IPOPT finds its multiplier."""
    q, cost = optimum(free)
    wall = np.full(3, np.inf)
    wall[1] = q[:, 1].max() - 0.05
    problem = replace(free, limits=Limits(np.full(3, -np.inf), wall, *np.full((3, 3), np.inf)))
    answer = Solver(problem).on(problem.times).solve(q[None])
    assert answer.cost[0] > cost
    told = Confirm(problem, problem.times, 1e-8, 20)(answer.q[0], float(answer.cost[0]))
    assert told.iterations <= 2
    assert told.moved < 1e-6
    assert max(told.violation, told.optimality) < 1e-6
    assert wall[1] - 1e-6 < told.q[:, 1].max() <= wall[1]


def test_what_is_no_optimum_is_ipopts_to_move(free: Problem) -> None:
    """The plain program is given up after two iterations, and the lifted one leads back."""
    q, cost = optimum(free)
    along = free.task.error_and_jacobian(q, free.reference.position(free.times))[1]
    aside = q + 0.05 * np.array([np.linalg.svd(rows)[2][-1] for rows in along])
    told = Confirm(free, free.times, 1e-8, 100)(aside, cost)
    assert told.converged
    assert told.iterations > 2
    assert told.moved > 0.01
    np.testing.assert_allclose(told.q, q, atol=1e-4)


def test_one_program_serves_only_cycles_that_wind_alike() -> None:
    problem = prepare(composed("+experiment=sim5", "limits=none", *FEW))
    q = np.zeros((13, 3))
    program = Plain(problem, problem.times, q)
    wound = q + np.linspace(0, 2 * np.pi, 13)[:, None] * [1.0, 0.0, 0.0]
    assert program.closes(q + 0.3)
    assert not program.closes(wound)
