from __future__ import annotations

import gc
import weakref
from collections.abc import Callable

import numpy as np
import pytest
from pydrake.autodiffutils import ExtractGradient, InitializeAutoDiff

from pipeline.common.arrays import Array
from pipeline.methods.pmke.window import Window
from pipeline.model.kinematics import project
from pipeline.model.task import PositionTask
from pipeline.path.reference import Reference
from pipeline.problem.lagrangian import Lagrangian
from pipeline.problem.objective import Objective
from tests.benchmarks import peer as peer_program
from tests.support import differences


def rollout(task: PositionTask, q: Array, x_ref: Array) -> Array:
    rows = [q[None]]
    for point in x_ref:
        rows.append(project(task, rows[-1], point[None])[0])
    return np.concatenate(rows[1:])


@pytest.mark.parametrize("horizon", [1, 2, 5])
def test_derivatives_equal_central_differences(
    task: PositionTask,
    reference: Callable[[int], Reference],
    q_init: Array,
    horizon: int,
    rng: np.random.Generator,
) -> None:
    window = Window(Lagrangian(task, Objective()), horizon, 0.7)
    x_ref = reference(3).position(2.0 + 0.7 * np.arange(1, horizon + 1))
    window.solve(q_init, x_ref, rollout(task, q_init, x_ref))
    cost, rows = window.program.generic_costs()[0], window.program.generic_constraints()[0]
    w = rng.normal(size=3 * horizon)
    for evaluator in (cost.evaluator(), rows.evaluator()):
        gradient = ExtractGradient(evaluator.Eval(InitializeAutoDiff(w).ravel()))
        expected = differences(evaluator.Eval, w)
        np.testing.assert_allclose(gradient, expected, atol=1e-7 * np.abs(expected).max())


@pytest.mark.parametrize("horizon", [1, 2, 5])
@pytest.mark.parametrize("number", [2, 3])
def test_the_optimum_is_the_peers(
    task: PositionTask,
    reference: Callable[[int], Reference],
    peer: object,
    q_init: Array,
    horizon: int,
    number: int,
) -> None:
    x_ref = reference(number).position(1.0 * np.arange(1, horizon + 1))
    guess = rollout(task, q_init, x_ref)
    window = Window(Lagrangian(task, Objective()), horizon, 1.0)
    q, energy, outcome, iterations = window.solve(q_init, x_ref, guess, tolerance=1e-9)
    program = peer_program.kinetic_energy_program(peer.arm, horizon, 1.0, 1e-12)  # type: ignore[attr-defined]
    q_peer, energy_peer, _ = peer_program.solve(program, q_init, x_ref, guess)
    assert outcome.converged
    assert 0 <= iterations < 50
    assert energy == pytest.approx(energy_peer, rel=1e-7)
    np.testing.assert_allclose(q, q_peer, atol=1e-5)
    np.testing.assert_allclose(task.value(q), x_ref, atol=1e-8)


def test_one_window_serves_many_problems(
    task: PositionTask, reference: Callable[[int], Reference], q_init: Array
) -> None:
    window = Window(Lagrangian(task, Objective()), 2, 1.0)
    answers = []
    for number in (3, 2, 3):
        x_ref = reference(number).position(np.array([3.0, 4.0]))
        answers.append(window.solve(q_init, x_ref, rollout(task, q_init, x_ref)))
    np.testing.assert_array_equal(answers[0][0], answers[2][0])
    assert answers[0][3] == answers[2][3]
    assert np.abs(answers[0][0] - answers[1][0]).max() > 0.01


def test_a_path_that_has_not_begun_leaves_the_arm_at_rest(task: PositionTask, q_init: Array) -> None:
    x_ref = np.tile(task.value(q_init[None]), (3, 1))
    q, energy, outcome, _ = Window(Lagrangian(task, Objective()), 3, 1.0).solve(q_init, x_ref, np.tile(q_init, (3, 1)))
    assert outcome.converged
    np.testing.assert_allclose(q, np.tile(q_init, (3, 1)), atol=1e-9)
    assert energy < 1e-15


def test_a_window_is_gone_when_nobody_has_it(
    task: PositionTask, reference: Callable[[int], Reference], q_init: Array
) -> None:
    """What it has given to Drake must not hold it, and with it the arm and its plants, for the whole process."""
    window = Window(Lagrangian(task, Objective()), 2, 1.0)
    x_ref = reference(3).position(np.array([1.0, 2.0]))
    window.solve(q_init, x_ref, rollout(task, q_init, x_ref))
    gone = weakref.ref(window)
    del window
    gc.collect()
    assert gone() is None
