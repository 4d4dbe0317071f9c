from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest

from pipeline.build.problem import prepare
from pipeline.common.arrays import Array
from pipeline.methods.pmke.exact import ExactWindow, why_not
from pipeline.methods.pmke.window import Window
from pipeline.model.task import PositionTask
from pipeline.path.reference import Reference
from pipeline.problem.lagrangian import Lagrangian
from pipeline.problem.objective import Objective
from pipeline.problem.secondary import Secondary
from tests.benchmarks import peer as peer_program
from tests.support import composed


@pytest.mark.parametrize("horizon", [1, 2, 5])
@pytest.mark.parametrize("number", [2, 3])
def test_all_guesses_end_at_the_peers_optimum(
    task: PositionTask, reference: Callable[[int], Reference], peer: object, q_init: Array, horizon: int, number: int
) -> None:
    x_ref = reference(number).position(1.0 * np.arange(1, horizon + 1))
    window = ExactWindow(Lagrangian(task, Objective()), horizon, 1.0)
    guess = window.rollout(q_init, x_ref)
    found = window.solve(q_init, x_ref, np.array([guess, guess + 0.02]))
    program = peer_program.kinetic_energy_program(peer.arm, horizon, 1.0, 1e-12)  # type: ignore[attr-defined]
    q, energy, _ = peer_program.solve(program, q_init, x_ref, guess)
    assert found.converged.all()
    np.testing.assert_allclose(found.cost, energy, rtol=1e-8)
    np.testing.assert_allclose(found.q, [q, q], atol=1e-6)
    assert np.abs(found.q - q).max() < 1e-8 + 10 * found.residual.max(), "the residual promises too much"


@pytest.mark.parametrize(
    ("name", "weights"),
    [("panda_pose", {"kinetic_energy": 1.0}), ("panda", {"kinetic_energy": 0.7, "velocity_norm": 0.2})],
)
def test_an_arm_in_space_ends_at_ipopts_optimum(name: str, weights: dict[str, float]) -> None:
    """A pose, and an objective of two terms."""
    problem = replace(prepare(composed(f"+experiment={name}")), objective=Objective(weights))
    lagrangian = Lagrangian(problem.task, problem.objective)
    x_ref = problem.reference.position(1.0 + 0.3 * np.arange(3))
    start = ExactWindow(lagrangian, 1, 0.3).rollout(problem.q_init, problem.reference.position(np.array([0.7])))[0]
    window = ExactWindow(lagrangian, 3, 0.3)
    guess = window.rollout(start, x_ref)
    found = window.solve(start, x_ref, guess[None])
    q, value, outcome, _ = Window(lagrangian, 3, 0.3).solve(start, x_ref, guess, tolerance=1e-9)
    assert outcome.converged
    assert found.converged.all()
    assert found.cost[0] == pytest.approx(value, rel=1e-6)
    np.testing.assert_allclose(found.q[0], q, atol=1e-4)


def test_a_path_that_has_not_begun_leaves_the_arm_at_rest(task: PositionTask, q_init: Array) -> None:
    x_ref = np.tile(task.value(q_init[None]), (3, 1))
    found = ExactWindow(Lagrangian(task, Objective()), 3, 1.0).solve(q_init, x_ref, np.tile(q_init, (1, 3, 1)))
    assert found.converged.all()
    np.testing.assert_allclose(found.q[0], np.tile(q_init, (3, 1)), atol=1e-9)


def test_a_guess_that_goes_nowhere_is_given_up(task: PositionTask, q_init: Array) -> None:
    """A target out of reach."""
    with np.errstate(all="ignore"):
        found = ExactWindow(Lagrangian(task, Objective()), 1, 1.0).solve(
            q_init, np.array([[2.0, 0.0]]), q_init[None, None]
        )
    assert not found.converged.any()


def test_what_is_not_served_is_said(task: PositionTask) -> None:
    assert why_not(Lagrangian(task, Objective()), 5) is None
    assert why_not(Lagrangian(task, Objective()), 200) == "more than 300 unknowns"
    second = Objective({"kinetic_energy": 1.0}, Secondary(("manipulability",), 1.0, np.zeros(3), np.ones(3)))
    assert "beside the kinetic energy" in str(why_not(Lagrangian(task, second), 2))
