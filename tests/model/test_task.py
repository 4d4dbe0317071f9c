from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from pipeline.common.arrays import Array
from pipeline.common.errors import RobotError
from pipeline.model.arm import Arm
from pipeline.model.task import PoseTask, PositionTask, Task, _logarithm, _swing, pose_task
from tests.support import ROBOTS, differences, robot, within_limits


def tasks(arm: Arm) -> list[Task]:
    if arm.n < 6:
        return [PositionTask(arm)]
    return [PositionTask(arm, ("x", "y", "z")), PoseTask(arm), PoseTask(arm, (0.2, -0.3, 1.0))]


CASES = [(name, index) for name in ROBOTS for index in range(3 if name in ("panda", "xarm7") else 1)]


@pytest.fixture(params=CASES, ids=[f"{name}-{index}" for name, index in CASES])
def task(request: pytest.FixtureRequest) -> Task:
    name, index = request.param
    return tasks(robot(name))[index]


def by_configuration(function: object, q: Array, step: float = 1e-6) -> Array:
    """Central differences by q (K, n) of a stacked function: (K, ..., n)."""
    moved = [(function(q + step * e) - function(q - step * e)) / (2 * step) for e in np.eye(q.shape[1])]  # type: ignore[operator]
    return np.stack(moved, axis=-1)


def test_the_derivative_of_the_error_equals_central_differences(task: Task, rng: np.random.Generator) -> None:
    q = within_limits(task.arm, 100, rng)
    for away in (0.0, 1e-5, 0.3, 2.0):  # from the target; rotations of almost nothing have closed forms of their own
        target = task.value(q + away * rng.uniform(-1, 1, size=q.shape))
        error, jacobian = task.error_and_jacobian(q, target)
        np.testing.assert_allclose(error, task.error(q, target), atol=1e-14)
        expected = by_configuration(lambda x, target=target: task.error(x, target), q)
        # A rotation of nearly half a turn has no derivative there.
        near = np.linalg.norm(error[:, len(task.axes) :], axis=1) < 3.0
        np.testing.assert_allclose(jacobian[near], expected[near], atol=2e-7)


def test_the_derivative_of_the_error_by_the_target(task: Task, rng: np.random.Generator) -> None:
    q, h = within_limits(task.arm, 40, rng), 1e-6
    target = task.value(q + 0.3 * rng.uniform(-1, 1, size=q.shape))
    rate = rng.normal(size=target.shape)
    count = len(task.axes)

    def moved(by: float) -> Array:
        ahead = target + by * rate
        if target.shape[1] > count:  # the rate's turning is a velocity in the world
            turned = Rotation.from_rotvec(by * rate[:, count:]) * Rotation.from_rotvec(target[:, count:])
            ahead[:, count:] = turned.as_rotvec()
        return ahead

    expected = (task.error(q, moved(h)) - task.error(q, moved(-h))) / (2 * h)
    np.testing.assert_allclose(task.error_by_target(q, target, rate), expected, atol=2e-7)


def test_on_the_target_the_error_is_zero_and_its_derivative_is_the_jacobian(
    task: Task, rng: np.random.Generator
) -> None:
    q = within_limits(task.arm, 20, rng)
    error, jacobian = task.error_and_jacobian(q, task.value(q))
    assert np.abs(error).max() < 1e-12
    np.testing.assert_allclose(jacobian, task.jacobian(q), atol=1e-9)


def test_second_derivatives(task: Task, rng: np.random.Generator) -> None:
    q = within_limits(task.arm, 20, rng)
    jacobian, gradient = task.jacobian_and_gradient(q)
    np.testing.assert_allclose(jacobian, task.jacobian(q), atol=1e-12)
    np.testing.assert_allclose(gradient, by_configuration(task.jacobian, q), atol=2e-8)
    qd = rng.normal(size=q.shape)
    np.testing.assert_allclose(
        task.jacobian_rate_term(q, qd), np.einsum("kijl,kl,kj->ki", gradient, qd, qd), atol=1e-10
    )


