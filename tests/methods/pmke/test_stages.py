from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from pipeline.build.problem import prepare
from pipeline.common.arrays import Array
from pipeline.evaluation.clearance import Clearance
from pipeline.evaluation.limits import limit_excess
from pipeline.methods.pmke.prediction import rollout, solve_window
from pipeline.methods.pmke.stages import Stages, why_not
from pipeline.problem.objective import Objective
from pipeline.problem.problem import Problem
from tests.support import composed, differences, with_shapes

TIMES = np.array([0.0, 0.2, 0.4, 0.6, 1.0, 1.5])


@pytest.fixture(scope="module", params=["panda_obstacle", "panda_pose_obstacle"])
def problem(request: pytest.FixtureRequest) -> Problem:
    """A window in the middle of the motion, which comes with a velocity; the ball where it is felt."""
    asked = prepare(composed(f"+experiment={request.param}"))
    rows = rollout(asked, asked.q_init, asked.reference.position(np.array([0.8, 1.0])))
    return replace(asked, q_init=rows[1], qd_init=(rows[1] - rows[0]) / 0.2, times=1.0 + TIMES)


@pytest.fixture(scope="module")
def guess(problem: Problem) -> Array:
    return np.vstack([problem.q_init, rollout(problem, problem.q_init, problem.reference.position(problem.times[1:]))])


def excess(problem: Problem, q: Array) -> dict[str, float]:
    qd = np.diff(q, axis=0) / np.diff(problem.times)[:, None]
    qdd = np.diff(np.vstack([problem.qd_init, qd]), axis=0) / np.diff(problem.times)[:, None]
    tau = problem.task.arm.inverse_dynamics(q[1:], qd, qdd)
    clearance = Clearance(problem.task.arm, problem.obstacles, problem.own)
    around, own = (float(clearance.smallest(pairs, q[1:]).min()) for pairs in (clearance.obstacles, clearance.own))
    return limit_excess(problem, q[1:], qd, tau, around, own=own, qdd=qdd)


def test_a_window_ends_where_ipopt_does(problem: Problem, guess: Array) -> None:
    stages = Stages(problem)
    answer = stages.solve(problem, guess, None)
    q, value, outcome, _ = solve_window(problem, problem.times, answer.q, 1e-9)
    assert answer.converged
    assert outcome.converged
    assert answer.cost == pytest.approx(value, rel=1e-6)
    np.testing.assert_allclose(answer.q, q, atol=1e-4)
    assert max(excess(problem, answer.q).values()) < 1e-9
    np.testing.assert_allclose(problem.task.error(q[1:], problem.reference.position(problem.times[1:])), 0, atol=1e-8)
    again = stages.solve(problem, answer.q, answer)
    assert again.iterations == 1
    np.testing.assert_allclose(again.q, answer.q, atol=1e-5)


def test_limits_that_bind_are_kept(problem: Problem, guess: Array) -> None:
    """Accelerations and velocities below the largest ones of the free motion."""
    free = Stages(problem).solve(problem, guess, None)
    qd = np.diff(free.q, axis=0) / np.diff(problem.times)[:, None]
    qdd = np.diff(np.vstack([problem.qd_init, qd]), axis=0) / np.diff(problem.times)[:, None]
    tight = replace(
        problem.bounds,
        velocity=np.full(7, 0.995 * np.abs(qd).max()),
        acceleration=np.full(7, 0.98 * np.abs(qdd).max()),
    )
    bound = replace(problem, limits=tight)
    answer = Stages(bound).solve(bound, free.q, None)
    assert answer.converged, answer.status
    kept = excess(bound, answer.q)
    assert max(kept.values()) < 1e-9
    assert max(kept["velocity"], kept["acceleration"]) > -1e-4, "no limit is felt: the test shows nothing"
    assert answer.cost > free.cost


def test_what_no_step_keeps_is_given_up(problem: Problem, guess: Array) -> None:
    impossible = replace(problem, limits=replace(problem.bounds, velocity=np.full(7, 1e-3)))
    answer = Stages(impossible).solve(impossible, guess, None)
    assert not answer.converged
    np.testing.assert_array_equal(answer.q, guess)


def test_what_is_not_served_is_said(problem: Problem) -> None:
    assert why_not(problem, 35) is None
    assert why_not(problem, 1000) == "more than 400 unknowns"
    assert "beside the kinetic energy" in str(why_not(replace(problem, objective=Objective({"torque": 1.0})), 35))


def test_derivatives_equal_central_differences(problem: Problem, guess: Array, rng: np.random.Generator) -> None:
    from pipeline.methods.pmke.stages import _Window
    from pipeline.program.newton import stencils

    bound = replace(
        problem,
        limits=replace(problem.bounds, acceleration=np.full(7, 3.0), jerk=np.full(7, 40.0), power=np.full(7, 20.0)),
        qdd_init=np.linspace(-1.0, 1.0, 7),
        rest=(False, True),
        task=replace(problem.task, arm=with_shapes("panda")),  # whose distance from the ball bends nowhere
        own=None,
    )
    window = _Window(Stages(bound), bound)
    x = guess[1:] + 0.02 * rng.normal(size=guess[1:].shape)
    flat = x.ravel()
    _, gradient, hessian, *_ = window._energy_second(x)
    expected = differences(lambda y: np.array(window.cost(y.reshape(x.shape))), flat)
    np.testing.assert_allclose(gradient.ravel(), expected, atol=1e-7 * np.abs(expected).max())
    expected = differences(lambda y: window._energy_second(y.reshape(x.shape))[1].ravel(), flat)
    np.testing.assert_allclose(hessian, expected, atol=1e-6 * np.abs(expected).max())
    values, by = window._rows_by(x)
    np.testing.assert_allclose(values, window.rows(x), atol=1e-13)
    expected = differences(lambda y: window.rows(y.reshape(x.shape)).ravel(), flat)
    got = stencils.dense(window.knots, by)[0]
    np.testing.assert_allclose(got, expected, atol=1e-6 * np.abs(expected).max())
