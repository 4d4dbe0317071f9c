from __future__ import annotations

import numpy as np
import pytest

from pipeline.common.files import shipped
from pipeline.model.arm import Arm
from pipeline.model.task import PositionTask
from pipeline.problem.secondary import Secondary, joint_centering, manipulability
from tests.support import differences


@pytest.fixture(scope="module")
def unit() -> PositionTask:
    return PositionTask(Arm.from_urdf(shipped("robots/unit3r.urdf"), "tip"))


def test_the_jacobians_derivative_equals_central_differences(unit: PositionTask, rng: np.random.Generator) -> None:
    q = rng.uniform(-np.pi, np.pi, (100, 3))
    jacobian, gradient = unit.jacobian_and_gradient(q)
    np.testing.assert_allclose(jacobian, unit.jacobian(q), atol=1e-14)
    for j, step in enumerate(1e-5 * np.eye(3)):
        expected = (unit.jacobian(q + step) - unit.jacobian(q - step)) / 2e-5
        np.testing.assert_allclose(gradient[..., j], expected, atol=1e-9)


def test_criteria_and_their_gradients(unit: PositionTask, rng: np.random.Generator) -> None:
    q = rng.uniform(-np.pi, np.pi, (100, 3))
    lower, upper = np.array([-np.pi, -1.7, -1.0]), np.array([np.pi, 1.7, 2.0])
    jacobian = unit.jacobian(q)
    determinant = np.linalg.det(jacobian @ jacobian.swapaxes(1, 2))
    np.testing.assert_allclose(manipulability(unit, q)[0] ** 2, determinant, atol=1e-12)
    expected = [
        -sum(((a - (lo + hi) / 2) / (hi - lo)) ** 2 for a, lo, hi in zip(row, lower, upper, strict=False)) / 6
        for row in q
    ]
    np.testing.assert_allclose(joint_centering(q, lower, upper)[0], expected, atol=1e-14)
    both = Secondary(("manipulability", "joint_centering"), 7.0, lower, upper)
    for row in q[:20]:
        by_differences = differences(lambda x: np.array([both.gain(unit, x[None])[0][0]]), row)
        np.testing.assert_allclose(both.gain(unit, row[None])[1][0], by_differences.ravel(), atol=1e-7)


def test_a_singularity_has_a_finite_gradient(unit: PositionTask) -> None:
    value, gradient = manipulability(unit, np.zeros((1, 3)))
    assert value[0] == pytest.approx(0.0, abs=1e-12)
    assert np.isfinite(gradient).all()


def test_joints_without_a_range_have_no_centre() -> None:
    value, gradient = joint_centering(np.array([[9.0, 0.5]]), np.array([-np.inf, -1.0]), np.array([np.inf, 1.0]))
    assert value[0] == pytest.approx(-(0.25**2) / 4)
    assert gradient[0, 0] == 0.0
