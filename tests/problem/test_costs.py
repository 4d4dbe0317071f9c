"""The methods' integrals against the evaluation, which shares no code with them."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from pipeline.common.arrays import Array
from pipeline.evaluation.evaluation import evaluate
from pipeline.model.task import PositionTask
from pipeline.path.curves import circle
from pipeline.path.reference import Reference
from pipeline.path.timing import ConstantSpeed, RaisedCosine
from pipeline.problem.costs import integrals, objective_values, velocities
from pipeline.problem.objective import Objective
from pipeline.problem.problem import Boundary, Problem
from pipeline.problem.solution import Solution, Status, Trajectory

TIMES = np.array([0.0, 0.1, 0.25, 0.3, 0.6, 0.7, 1.0])


@pytest.fixture
def motions(rng: np.random.Generator) -> Array:
    """(4, N + 1, n): any motions will do; the last knot equals the first."""
    q = rng.normal(size=(4, len(TIMES), 3))
    q[:, -1] = q[:, 0]
    return q


@pytest.mark.parametrize("timing", [RaisedCosine(1.0), ConstantSpeed(1.0)], ids=["rest", "speed"])
@pytest.mark.parametrize("boundary", list(Boundary), ids=lambda boundary: boundary.value)
def test_the_integrals_are_those_that_are_reported(
    task: PositionTask, q_init: Array, motions: Array, boundary: Boundary, timing: RaisedCosine | ConstantSpeed
) -> None:
    start = task.value(q_init[None])[0]
    problem = Problem(task, Reference(circle(start, 180.0, 0.05), timing), q_init, TIMES, boundary=boundary)
    reported = [evaluate(problem, Solution("x", Trajectory(TIMES, q), Status.SOLVED)) for q in motions]
    for q, result in zip(motions, reported, strict=True):
        np.testing.assert_allclose(velocities(problem, TIMES, q), result.qd, atol=1e-12)
        costs = integrals(problem, TIMES, q)
        assert costs.integrals["kinetic_energy"] == pytest.approx(result.energy_integral[-1], rel=1e-10)
        assert costs.integrals["torque"] == pytest.approx(result.torque_integral[-1], rel=1e-10)
        np.testing.assert_allclose(costs.tau[1:], result.tau[1:], rtol=1e-9, atol=1e-9)
    for weight in (1.0, 0.3, 0.0):
        mixed = replace(problem, objective=Objective({"kinetic_energy": weight, "torque": 1.0 - weight}))
        expected = [weight * r.energy_integral[-1] + (1 - weight) * r.torque_integral[-1] for r in reported]
        np.testing.assert_allclose(objective_values(mixed, TIMES, motions), expected, rtol=1e-10)


def test_velocities_of_many_motions_are_those_of_each(task: PositionTask, q_init: Array, motions: Array) -> None:
    start = task.value(q_init[None])[0]
    for boundary in Boundary:
        problem = Problem(
            task, Reference(circle(start, 0.0, 0.05), RaisedCosine(1.0)), q_init, TIMES, boundary=boundary
        )
        stacked = velocities(problem, TIMES, motions)
        for one, q in zip(stacked, motions, strict=True):
            np.testing.assert_array_equal(one, velocities(problem, TIMES, q))


def test_the_first_velocity_by_boundary(task: PositionTask, q_init: Array, motions: Array) -> None:
    start = task.value(q_init[None])[0]
    step = np.diff(motions[0], axis=0) / np.diff(TIMES)[:, None]

    def first(boundary: Boundary, timing: RaisedCosine | ConstantSpeed) -> Array:
        problem = Problem(task, Reference(circle(start, 0.0, 0.05), timing), q_init, TIMES, boundary=boundary)
        return velocities(problem, TIMES, motions[0])[0]

    np.testing.assert_array_equal(first(Boundary.FIXED, RaisedCosine(1.0)), 0.0)
    np.testing.assert_array_equal(first(Boundary.FREE, RaisedCosine(1.0)), 0.0)
    np.testing.assert_allclose(first(Boundary.FIXED, ConstantSpeed(1.0)), step[0])
    np.testing.assert_allclose(first(Boundary.CYCLIC, RaisedCosine(1.0)), step[-1])
    np.testing.assert_allclose(first(Boundary.CYCLIC, ConstantSpeed(1.0)), step[-1])
