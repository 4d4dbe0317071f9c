from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest

from pipeline.common.arrays import Array
from pipeline.common.errors import InputError
from pipeline.config.methods import LsvOptions
from pipeline.evaluation.evaluation import evaluate
from pipeline.methods.lsv import inertia_weighted, lsv
from pipeline.methods.method import Method
from pipeline.problem.problem import Problem
from pipeline.problem.solution import Solution, Status

Make = Callable[[int, int], Problem]


def drift(problem: Problem, solution: Solution) -> float:
    return float(evaluate(problem, solution).tracking_error.max())


@pytest.mark.slow
@pytest.mark.parametrize(("integrator", "order"), [("euler", 1), ("heun", 2)])
@pytest.mark.parametrize("number", [1, 2])
def test_order_of_the_integrator(problem: Make, integrator: str, order: int, number: int) -> None:
    asked = problem(number, 100)

    def motion(dt: float, integrator: str = integrator) -> Array:
        """At every 0.2 s; at the end of a closed path alone errors cancel."""
        q = lsv(asked, LsvOptions(dt=dt, integrator=integrator))[0].trajectory.q
        return q[:: round(0.2 / dt)]

    exact = motion(0.005, "heun")
    errors = np.array([np.abs(motion(dt) - exact).max() for dt in (0.1, 0.05, 0.025)])
    np.testing.assert_allclose(np.log2(errors[:-1] / errors[1:]), order, atol=0.25)


def test_velocities_are_the_least_that_follow_the_path(problem: Make) -> None:
    """Along the motion qd is the pseudoinverse solution: it has no component in the null space of J."""
    asked = problem(1, 100)
    motion = lsv(asked, LsvOptions(dt=0.01))[0].trajectory
    middle, qd = (motion.q[1:] + motion.q[:-1]) / 2, np.diff(motion.q, axis=0) / 0.01
    null = np.linalg.svd(asked.task.jacobian(middle))[2][:, -1]
    speed = np.linalg.norm(qd, axis=1)
    assert np.abs((null * qd).sum(axis=1)).max() < 1e-4 * speed.max()
    _, xd, _ = asked.reference.sample((motion.time[1:] + motion.time[:-1]) / 2)
    np.testing.assert_allclose((asked.task.jacobian(middle) @ qd[:, :, None])[:, :, 0], xd, atol=1e-5)


@pytest.mark.parametrize("number", [1, 2])
def test_the_gain_takes_the_drift_away(problem: Make, number: int) -> None:
    asked = problem(number, 100)
    free, weak, strong = (
        drift(asked, lsv(asked, LsvOptions(dt=0.05, integrator="euler", gain=k))[0]) for k in (0.0, 1.0, 10.0)
    )
    assert strong < 0.15 * free
    assert strong < weak < 0.7 * free


@pytest.mark.parametrize("method", [lsv, inertia_weighted])
def test_a_gain_too_large_for_the_step_is_refused(problem: Make, method: Method) -> None:
    """Below 2 / dt the error still dies out, from there on it grows."""
    asked = problem(1, 100)
    below = evaluate(asked, method(asked, LsvOptions(dt=0.05, gain=36.0))[0])
    assert below.status is Status.SOLVED
    with pytest.raises(InputError, match=rf"method\.{method.name}\.gain = 40 1/s diverges: .* below 2 / dt = 40 1/s"):
        method(asked, LsvOptions(dt=0.05, gain=40.0))
    with pytest.raises(InputError, match=r"by -1\.5"):
        method(asked, LsvOptions(dt=0.05, gain=50.0))


@pytest.mark.parametrize("dt", [0.03, 20.0])
def test_steps_that_do_not_divide_the_motion_still_end_with_it(problem: Make, dt: float) -> None:
    asked = problem(1, 100)
    time = lsv(asked, LsvOptions(dt=dt))[0].trajectory.time
    assert (time[0], time[-1]) == (0.0, 10.0)
    assert np.ptp(np.diff(time)) < 1e-12


def test_a_singularity_has_its_time(problem: Make) -> None:
    asked = problem(3, 100)
    solution = lsv(asked)[0]
    assert solution.status is Status.SINGULAR
    assert solution.event_time is not None
    jacobian = asked.task.jacobian(solution.trajectory.q)
    values = np.linalg.svd(jacobian, compute_uv=False)
    at = int(np.argmin(values[:, 1] / values[:, 0]))
    assert solution.event_time == pytest.approx(solution.trajectory.time[at], abs=0.011)
    assert f"{solution.event_time:.2f} s" in solution.message


@pytest.mark.slow
def test_the_threshold_decides_what_is_singular(problem: Make) -> None:
    asked = problem(1, 100)
    calm = lsv(asked)[0]
    assert calm.status is Status.SOLVED
    smallest = float(calm.statistics["smallest_singular_value_ratio"])
    assert lsv(asked, LsvOptions(singular_value=1.01 * smallest))[0].status is Status.SINGULAR
    assert lsv(asked, LsvOptions(singular_value=0.99 * smallest))[0].status is Status.SOLVED


def test_too_much_drift_is_not_confirmed(problem: Make) -> None:
    asked = problem(2, 100)
    options = LsvOptions(dt=0.5, integrator="euler")
    far = drift(asked, lsv(asked, options)[0])
    assert evaluate(asked, lsv(asked, replace(options, max_drift=0.9 * far))[0]).status is Status.UNCONFIRMED
    assert evaluate(asked, lsv(asked, replace(options, max_drift=1.1 * far))[0]).status is Status.SOLVED
