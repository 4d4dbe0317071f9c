"""Stationary motions of the kinetic-energy integral, against known energies, an independent integration, and optima."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from pipeline.common.errors import InputError
from pipeline.config.methods import CalculusOfVariationsOptions
from pipeline.methods.calculus_of_variations.stationary import calculus_of_variations
from pipeline.model.kinematics import project
from pipeline.model.task import PositionTask
from pipeline.problem.limits import Limits
from pipeline.problem.objective import Objective
from pipeline.problem.problem import Boundary, Problem
from pipeline.problem.solution import Solution
from pipeline.search.self_motion import tangent
from tests.support import ROOT, backward_differences, free_line

ROBOT = ROOT / "robots" / "planar3r.urdf"
Q_INIT = np.array([0.0, 0.327, -0.754])


@pytest.fixture(scope="module")
def line() -> Problem:
    return free_line(100)


@pytest.fixture(scope="module")
def stationary(line: Problem) -> list[Solution]:
    return calculus_of_variations(line, CalculusOfVariationsOptions(spacing=0.06, refinements=2, tolerance=1e-9))


@pytest.mark.slow
def test_six_stationary_motions_four_of_them_minima(line: Problem, stationary: list[Solution]) -> None:
    energies = [motion.statistics["integral"] for motion in stationary]
    np.testing.assert_allclose(energies, [0.0527173, 0.0560103, 0.0568004, 0.0665889, 0.1225733, 0.2178448], atol=1e-7)
    kinds = [motion.statistics["kind"] for motion in stationary]
    assert kinds == ["minimum"] * 4 + ["saddle"] * 2
    # The 101-point optima of the planner are the four minima: the sum of backward differences is of first order in dt.
    minima = np.array([motion.trajectory.q for motion in stationary[:4]])
    np.testing.assert_allclose(
        backward_differences(line, line.times, minima), [0.05282, 0.05637, 0.05727, 0.06711], atol=1e-5
    )
    # Why grids of up to 200 intervals show a fifth optimum (0.0769 at 101 points): the residual almost vanishes there.
    ((_, residual),) = stationary[0].statistics["near_misses"]
    assert abs(residual) < 2e-4


@pytest.mark.slow
def test_path_rest_and_transversality(line: Problem, stationary: list[Solution]) -> None:
    x_ref = line.reference.position(line.times)
    for motion in stationary:
        assert np.abs(line.task.value(motion.trajectory.q) - x_ref).max() < 1e-10
        assert abs(motion.statistics["residual"]) < 1e-8


@pytest.mark.slow
def test_an_independent_integration_agrees(line: Problem, stationary: list[Solution]) -> None:
    """Lagrange's equations with the multiplier from one linear system, n from inverse dynamics, by scipy."""
    task, n = line.task, 3

    def slope(t: float, y: np.ndarray) -> np.ndarray:
        q, qd = y[None, :n], y[None, n : 2 * n]
        jacobian = task.jacobian(q)[0]
        mass = np.array([task.arm.inverse_dynamics(q, 0 * q, unit[None])[0] for unit in np.eye(n)]).T
        bias = task.arm.inverse_dynamics(q, qd, 0 * qd)[0]
        ahead, behind = task.jacobian(q + 1e-6 * qd)[0], task.jacobian(q - 1e-6 * qd)[0]
        wanted = line.reference.sample(np.array([t]))[2][0] - (ahead - behind) @ qd[0] / 2e-6
        system = np.block([[mass, -jacobian.T], [jacobian, np.zeros((2, 2))]])
        qdd = np.linalg.solve(system, np.concatenate([-bias, wanted]))[:n]
        return np.concatenate([qd[0], qdd, [0.5 * qd[0] @ mass @ qd[0]]])

    best = stationary[0]
    start = np.concatenate([best.trajectory.q[0], np.zeros(n + 1)])
    result = solve_ivp(slope, (0, 1), start, method="RK45", rtol=1e-9, atol=1e-10)
    np.testing.assert_allclose(result.y[:n, -1], best.trajectory.q[-1], atol=1e-6)
    np.testing.assert_allclose(result.y[n : 2 * n, -1], 0, atol=1e-5)
    assert result.y[-1, -1] == pytest.approx(best.statistics["integral"], abs=1e-8)


@pytest.mark.slow
def test_neighbours_of_a_minimum_cost_more_and_some_of_a_saddle_less(line: Problem, stationary: list[Solution]) -> None:
    """A second look at `kind`: self-motions added to the motion, projected back onto the path."""
    fine = line.times
    shapes = [np.cos(k * np.pi * fine) for k in range(5)]
    x_ref = line.reference.position(fine)
    for motion in stationary:
        q = motion.trajectory.q
        null = tangent(line.task.jacobian(q))
        changed = [q] + [
            project(line.task, q + sign * 0.01 * shape[:, None] * null, x_ref)[0]
            for shape in shapes
            for sign in (-1, 1)
        ]
        cost = backward_differences(line, fine, np.array(changed))
        second = cost[1::2] + cost[2::2] - 2 * cost[0]
        if motion.statistics["kind"] == "minimum":
            assert (second > 0).all()
    assert motion.statistics["index"] >= 1


@pytest.mark.slow
def test_fixed_start(line: Problem) -> None:
    options = CalculusOfVariationsOptions(spacing=0.1, refinements=1, tolerance=1e-8, max_speed=4.0)
    motions = calculus_of_variations(replace(line, boundary=Boundary.FIXED), options)
    best = motions[0]
    assert best.statistics["kind"] == "minimum"
    np.testing.assert_array_equal(best.trajectory.q[0], Q_INIT)
    # In 1 s instead of 10 s: 0.06093 on 101 points is the optimum of trajectory 3 of the PMKE paper (6.093e-3).
    assert best.statistics["integral"] == pytest.approx(0.060629, abs=1e-6)
    assert backward_differences(line, line.times, best.trajectory.q[None])[0] == pytest.approx(0.06093, abs=1e-5)


def test_unsupported(line: Problem) -> None:
    bounded = replace(Limits.none(3), velocity=np.full(3, 3.8))
    for problem, word in (
        (replace(line, boundary=Boundary.CYCLIC), "cyclic"),
        (replace(line, limits=bounded), "limits"),
        (replace(line, objective=Objective({"torque": 1.0})), "torque"),
        (replace(line, task=PositionTask(line.task.arm, ("x",))), "redundancy"),
    ):
        with pytest.raises(InputError, match=word):
            calculus_of_variations(problem, CalculusOfVariationsOptions())
