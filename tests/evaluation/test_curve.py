"""What is judged between the knots: the curve that is exported, against the tolerance of the path."""

from __future__ import annotations

import re
from dataclasses import replace

import numpy as np
import pytest
from scipy.interpolate import CubicSpline

from pipeline.build.problem import prepare
from pipeline.common.arrays import Array
from pipeline.evaluation.evaluation import evaluate
from pipeline.model.kinematics import project
from pipeline.problem.curve import curve, end_speeds, turns_of_cycle
from pipeline.problem.problem import Problem
from pipeline.problem.solution import Solution, Status, Trajectory
from tests.support import composed

TWENTY_TURNS = ("path=circle", "path.radius=0.05", "path.angle=7200")


def on_knots(problem: Problem) -> Solution:
    """A motion that is on the path at every knot."""
    q = [problem.q_init]
    for target in problem.reference.position(problem.times)[1:]:
        q.append(project(problem.task, q[-1][None], target[None])[0][0])
    return Solution("global", Trajectory(problem.times, np.array(q)), Status.SOLVED, tracking_tolerance=1e-6)


def independent_error(problem: Problem, q: Array) -> float:
    """Largest distance from the circle's reference, of the clamped spline, by the arm's own kinematics."""
    t = np.linspace(0.0, problem.reference.duration, 20 * len(q))
    motion = CubicSpline(problem.times, q, bc_type="clamped")(t)
    return float(np.linalg.norm(problem.task.error(motion, problem.reference.position(t)), axis=1).max())


@pytest.mark.slow
def test_a_grid_too_coarse_for_its_path_is_not_solved_and_the_advised_one_is() -> None:
    problem = prepare(composed(*TWENTY_TURNS))
    judged = evaluate(problem, on_knots(problem))
    assert judged.status is Status.UNCONFIRMED
    assert not judged.on_path
    assert judged.tracking_error.max() < 1e-9
    assert judged.tracking_error_between == pytest.approx(independent_error(problem, judged.q), rel=0.1)
    assert judged.tracking_error_between > 0.02
    found = re.search(r"more than path\.tolerance = 0\.0001 m; timing\.steps = (\d+) would do", judged.message)
    assert found is not None
    finer = prepare(composed(*TWENTY_TURNS, f"timing.steps={found.group(1)}"))
    again = evaluate(finer, on_knots(finer))
    assert again.status is Status.SOLVED
    assert again.on_path
    assert int(found.group(1)) < 1500


def test_the_tolerance_is_that_of_the_configuration() -> None:
    problem = prepare(composed("path=circle", "path.radius=0.05", "timing.steps=10", "path.tolerance=1e-7"))
    solution = on_knots(problem)
    assert evaluate(problem, solution).status is Status.UNCONFIRMED
    loose = replace(problem, reference=replace(problem.reference, tolerance=0.01))
    assert evaluate(loose, solution).status is Status.SOLVED
    certificate = evaluate(problem, replace(solution, knots_only=True))
    assert certificate.status is Status.SOLVED
    assert "promises its knots alone" in certificate.message


@pytest.mark.slow
def test_a_drift_within_the_promise_is_said() -> None:
    problem = prepare(composed("path.length=0.1", "timing.steps=40"))
    solution = on_knots(problem)
    drifted = solution.trajectory.q + 1e-3 * np.linspace(0, 1, 41)[:, None]
    judged = evaluate(
        problem, replace(solution, trajectory=Trajectory(problem.times, drifted), tracking_tolerance=0.01)
    )
    assert judged.status is Status.SOLVED
    assert re.search(r"^up to 0\.00\d+ m off its path, within what it promises at its knots", judged.message)
    assert not judged.on_path


def test_a_cycle_closes_up_to_full_turns_of_joints_without_limits() -> None:
    problem = prepare(composed("path=circle", "boundary=cyclic", "timing.steps=12"))
    turn = np.linspace(0.0, 2 * np.pi, 13)
    q = problem.q_init + np.column_stack([turn + 0.1 * np.sin(turn), 0.2 * np.sin(turn), 0.3 * np.cos(turn)])
    np.testing.assert_allclose(turns_of_cycle(problem, q), [2 * np.pi, 0, 0])
    smooth = curve(problem, problem.times, q)
    np.testing.assert_allclose(smooth(problem.times), q, atol=1e-12)
    for order in (1, 2):
        np.testing.assert_allclose(smooth(problem.times[0], order), smooth(problem.times[-1], order), atol=1e-9)
    limited = prepare(composed("path=circle", "boundary=cyclic", "limits.upper=9", "limits.lower=-9"))
    assert turns_of_cycle(limited, q) is None


def test_at_which_speeds_a_motion_begins_and_ends() -> None:
    """Knots along a cubic: its own speeds at its ends. A cycle of sines: that at which it comes round."""
    problem = prepare(composed("path=circle", "timing.steps=12"))
    t = problem.times
    q = np.column_stack([t, 1 - t**2, 0.1 * t**3])
    ends = [[1.0, 0.0, 0.0], [1.0, -2 * t[-1], 0.3 * t[-1] ** 2]]
    np.testing.assert_allclose(end_speeds(problem, Trajectory(t, q)), ends, atol=1e-9)
    again = prepare(composed("path=circle", "timing.steps=48", "boundary=cyclic"))
    t, rate = again.times, 2 * np.pi / again.times[-1]
    q = np.column_stack([0.1 * np.sin(rate * t), 0.2 * np.cos(rate * t), 0 * t])
    np.testing.assert_allclose(end_speeds(again, Trajectory(t, q)), [[0.1 * rate, 0, 0]] * 2, rtol=1e-4, atol=1e-9)
    flying = prepare(composed("path=circle", "timing.steps=48", "boundary=cyclic", "timing=constant_speed"))
    np.testing.assert_array_equal(end_speeds(flying, Trajectory(t, q)), np.zeros((2, 3)))
