from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from pipeline.common.arrays import Array
from pipeline.common.errors import PathError
from pipeline.methods.singularity import SingularityWatch
from pipeline.model.kinematics import place, project, pseudoinverse, weighted_pseudoinverse
from pipeline.model.task import PositionTask
from pipeline.problem.solution import Status, Trajectory
from pipeline.search.population import random_inverse_weights

seeds = st.integers(0, 2**32 - 1).map(np.random.default_rng)


@given(seeds, st.integers(1, 3), st.integers(1, 4))
def test_pseudoinverse_obeys_moore_and_penrose(rng: np.random.Generator, m: int, extra: int) -> None:
    J = rng.normal(size=(5, m, m + extra))
    J[0, -1] = J[0, 0]  # the definition holds at a singular configuration too
    P = pseudoinverse(J)
    for left, right in ((J @ P @ J, J), (P @ J @ P, P), (J @ P, (J @ P).mT), (P @ J, (P @ J).mT)):
        np.testing.assert_allclose(left, right, atol=1e-10 * max(1.0, np.abs(P).max() ** 2))


@given(seeds)
def test_weighted_pseudoinverse_has_the_least_weighted_norm(rng: np.random.Generator) -> None:
    J, inverse, x = rng.normal(size=(4, 2, 5)), random_inverse_weights(rng, 4, 5), rng.normal(size=(4, 2, 1))
    v = weighted_pseudoinverse(J, inverse) @ x
    np.testing.assert_allclose(J @ v, x, atol=1e-8)
    # Least: the gradient W v of the norm has no component along any self-motion.
    weight, self_motion = np.linalg.inv(inverse), np.eye(5) - pseudoinverse(J) @ J
    np.testing.assert_allclose(self_motion @ weight @ v, 0.0, atol=1e-8 * (1 + np.abs(weight @ v).max()))


def test_weighted_by_one_is_the_plain_pseudoinverse(rng: np.random.Generator) -> None:
    J = rng.normal(size=(6, 2, 3))
    np.testing.assert_allclose(weighted_pseudoinverse(J, np.eye(3)), pseudoinverse(J), atol=1e-11)


@pytest.mark.parametrize("weighted", [False, True])
def test_project_lands_on_reachable_targets(task: PositionTask, rng: np.random.Generator, weighted: bool) -> None:
    q = rng.uniform(-1, 1, size=(60, 3)) + np.array([0.0, 1.5, -1.4])
    target = task.value(q + rng.uniform(-0.15, 0.15, size=q.shape))
    before = q.copy()
    landed, left = project(task, q, target, random_inverse_weights(rng, 60, 3) if weighted else None)
    assert np.linalg.norm(task.value(landed) - target, axis=1).max() < 1e-10
    assert left.max() < 1e-10
    np.testing.assert_array_equal(q, before)


@pytest.mark.parametrize("iterations", [1, 2, 30])
def test_project_reports_the_distance_that_is_left(task: PositionTask, iterations: int) -> None:
    q = np.array([[0.1, 0.9, -0.8], [0.0, 0.327, -0.754]])
    target = np.array([[0.9, 0.3], [0.4, 0.05]])  # 0.49 m is the reach: the first is beyond it
    landed, left = project(task, q, target, max_iterations=iterations)
    np.testing.assert_allclose(left, np.linalg.norm(task.value(landed) - target, axis=1), atol=1e-12)
    assert left[0] >= np.hypot(0.9, 0.3) - 0.4895 - 1e-9


def test_project_gets_off_a_singular_start(task: PositionTask) -> None:
    stretched = np.zeros((1, 3))
    for weight in (None, np.diag([1.0, 2.0, 3.0])[None]):
        landed, left = project(task, stretched, np.array([[0.489, 0.02]]), weight)
        assert np.isfinite(landed).all()
        assert np.isfinite(left).all()


def test_place_finds_the_start_or_says_how_far_it_is(task: PositionTask, q_init: Array) -> None:
    start = task.value(q_init[None])[0] + np.array([-0.05, 0.03])
    np.testing.assert_allclose(task.value(place(task, q_init, start)[None])[0], start, atol=1e-10)
    far = 2.0 - 0.489  # less the arm's length
    with pytest.raises(PathError, match=rf"start \(2, 0\) m is out of reach: .* ends {far:.3g} m from it") as caught:
        place(task, q_init, np.array([2.0, 0.0]))
    assert "\n" not in str(caught.value)


def test_a_stretched_arm_is_placed_on_its_own_axis(task: PositionTask) -> None:
    """No least step leads there from a straight arm: its Jacobian knows no way inwards."""
    start = np.array([0.3, 0.0])
    assert project(task, np.zeros((1, 3)), start[None])[1][0] > 0.1
    np.testing.assert_allclose(task.value(place(task, np.zeros(3), start)[None])[0], start, atol=1e-10)


def test_singularity_watch_remembers_the_worst_moment() -> None:
    trajectory = Trajectory(np.zeros(1), np.zeros((1, 3)))

    def jacobian(ratio: float) -> Array:
        return np.diag([2.0, 2.0 * ratio]) @ np.eye(2, 3)

    watch = SingularityWatch(0.1, 0.02)
    for time, ratio in ((0.0, 0.5), (1.0, 0.2), (2.0, 0.4)):
        watch.see(time, jacobian(ratio))
    fine = watch.judge("lsv", trajectory, {"steps": 3})
    assert (fine.status, fine.tracking_tolerance, fine.event_time) == (Status.SOLVED, 0.02, None)
    assert fine.statistics["smallest_singular_value_ratio"] == pytest.approx(0.2)
    assert fine.statistics["steps"] == 3
    for time, ratio in ((3.0, 0.05), (4.0, 0.01), (5.0, 0.03)):
        watch.see(time, jacobian(ratio))
    singular = watch.judge("lsv", trajectory, {})
    assert (singular.status, singular.event_time) == (Status.SINGULAR, 4.0)
    assert "t = 4.00 s" in singular.message
