from __future__ import annotations

import re
from collections.abc import Callable
from pathlib import Path

import numpy as np
import peer as peer_program
import pytest
from conftest import differences
from pydrake.autodiffutils import ExtractGradient, InitializeAutoDiff

from pipeline.arrays import Array
from pipeline.problem import Boundary, Problem
from pipeline.transcription import POSITION_SCALE, Transcription

Make = Callable[[int, int], Problem]
Guess = Callable[[Problem], Array]


@pytest.fixture
def made(problem: Make, guess: Guess) -> Transcription:
    """Trajectory 3 with 25 intervals: bindings of 10, 10 and 5 knots."""
    asked = problem(3, 25)
    return Transcription(asked, asked.times, guess(asked))


def program_value(made: Transcription, x: Array) -> Array:
    """Cost and all rows of the program at x, in doubles."""
    program = made.program
    costs = [program.EvalBinding(binding, x) for binding in program.GetAllCosts()]
    return np.concatenate([[np.sum(costs)], *[program.EvalBinding(b, x) for b in program.GetAllConstraints()]])


def program_jacobian(made: Transcription, x: Array) -> Array:
    """The same rows' derivatives, put together from each binding's own AutoDiff evaluation, as Drake's IPOPT does."""
    program, costs, rows = made.program, np.zeros((1, len(x))), []
    for kind, bindings in (("cost", program.GetAllCosts()), ("rows", program.GetAllConstraints())):
        for binding in bindings:
            columns = program.FindDecisionVariableIndices(binding.variables())
            y = binding.evaluator().Eval(InitializeAutoDiff(x[columns]).ravel())
            block = np.zeros((len(y), len(x)))
            block[:, columns] = ExtractGradient(y)
            if kind == "cost":
                costs += block
            else:
                rows.append(block)
    return np.concatenate([costs, *rows])


def vector(made: Transcription, q: Array, qd: Array) -> Array:
    w = np.linalg.solve(made.to_velocity, qd[:, :, None])
    return np.concatenate([POSITION_SCALE * q.ravel(), w.ravel()])


def test_derivatives_of_the_whole_program_equal_central_differences(
    made: Transcription, rng: np.random.Generator
) -> None:
    for _ in range(3):
        x = rng.normal(size=made.program.num_vars())
        x[: made.y.size] *= POSITION_SCALE
        got = program_jacobian(made, x)
        expected = differences(lambda x: program_value(made, x), x, 1e-7)
        assert expected.shape[0] == 1 + 25 * 2 + 25 * 3 + 3
        scale = np.abs(expected).max(axis=1, keepdims=True)
        assert np.abs((got - expected) / scale).max() < 2e-6


