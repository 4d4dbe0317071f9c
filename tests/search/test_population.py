from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from pipeline.common.arrays import Array
from pipeline.model import kinematics
from pipeline.model.task import PositionTask
from pipeline.path.curves import Line
from pipeline.path.reference import Reference
from pipeline.path.timing import RaisedCosine
from pipeline.problem.costs import integrals, objective_values
from pipeline.problem.objective import Objective
from pipeline.problem.problem import Problem
from pipeline.search import population as population_module
from pipeline.search.configurations import random_configurations
from pipeline.search.population import population, random_inverse_weights
from pipeline.search.selection import distinct, diverse, path_distance

Make = Callable[[int, int], Problem]
Guess = Callable[[Problem], Array]
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


def motions_of(problem: Problem, count: int, seed: int = 0) -> Array:
    return population(problem, problem.times, problem.q_init[None], count, np.random.default_rng(seed))


@pytest.mark.parametrize("number", [1, 2, 3, 4])
def test_population_follows_the_path_from_its_starts(problem: Make, q_init: Array, number: int) -> None:
    asked = problem(number, 25)
    starts = random_configurations(asked.task, q_init, 4, np.random.default_rng(1))
    motions = population(asked, asked.times, starts, 40, np.random.default_rng(3))
    assert 5 < len(motions) <= 40
    assert all(np.any(np.all(motion[0] == starts, axis=1)) for motion in motions)
    x = asked.task.value(motions.reshape(-1, 3)).reshape(len(motions), 26, 2)
    assert np.linalg.norm(x - asked.reference.position(asked.times), axis=2).max() < 1e-6
    assert len(distinct(motions, np.zeros(len(motions)), 40, 1e-3, TURNS | True)) > 3


def test_population_is_a_function_of_the_seed(problem: Make) -> None:
    asked = problem(3, 12)
    first, same, other = (motions_of(asked, 10, seed) for seed in (5, 5, 6))
    np.testing.assert_array_equal(first, same)
    np.testing.assert_allclose(first[:2], other[:2], atol=1e-6)  # the inertia-weighted and the plain one are not drawn
    assert np.abs(first[2] - other[2]).max() > 1e-3


@pytest.mark.parametrize("count", [1, 2, 3])
def test_small_populations_begin_with_the_inertia_weighted_motion(problem: Make, guess: Guess, count: int) -> None:
    asked = problem(1, 12)
    motions = motions_of(asked, count)
    assert len(motions) == count
    np.testing.assert_allclose(motions[0], guess(asked), atol=1e-6)


def test_a_path_out_of_reach_has_no_candidates(task: PositionTask, q_init: Array) -> None:
    line = Line(task.value(q_init[None])[0], np.array([1.0, 0.0]), 0.3)
    asked = Problem(task, Reference(line, RaisedCosine(1.0)), q_init, np.linspace(0, 1, 9))
    assert len(motions_of(asked, 8)) == 0


def test_a_stretched_start_does_not_end_the_run(task: PositionTask) -> None:
    line = Line(task.value(np.zeros((1, 3)))[0], np.array([-1.0, 0.0]), 0.1)
    asked = Problem(task, Reference(line, RaisedCosine(1.0)), np.zeros(3), np.linspace(0, 1, 9))
    assert np.isfinite(motions_of(asked, 8)).all()


def test_costs_are_backward_sums(problem: Make, peer: SimpleNamespace, rng: np.random.Generator) -> None:
    times, motions = np.array([0.0, 0.1, 0.3, 0.35]), rng.normal(size=(5, 4, 3))
    asked = replace(problem(1, 3), objective=Objective({"kinetic_energy": 2.0, "torque": 0.1}))
    dt = np.diff(times)
    for motion, value in zip(motions, objective_values(asked, times, motions), strict=True):
        qd = np.diff(motion, axis=0) / dt[:, None]
        qdd = np.diff(np.vstack([np.zeros(3), qd]), axis=0) / dt[:, None]
        energy, torque = peer.energy(motion[1:], qd) @ dt, (peer.torque(motion[1:], qd, qdd) ** 2).sum(axis=1) @ dt
        assert value == pytest.approx(2.0 * energy + 0.1 * torque, rel=1e-9)
        both = integrals(asked, times, motion)
        assert (both.integrals["kinetic_energy"], both.integrals["torque"]) == pytest.approx((energy, torque), rel=1e-9)


@given(st.floats(-3, 3), st.lists(st.integers(-3, 3), min_size=2, max_size=2))
def test_path_distance_does_not_count_full_turns(gap: float, turns: list[int]) -> None:
    path = np.linspace(0, 1, 12).reshape(4, 3)
    moved = path.copy()
    moved[2, 1] += gap
    assert path_distance(path, moved, TURNS) == pytest.approx(abs(gap), abs=1e-12)
    wound = moved + 2 * np.pi * np.array([*turns, 0])
    assert path_distance(path, wound, TURNS) == pytest.approx(abs(gap), abs=1e-12)
    slid = path + np.array([0, 0, 2 * np.pi])
    assert path_distance(path, slid, TURNS) == pytest.approx(2 * np.pi)  # a slide of 6.28 m is one


def test_distinct_keeps_the_cheapest_of_each_kind() -> None:
    base = np.zeros((3, 3))
    motions = np.array([base, base + 0.005, base + np.array([2 * np.pi, 0, 0]), base + 0.5, base + 0.504, base + 1.0])
    costs = np.array([3.0, 1.0, 2.0, 5.0, 4.0, 0.5])
    assert distinct(motions, costs, 10, 0.01, TURNS) == [5, 1, 4]
    assert distinct(motions, costs, 2, 0.01, TURNS) == [5, 1]
    assert distinct(motions, costs, 10, 0.001, TURNS) == [5, 1, 2, 4, 3]


def test_diverse_takes_far_motions_before_near_ones() -> None:
    valley = np.linspace(0, 0.01, 30)[:, None, None] * np.ones((30, 3, 3))
    far = np.stack([np.full((3, 3), 1.0), np.full((3, 3), -1.0)])
    motions, costs = np.concatenate([valley, far]), np.concatenate([np.linspace(1, 2, 30), [5.0, 6.0]])
    chosen = diverse(motions, costs, 4, 1e-3, TURNS)
    assert chosen[0] == 0
    assert {30, 31} <= set(chosen)
    assert set(distinct(motions, costs, 4, 1e-4, TURNS)) == {0, 1, 2, 3}  # the cheapest alone see one valley


def test_motions_survive_where_the_inertia_weighted_one_is_lost(problem: Make, monkeypatch: pytest.MonkeyPatch) -> None:
    """The first motion of every start may meet a singularity before the others do."""
    lost = []

    def project(*arguments: Any, **options: Any) -> tuple[Array, Array]:
        q, error = kinematics.project(*arguments, **options)
        if not lost:
            error[0] = np.inf
        lost.append(len(q))
        return q, error

    monkeypatch.setattr(population_module, "project", project)
    stated = problem(1, 4)
    found = population(stated, stated.times, stated.q_init[None], 5, np.random.default_rng(0))
    assert lost == [5, 4, 4, 4]
    assert found.shape == (4, 5, 3)
