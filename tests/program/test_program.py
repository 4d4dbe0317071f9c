from __future__ import annotations

import gc
import re
import weakref
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from pydrake.autodiffutils import ExtractGradient, InitializeAutoDiff

from pipeline.common.arrays import Array
from pipeline.path.timing import ConstantSpeed
from pipeline.problem.costs import integrals
from pipeline.problem.limits import Limits
from pipeline.problem.objective import Objective
from pipeline.problem.problem import Boundary, Problem
from pipeline.program.program import Program
from pipeline.program.scaling import POSITION_SCALE
from pipeline.program.transcription import transcribe
from tests.benchmarks import peer as peer_program
from tests.support import differences

Make = Callable[[int, int], Problem]
Guess = Callable[[Problem], Array]


LIMITS = Limits(-2 * np.ones(3), 2 * np.ones(3), np.full(3, 3.8), np.full(3, 0.4), np.array([0.7, 0.7, np.inf]))
KINDS: dict[str, dict[str, Any]] = {
    "kinetic energy": {},
    "torque": {"objective": Objective({"torque": 1.0})},
    "both, limits": {"objective": Objective({"kinetic_energy": 1.0, "torque": 0.3}), "limits": LIMITS},
    "torque, limits, cyclic": {"objective": Objective({"torque": 1.0}), "limits": LIMITS, "boundary": Boundary.CYCLIC},
    "kinetic energy, free": {"boundary": Boundary.FREE},
    "at speed": {"objective": Objective({"kinetic_energy": 0.5, "torque": 0.5}), "timing": ConstantSpeed(10.0)},
}


@pytest.fixture
def make(problem: Make, guess: Guess) -> Callable[..., Program]:
    """Trajectory 3 with 25 intervals (bindings of 10, 10 and 5 knots) or another number of them, one of KINDS."""

    def build(kind: str = "kinetic energy", intervals: int = 25) -> Program:
        asked, changes = problem(3, intervals), dict(KINDS[kind])
        if "timing" in changes:
            changes["reference"] = replace(asked.reference, timing=changes.pop("timing"))
        stated = replace(asked, **changes)
        return transcribe(stated, asked.times, guess(stated))

    return build


@pytest.fixture
def made(make: Callable[..., Program]) -> Program:
    return make()


def program_value(made: Program, x: Array) -> Array:
    """Cost and all rows of the program at x, in doubles."""
    program = made.drake
    costs = [program.EvalBinding(binding, x) for binding in program.GetAllCosts()]
    return np.concatenate([[np.sum(costs)], *[program.EvalBinding(b, x) for b in program.GetAllConstraints()]])


def program_jacobian(made: Program, x: Array) -> Array:
    """The same rows' derivatives, put together from each binding's own AutoDiff evaluation, as Drake's IPOPT does."""
    program, costs, rows = made.drake, np.zeros((1, len(x))), []
    for kind, bindings in (("cost", program.GetAllCosts()), ("rows", program.GetAllConstraints())):
        for binding in bindings:
            columns = program.FindDecisionVariableIndices(binding.variables())
            y = binding.evaluator().Eval(InitializeAutoDiff(x[columns]).ravel())
            block = np.zeros((len(y), len(x)))
            np.add.at(block, (slice(None), columns), ExtractGradient(y))  # a variable may stand twice
            if kind == "cost":
                costs += block
            else:
                rows.append(block)
    return np.concatenate([costs, *rows])


def vector(made: Program, q: Array, qd: Array) -> Array:
    w = np.linalg.solve(made.scaling.to_velocity, qd[:, :, None])
    return np.concatenate([POSITION_SCALE * q.ravel(), w.ravel()])


@pytest.mark.slow
@pytest.mark.parametrize("intervals", [6, 25])
@pytest.mark.parametrize("kind", KINDS)
def test_derivatives_of_the_whole_program_equal_central_differences(
    make: Callable[..., Program], rng: np.random.Generator, kind: str, intervals: int
) -> None:
    made = make(kind, intervals)
    x = rng.normal(size=made.drake.num_vars())
    x[: made.y.size] *= POSITION_SCALE
    got = program_jacobian(made, x)
    expected = differences(lambda x: program_value(made, x), x, 1e-7)
    scale = np.abs(expected).max(axis=1, keepdims=True)
    assert np.abs((got - expected) / scale).max() < 5e-6


@pytest.mark.parametrize("kind", KINDS)
def test_the_sparsity_pattern_covers_every_nonzero(
    make: Callable[..., Program], rng: np.random.Generator, kind: str
) -> None:
    made = make(kind)
    for binding in made.drake.generic_constraints():
        evaluator = binding.evaluator()
        y = evaluator.Eval(InitializeAutoDiff(rng.normal(size=evaluator.num_vars())).ravel())
        pattern = evaluator.gradient_sparsity_pattern()
        assert {tuple(entry) for entry in np.argwhere(ExtractGradient(y)).tolist()} <= set(pattern)
        assert len(pattern) == len(set(pattern)) <= len(y) * 10  # sparse: a row knows 3 groups of 3 and its own torque


