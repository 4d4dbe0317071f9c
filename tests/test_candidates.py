from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from pipeline.arrays import Array
from pipeline.candidates import distinct, kinetic_energy_integrals, path_distance, population, random_inverse_weights
from pipeline.path import Line, RaisedCosine, Reference
from pipeline.problem import Problem
from pipeline.task import PositionTask

Make = Callable[[int, int], Problem]
TURNS = np.array([True, True, False])


def test_random_weights_are_spd_with_eigenvalues_in_the_unit_interval(rng: np.random.Generator) -> None:
    inverse = random_inverse_weights(rng, 2000, 3)
    np.testing.assert_allclose(inverse, inverse.mT, atol=1e-9)
    eigenvalues = 1 / np.linalg.eigvalsh(inverse)
    assert eigenvalues.min() > 0
    assert eigenvalues.max() <= 1 + 1e-12
    np.testing.assert_allclose(np.quantile(eigenvalues, [0.25, 0.5, 0.75]), [0.25, 0.5, 0.75], atol=0.03)
    # Eigenvectors favour no direction: the mean of W is a multiple of the identity.
    np.testing.assert_allclose(np.linalg.inv(inverse).mean(axis=0), 0.5 * np.eye(3), atol=0.03)


@pytest.mark.parametrize("number", [1, 2, 3, 4])
def test_population_follows_the_path_from_q_init(problem: Make, q_init: Array, number: int) -> None:
    asked = problem(number, 25)
    motions = population(asked, asked.times, 30, np.random.default_rng(3))
    assert 5 < len(motions) <= 30
    assert np.all(motions[:, 0] == q_init)
    x = asked.task.value(motions.reshape(-1, 3)).reshape(len(motions), 26, 2)
    assert np.linalg.norm(x - asked.reference.position(asked.times), axis=2).max() < 1e-6
    assert len(distinct(motions, np.zeros(len(motions)), 30, 1e-3, TURNS | True)) > 3


def test_population_is_a_function_of_the_seed(problem: Make) -> None:
    asked = problem(3, 12)
    first, same, other = (population(asked, asked.times, 10, np.random.default_rng(seed)) for seed in (5, 5, 6))
    np.testing.assert_array_equal(first, same)
    np.testing.assert_array_equal(first[:2], other[:2])  # the plain and the inertia-weighted one are not drawn
    assert not np.array_equal(first[2], other[2])


@pytest.mark.parametrize("count", [1, 2, 3])
def test_small_populations(problem: Make, count: int) -> None:
    asked = problem(1, 12)
    assert len(population(asked, asked.times, count, np.random.default_rng(0))) == count


def test_a_path_out_of_reach_has_no_candidates(task: PositionTask, q_init: Array) -> None:
    line = Line(task.value(q_init[None])[0], np.array([1.0, 0.0]), 0.3)
    asked = Problem(task, Reference(line, RaisedCosine(1.0)), q_init, np.linspace(0, 1, 9))
    assert len(population(asked, asked.times, 8, np.random.default_rng(0))) == 0


def test_a_stretched_start_does_not_end_the_run(task: PositionTask) -> None:
    line = Line(task.value(np.zeros((1, 3)))[0], np.array([-1.0, 0.0]), 0.1)
    asked = Problem(task, Reference(line, RaisedCosine(1.0)), np.zeros(3), np.linspace(0, 1, 9))
    motions = population(asked, asked.times, 8, np.random.default_rng(0))
    assert np.isfinite(motions).all()


def test_costs_are_backward_sums(problem: Make, peer: object, rng: np.random.Generator) -> None:
    times = np.array([0.0, 0.1, 0.3, 0.35])
    motions = rng.normal(size=(5, 4, 3))
    costs = kinetic_energy_integrals(problem(1, 3), times, motions)
    for motion, cost in zip(motions, costs, strict=True):
        qd = np.diff(motion, axis=0) / np.diff(times)[:, None]
        assert cost == pytest.approx(peer.energy(motion[1:], qd) @ np.diff(times), rel=1e-12)  # type: ignore[attr-defined]


@given(st.floats(-3, 3), st.lists(st.integers(-3, 3), min_size=2, max_size=2))
def test_path_distance_does_not_count_full_turns(gap: float, turns: list[int]) -> None:
    path = np.linspace(0, 1, 12).reshape(4, 3)
    moved = path.copy()
    moved[2, 1] += gap
    assert path_distance(path, moved, TURNS) == pytest.approx(abs(gap), abs=1e-12)
    wound = moved + 2 * np.pi * np.array([*turns, 0])
    assert path_distance(path, wound, TURNS) == pytest.approx(abs(gap), abs=1e-12)
    slid = path + [0, 0, 2 * np.pi]
    assert path_distance(path, slid, TURNS) == pytest.approx(2 * np.pi)  # a slide of 6.28 m is one


def test_distinct_keeps_the_cheapest_of_each_kind() -> None:
    base = np.zeros((3, 3))
    motions = np.array([base, base + 0.005, base + [2 * np.pi, 0, 0], base + 0.5, base + 0.504, base + 1.0])
    costs = np.array([3.0, 1.0, 2.0, 5.0, 4.0, 0.5])
    assert distinct(motions, costs, 10, 0.01, TURNS) == [5, 1, 4]
    assert distinct(motions, costs, 2, 0.01, TURNS) == [5, 1]
    assert distinct(motions, costs, 10, 0.001, TURNS) == [5, 1, 2, 4, 3]
