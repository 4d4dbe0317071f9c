"""Dynamic programming on the self-motion manifold, against known optima and its own guarantees."""

from __future__ import annotations

import re
from dataclasses import replace

import numpy as np
import pytest

from pipeline.build.problem import prepare
from pipeline.common.errors import InputError
from pipeline.config.methods import DynamicProgrammingOptions
from pipeline.evaluation.evaluation import evaluate
from pipeline.methods import dynamic_programming as module
from pipeline.methods.dynamic_programming import dynamic_programming
from pipeline.path.curves import circle
from pipeline.path.reference import Reference
from pipeline.path.timing import RaisedCosine
from pipeline.problem.limits import Limits
from pipeline.problem.objective import Objective
from pipeline.problem.problem import Boundary, Problem
from pipeline.problem.solution import Solution, Status, Trajectory
from pipeline.search.bellman import forward, minima, paths, round_trips, starts
from pipeline.search.grid import make_grid
from tests.support import ROOT, backward_differences, composed, free_line

ROBOT = ROOT / "robots" / "planar3r.urdf"
Q_INIT = np.array([0.0, 0.327, -0.754])
# The 12-interval optima of the independent exact-Hessian program (tests/benchmarks/peer.py) with a free start.
OPTIMA_12 = [0.052714, 0.058123, 0.059642, 0.069770]
BEST_25 = 0.052959


@pytest.fixture(scope="module")
def line() -> Problem:
    return free_line(100)


@pytest.fixture(scope="module")
def limits() -> Limits:
    """Global paper, Table 2: displacement and velocity."""
    reach, free = np.deg2rad([90.0, 120.0, 120.0]), np.full(3, np.inf)
    return Limits(-reach, reach, np.full(3, 3.8), free, free)


def test_all_optima_are_among_the_starts(line: Problem) -> None:
    times = np.linspace(0, 1, 13)
    motions = starts(line, times, 180)
    x_ref = np.tile(line.reference.position(times), (len(motions), 1))
    assert np.abs(line.task.value(motions.reshape(-1, 3)) - x_ref).max() < 1e-10
    costs = backward_differences(line, times, motions)
    assert (np.diff(costs) >= 0).all()
    for optimum in OPTIMA_12:
        assert np.any((costs > optimum) & (costs < 1.02 * optimum))


@pytest.mark.slow
def test_second_order_from_above(line: Problem) -> None:
    """The excess over the 12-interval optimum is positive and falls with the square of the node spacing."""
    times = np.linspace(0, 1, 13)
    sizes = [90, 180, 360, 720]
    excess = []
    for nodes in sizes:
        grid = make_grid(line, times, nodes)
        excess.append(forward(grid, np.zeros(len(grid.layers[0].q)))[0].min() - OPTIMA_12[0])
    assert min(excess) > 0
    order = -np.polyfit(np.log(sizes), np.log(excess), 1)[0]
    assert 1.6 < order < 2.4


@pytest.fixture(scope="module")
def found(line: Problem) -> list[Solution]:
    return dynamic_programming(line, DynamicProgrammingOptions())


def test_the_least_cost_on_the_grid_and_its_error(line: Problem, found: list[Solution]) -> None:
    told = found[0].statistics
    on_grid = starts(line, np.linspace(0, 1, 26), 360)
    assert backward_differences(line, np.linspace(0, 1, 26), on_grid)[0] == pytest.approx(told["cost"], rel=1e-9)
    assert BEST_25 < told["cost"] < BEST_25 + told["grid_error"]
    assert set(told["loops"]) == {1, 2}
    assert (told["intervals"], told["paths"]) == (25, len(on_grid))


def test_a_path_is_a_motion_when_the_planner_has_finished_it(line: Problem, found: list[Solution]) -> None:
    """On the knots of the problem, with the optima that the Global paper prints; the grid's paths leave theirs."""
    grid = line.times[::4]
    raw = Solution("dynamic_programming", Trajectory(grid, starts(line, grid, 360)[0]), Status.SOLVED)
    judged = [evaluate(line, solution) for solution in found]
    assert evaluate(line, raw).tracking_error_between > 100 * max(e.tracking_error_between for e in judged)
    assert all(e.status is Status.SOLVED for e in judged)
    assert all("confirmed by IPOPT" in solution.evidence for solution in found)
    costs = [backward_differences(line, line.times, s.trajectory.q[None])[0] for s in found]
    assert costs == sorted(costs)
    for printed in (0.0528, 0.0563, 0.0671):  # simulation 1
        assert np.abs(np.array(costs) - printed).min() < 1e-4