def test_velocity_and_acceleration_of_a_target_that_the_arm_itself_draws(task: Task, rng: np.random.Generator) -> None:
    """For any joint motion, J qd and J qdd + Jd qd are what a target asks for that moves as its end effector does."""
    q, (qd, qdd) = within_limits(task.arm, 10, rng), rng.normal(size=(2, 10, task.arm.n))
    if isinstance(task, PositionTask):
        rate = (task.jacobian(q) @ qd[:, :, None])[:, :, 0]
        wanted = (task.jacobian(q) @ qdd[:, :, None])[:, :, 0] + task.jacobian_rate_term(q, qd)
        np.testing.assert_array_equal(task.acceleration(q, qd, rate, wanted), wanted)
        return
    both = task.arm.spatial_jacobian(q)
    twist = (both @ qd[:, :, None])[:, :, 0]
    acceleration = (both @ qdd[:, :, None])[:, :, 0] + task.arm.spatial_rate_term(q, qd)
    turned, pushed = (np.hstack([v[:, 3:], v[:, :3]]) for v in (twist, acceleration))
    if task.pointing is not None:  # a reference that spins differently about the axis asks for the same
        axis = task.arm.pose(q)[1] @ (np.array(task.pointing) / np.linalg.norm(task.pointing))
        spin = rng.normal(size=(10, 1))
        slower = turned[:, 3:] - spin * axis
        pushed[:, 3:] -= spin * np.cross(slower, axis)  # d/dt (spin a) with a constant spin
        turned[:, 3:] = slower
    np.testing.assert_allclose(task.velocity(q, turned), (task.jacobian(q) @ qd[:, :, None])[:, :, 0], atol=1e-12)
    left = (task.jacobian(q) @ qdd[:, :, None])[:, :, 0] + task.jacobian_rate_term(q, qd)
    np.testing.assert_allclose(task.acceleration(q, qd, turned, pushed), left, atol=1e-10)


vectors = st.tuples(*[st.floats(-1, 1)] * 3).map(np.array).filter(lambda v: np.linalg.norm(v) > 0.05)


@given(vectors, st.floats(0, 3.1))
def test_the_logarithm_inverts_the_exponential(axis: Array, angle: float) -> None:
    phi = angle * axis / np.linalg.norm(axis)
    found, _ = _logarithm(Rotation.from_rotvec(phi).as_matrix()[None])
    np.testing.assert_allclose(found[0], phi, atol=1e-9)


@given(vectors, vectors)
def test_the_swing_is_the_angle_between_two_directions(seen: Array, axis: Array) -> None:
    seen, axis = seen / np.linalg.norm(seen), axis / np.linalg.norm(axis)
    basis = np.linalg.svd(axis[None])[2][1:]
    if np.cross(basis[0], basis[1]) @ axis < 0:
        basis = basis[::-1]
    angle = np.arctan2(np.linalg.norm(np.cross(seen, axis)), seen @ axis)
    if angle > 3.0:
        return
    swing, by_turn = _swing(seen[None], axis, basis)
    assert np.linalg.norm(swing[0]) == pytest.approx(angle, abs=1e-9)

    def turned(w: Array) -> Array:  # the effector's frame turned by w: what it sees turns back
        return _swing((Rotation.from_rotvec(w).inv().apply(seen))[None], axis, basis)[0][0]

    np.testing.assert_allclose(by_turn[0], differences(turned, np.zeros(3), 1e-6), atol=1e-7)


def test_too_many_coordinates_for_the_joints() -> None:
    with pytest.raises(
        RobotError, match=r"robot\.orientation = full: 4 joints for 6 task coordinates leave no redundancy"
    ):
        PoseTask(robot("planar4r"))
    with pytest.raises(
        RobotError, match=r"robot\.pointing = \[0, 0, 0\]: expected three numbers that are not all zero"
    ):
        pose_task(robot("panda"), "pointing", [0, 0, 0])
