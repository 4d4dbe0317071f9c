"""Bases that stand still: they answer every question with what changes nothing. The others: `test_floating.py`."""

from __future__ import annotations

import pickle

import numpy as np
import pytest

from pipeline.model.arm import Arm
from pipeline.model.base import FIXED, Base, Held
from pipeline.model.coordinates import PLANE
from pipeline.robot.mounting import Mounting
from tests.support import robot, within_limits

LOADED = Mounting(gravity=(0.0, 0.5, -9.8), payload=0.4, armature=0.03)


@pytest.mark.parametrize(("base", "count"), [(FIXED, 0), (Held(), 6), (Held(PLANE), 3)], ids=["fixed", "held", "plane"])
def test_a_base_that_stands_still_changes_nothing(base: Base, count: int, rng: np.random.Generator) -> None:
    plain = Arm(robot("planar4r").description, LOADED)
    arm = Arm(plain.description, LOADED, base)
    joints, rates = within_limits(plain, 5, rng), rng.normal(size=(5, plain.n))
    zero = np.zeros((5, count))
    q, qd = np.hstack([zero, joints]), np.hstack([zero, rates])
    assert arm.n == count + plain.n
    np.testing.assert_array_equal(q[:, arm.joints], joints)
    np.testing.assert_array_equal(arm.follow(q, np.hstack([zero + 1.0, rates])), qd)
    np.testing.assert_array_equal(base.drift(arm, q), 0.0)
    # What it says of the joints is what the arm without coordinates of a base says of them.
    inertia = plain.mass_matrix(joints)
    np.testing.assert_allclose(arm.reduced_inertia(q), inertia, atol=1e-12)
    np.testing.assert_allclose(arm.inverse_inertia(q)[:, arm.joints, arm.joints], np.linalg.inv(inertia), rtol=1e-9)
    assert not arm.inverse_inertia(q)[:, :count].any()
    np.testing.assert_allclose(arm.jacobian(q) @ arm.motion_map(q), plain.jacobian(joints), atol=1e-12)
    tau = arm.inverse_dynamics(q, qd, qd)[:, arm.joints]
    np.testing.assert_allclose(tau, plain.inverse_dynamics(joints, rates, rates), atol=1e-10)
    # No momentum to conserve, nowhere to drift, nothing that turns.
    for rows in (*base.momentum_residual(arm, q, qd), *base.mean_momentum_residual(arm, q, qd, np.ones(5))):
        assert rows.shape[:2] == (5, 0)
    after = base.after_cycle(arm, q[0])
    assert after is not None
    assert after.shape == (count, 0)
    assert base.turning_metric(q).shape == (5, arm.n, arm.n)
    for value in (base.turning_metric(q), *base.turning(q, qd), base.attitude_cosine(q)[1]):
        assert not value.any()
    np.testing.assert_array_equal(base.attitude_cosine(q)[0], 1.0)
    assert base.spacecraft.mass == 0.0
    assert q[:, base.angles].shape[1] == {0: 0, 3: 1, 6: 3}[count]


def test_the_arm_without_its_base() -> None:
    plain = Arm(robot("planar4r").description, LOADED)
    held = Arm(plain.description, LOADED, Held(PLANE))
    assert plain.on_fixed_base is plain
    assert held.on_fixed_base.description is plain.description
    assert held.on_fixed_base.mounting is LOADED
    assert pickle.loads(pickle.dumps(held)).base == held.base