def test_a_path_that_is_lost_is_no_motion(line: Problem, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(module, "finish", lambda *arguments: (line.times, []))
    (only,) = dynamic_programming(line, DynamicProgrammingOptions(nodes=60, intervals=8))
    assert (only.found, only.status) == (False, Status.NOT_CONVERGED)
    assert re.fullmatch(r"none of the grid's \d+ paths leads to a motion on the problem's knots", only.message)


def test_fixed_start(line: Problem) -> None:
    (best, *_) = dynamic_programming(replace(line, boundary=Boundary.FIXED), DynamicProgrammingOptions())
    np.testing.assert_array_equal(best.trajectory.q[0], Q_INIT)
    # 0.06093 is the optimum on 101 points; 25 intervals and the nodes add a little.
    assert backward_differences(line, line.times, best.trajectory.q[None])[0] == pytest.approx(0.06093, abs=5e-6)
    assert 0.0609 < best.statistics["cost"] < 0.0635


@pytest.mark.slow
def test_limits_are_kept(line: Problem, limits: Limits) -> None:
    tight = replace(limits, velocity=np.full(3, 3.2))
    free, limited = (
        dynamic_programming(replace(line, limits=bounds), DynamicProgrammingOptions())[0] for bounds in (limits, tight)
    )
    for solution, bounds in ((free, limits), (limited, tight)):
        q = solution.trajectory.q
        velocity = np.diff(q, axis=0) / np.diff(solution.trajectory.time)[:, None]
        assert (np.abs(velocity) <= bounds.velocity * (1 + 1e-6)).all()
        assert ((q >= bounds.lower - 1e-8) & (q <= bounds.upper + 1e-8)).all()
    assert 0.0528 < free.statistics["cost"] < 0.0540  # simulation 2: 0.0528
    assert limited.statistics["cost"] > free.statistics["cost"]


def test_impossible_limits(line: Problem, limits: Limits) -> None:
    (only,) = dynamic_programming(
        replace(line, limits=replace(limits, velocity=np.full(3, 0.1))), DynamicProgrammingOptions(nodes=90)
    )
    assert only.status is Status.INFEASIBLE
    assert "keeps the limits" in only.message


@pytest.mark.slow
def test_cyclic(line: Problem, limits: Limits) -> None:
    """Global paper, simulation 5 (printed 0.0554), and the cheaper posture that its velocity limit excludes."""
    start = line.task.value(Q_INIT[None])[0]
    reference = Reference(circle(start, 180.0, 0.05), RaisedCosine(1.0))
    problem = replace(line, reference=reference, boundary=Boundary.CYCLIC)
    best = dynamic_programming(replace(problem, limits=limits), DynamicProgrammingOptions())[0]
    np.testing.assert_allclose(best.trajectory.q[-1], best.trajectory.q[0], atol=1e-12)
    assert best.statistics["cost"] == pytest.approx(0.0554, abs=best.statistics["grid_error"])
    free = dynamic_programming(problem, DynamicProgrammingOptions())[0]
    assert 0.0378 < free.statistics["cost"] < 0.0386


def test_cyclic_search_agrees_with_every_start(line: Problem) -> None:
    start = line.task.value(Q_INIT[None])[0]
    problem = replace(
        line, reference=Reference(circle(start, 180.0, 0.05), RaisedCosine(1.0)), boundary=Boundary.CYCLIC
    )
    grid = make_grid(problem, np.linspace(0, 1, 9), 60)
    every = round_trips(grid, np.arange(len(grid.layers[0].q)))
    assert paths(grid, Boundary.CYCLIC)[1].min() == pytest.approx(every.min(), rel=1e-12)


def test_minima_wrap_around_each_loop() -> None:
    value = np.array([1.0, 2.0, 3.0, 2.0, 5.0, np.inf, 4.0, 6.0])
    np.testing.assert_array_equal(minima(value, (4, 4)), [0, 4, 6])


def test_unsupported(line: Problem) -> None:
    with pytest.raises(InputError, match="first order"):
        dynamic_programming(replace(line, objective=Objective({"torque": 1.0})), DynamicProgrammingOptions())
    with pytest.raises(InputError, match="does not end where it starts"):
        dynamic_programming(replace(line, boundary=Boundary.CYCLIC), DynamicProgrammingOptions())


def test_the_grid_error_where_half_the_nodes_have_the_same_path() -> None:
    """Case 1 of the Pontryagin report: halving shows nothing, and the grid is 1.4 % above the optimum (0.1529169658 by
    direct transcription and by the two-point boundary value problem).
    """
    problem = prepare(composed("+experiment=case1"))
    found = dynamic_programming(problem, DynamicProgrammingOptions(nodes=360))[0].statistics
    assert found["cost"] > 1.01 * 0.1529169658
    assert found["cost"] - found["grid_error"] == pytest.approx(0.1529169658, rel=1e-3)