def test_the_sparsity_pattern_covers_every_nonzero(made: Transcription, rng: np.random.Generator) -> None:
    sizes = []
    for binding in made.program.generic_constraints():
        evaluator = binding.evaluator()
        x = rng.normal(size=evaluator.num_vars()) * POSITION_SCALE
        nonzero = set(
            zip(*map(list, np.nonzero(ExtractGradient(evaluator.Eval(InitializeAutoDiff(x).ravel())))), strict=True)
        )
        pattern = set(evaluator.gradient_sparsity_pattern())
        assert nonzero <= pattern
        assert len(pattern) == 2 * evaluator.num_vars()
        sizes.append(evaluator.num_vars() // 3)
    assert sizes == [10, 10, 5]


def test_cost_and_rows_are_what_the_unknowns_mean(made: Transcription, rng: np.random.Generator) -> None:
    q, qd = rng.normal(size=(26, 3)), rng.normal(size=(25, 3))
    x, program, arm = vector(made, q, qd), made.program, made.arm
    cost = float(np.sum([program.EvalBinding(binding, x) for binding in program.GetAllCosts()]))
    assert made.energy * cost == pytest.approx(arm.kinetic_energy(q[1:], qd) @ made.dt, rel=1e-10)
    tracking = np.concatenate([program.EvalBinding(b, x) for b in program.generic_constraints()])
    np.testing.assert_allclose(tracking.reshape(25, 2), made.problem.task.value(q[1:]), atol=1e-12)
    (link,) = program.linear_equality_constraints()
    np.testing.assert_allclose(
        program.EvalBinding(link, x).reshape(25, 3),
        POSITION_SCALE * (np.diff(q, axis=0) - made.dt[:, None] * qd),
        atol=1e-12,
    )


@pytest.mark.parametrize("number", [2, 3])
def test_the_optimum_is_the_peers(problem: Make, guess: Guess, peer: object, number: int) -> None:
    asked = problem(number, 25)
    start = guess(asked)
    q, outcome, iterations = Transcription(asked, asked.times, start).solve(tolerance=1e-9)
    assert outcome.converged
    assert iterations < 40
    x_ref = asked.reference.position(asked.times[1:])
    program = peer_program.kinetic_energy_program(peer.arm, 25, 0.4, 1e-12)  # type: ignore[attr-defined]
    q_peer, cost_peer, _ = peer_program.solve(program, asked.q_init, x_ref, start[1:])
    qd = np.diff(q, axis=0) / 0.4
    assert 0.4 * asked.task.arm.kinetic_energy(q[1:], qd).sum() == pytest.approx(cost_peer, rel=1e-7)
    np.testing.assert_allclose(q[1:], q_peer, atol=1e-5)
    np.testing.assert_array_equal(q[0], asked.q_init)


def test_unequal_steps_are_weighted_by_their_length(problem: Make, guess: Guess, peer: object) -> None:
    asked = problem(3, 12)
    times = np.concatenate([np.arange(0.0, 10.0, 0.8), [10.0]])  # the last interval is shorter, as in the Global paper
    uneven = Problem(asked.task, asked.reference, asked.q_init, times)
    q, outcome, _ = Transcription(uneven, times, guess(uneven)).solve()
    assert outcome.converged
    # Stationary: no self-motion of any knot lowers the integral, written out with the peer's energy.
    dt = np.diff(times)

    def integral(flat: Array) -> Array:
        knots = np.vstack([q[0], flat.reshape(-1, 3)])
        qd = np.diff(knots, axis=0) / dt[:, None]
        return peer.energy(knots[1:], qd) @ dt  # type: ignore[attr-defined]

    slope = differences(integral, q[1:].ravel()).reshape(-1, 3)
    jacobian = asked.task.jacobian(q[1:])
    self_motion = np.cross(jacobian[:, 0], jacobian[:, 1])
    self_motion /= np.linalg.norm(self_motion, axis=1, keepdims=True)
    assert np.abs((slope * self_motion).sum(axis=1)).max() < 1e-8


@pytest.mark.parametrize("limit", [200, 3])
def test_reported_iterations_are_ipopts(made: Transcription, tmp_path: Path, limit: int) -> None:
    counts = []
    for run in ("first", "again"):
        log = tmp_path / f"{run}.txt"
        extra = {"output_file": str(log), "file_print_level": 5, "print_level": 0}
        _, outcome, iterations = made.solve(max_iterations=limit, extra=extra)
        printed = re.search(r"Number of Iterations\.+: (\d+)", log.read_text())
        assert printed
        counts.append((iterations, int(printed[1])))
        assert outcome.converged == (limit == 200)
        assert outcome.status == ("optimal" if limit == 200 else "iteration limit reached")
    assert counts[0][0] == counts[0][1] > 0
    assert counts[1] == counts[0]  # a second solve of the same program counts from zero


def test_a_boundary_that_is_not_served_is_refused(problem: Make, guess: Guess) -> None:
    asked = problem(3, 5)
    cyclic = Problem(asked.task, asked.reference, asked.q_init, asked.times, boundary=Boundary.CYCLIC)
    with pytest.raises(ValueError, match="fixed"):
        Transcription(cyclic, cyclic.times, guess(asked))