def test_cost_and_rows_are_what_the_unknowns_mean(made: Program, rng: np.random.Generator) -> None:
    q, qd = rng.normal(size=(26, 3)), rng.normal(size=(25, 3))
    x, program, arm = vector(made, q, qd), made.drake, made.arm
    cost = float(np.sum([program.EvalBinding(binding, x) for binding in program.GetAllCosts()]))
    assert made.scaling.cost * cost == pytest.approx(arm.kinetic_energy(q[1:], qd) @ made.dt, rel=1e-10)
    tracking = np.concatenate([program.EvalBinding(b, x) for b in program.generic_constraints()])
    error = made.problem.task.value(q[1:]) - made.x_ref[1:]
    np.testing.assert_allclose(tracking.reshape(25, 2), error, atol=1e-12)
    (link,) = program.linear_equality_constraints()
    np.testing.assert_allclose(
        program.EvalBinding(link, x).reshape(25, 3),
        POSITION_SCALE * (np.diff(q, axis=0) - made.dt[:, None] * qd),
        atol=1e-12,
    )


@pytest.mark.parametrize("kind", KINDS)
def test_every_unknown_starts_at_the_guess(make: Callable[..., Program], kind: str) -> None:
    """Velocities and torques are those of the guess, whatever term made them, and the objective is 1 there."""
    made = make(kind)
    x, program = made.drake.initial_guess(), made.drake
    q = x[: made.y.size].reshape(26, 3) / POSITION_SCALE
    np.testing.assert_allclose(q, made.guess.q, rtol=1e-12)
    for binding in [*program.linear_equality_constraints()[:1], *program.generic_constraints()]:
        np.testing.assert_allclose(program.EvalBinding(binding, x), 0.0, atol=1e-8)
    assert program_value(made, x)[0] == pytest.approx(1.0, rel=1e-9)


def test_a_bound_on_any_integral_binds(problem: Problem, guess: Guess) -> None:
    """Less than the optimum of the kinetic energy has of each: recomputed from the joint motion alone."""
    asked = problem(3, 12)
    q = transcribe(asked, asked.times, guess(asked)).solve()[0]
    free = integrals(asked, asked.times, q).integrals
    for name in ("velocity_norm", "torque"):
        bound = 0.97 * free[name]
        stated = replace(asked, bounds_of_integrals={name: bound})
        bounded, outcome, _ = transcribe(stated, stated.times, q).solve()
        assert outcome.converged, name
        step = np.diff(bounded, axis=0) / np.diff(asked.times)[:, None]
        change = np.diff(np.vstack([np.zeros(3), step]), axis=0) / np.diff(asked.times)[:, None]
        tau = asked.task.arm.inverse_dynamics(bounded[1:], step, change)
        found = ((step if name == "velocity_norm" else tau) ** 2).sum(axis=1) @ np.diff(asked.times)
        assert found == pytest.approx(bound, rel=1e-6)
        assert integrals(asked, asked.times, bounded).integrals["kinetic_energy"] > free["kinetic_energy"]


@pytest.mark.parametrize("number", [2, 3])
def test_the_optimum_is_the_peers(problem: Make, guess: Guess, peer: object, number: int) -> None:
    asked = problem(number, 25)
    start = guess(asked)
    q, outcome, iterations = transcribe(asked, asked.times, start).solve(tolerance=1e-9)
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
    q, outcome, _ = transcribe(uneven, times, guess(uneven)).solve()
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
def test_reported_iterations_are_ipopts(made: Program, tmp_path: Path, limit: int) -> None:
    counts = []
    for run in ("first", "again"):
        log = tmp_path / f"{run}.txt"
        extra = {"output_file": str(log), "file_print_level": 5, "print_level": 0}
        _, outcome, iterations = made.solve(max_iterations=limit, extra=extra)
        printed = re.search(r"Number of Iterations\.+: (\d+)", log.read_text())
        assert printed
        counts.append((iterations, int(printed[1])))
        assert outcome.converged == (limit == 200)
        assert ("iteration" in outcome.status) == (limit == 3)
    assert counts[0][0] == counts[0][1] > 0
    assert counts[1] == counts[0]  # a second solve of the same program counts from zero


def test_running_out_of_time_is_called_so(made: Program) -> None:
    _, outcome, _ = made.solve(max_time=1e-6)
    assert not outcome.converged
    assert "time" in outcome.status


@pytest.mark.slow
@pytest.mark.parametrize("elastic", [(), ("velocity",)])
@pytest.mark.parametrize("kind", KINDS)
def test_a_program_is_gone_when_nobody_has_it(kind: str, elastic: tuple[str, ...], problem: Make, guess: Guess) -> None:
    """What it has given to Drake must not hold it, and with it the arm and its plants, for the whole process."""
    changes = {key: value for key, value in KINDS[kind].items() if key != "timing"}
    asked = replace(
        problem(3, 11), bounds_of_integrals={} if elastic else {"velocity_norm": 1.0, "torque": 1.0}, **changes
    )
    made = transcribe(asked, asked.times, guess(asked), elastic=elastic)
    made.solve(max_iterations=1)
    gone = weakref.ref(made)
    del made
    gc.collect()
    assert gone() is None
