"""Roadmap starts on moving bases: metrics beside Drake's, and motions that keep path, momentum and boundary."""

from __future__ import annotations

import numpy as np
import pytest

from pipeline.build.problem import prepare
from pipeline.model.kernel.chain import Chain
from pipeline.model.kernel.system import KernelSystem
from pipeline.search.floating import OnMovingBase
from pipeline.search.roadmap import Roadmap
from tests.support import composed, differences

CYCLE = ("boundary=cyclic", "path=circle", "path.radius=0.05")


@pytest.mark.parametrize("name", ["floating3r", "floating_panda"])
def test_the_kernel_knows_a_moving_base(name: str, rng: np.random.Generator) -> None:
    arm = prepare(composed(f"+experiment={name}")).task.arm
    system = KernelSystem(arm, Chain.of(arm))
    q, qd = rng.uniform(-1, 1, size=(2, 3, arm.n))
    np.testing.assert_allclose(system.mass_matrix(q), arm.mass_matrix(q), atol=1e-11)
    value, by_q = system.momentum_gradient(q, qd)
    np.testing.assert_allclose(value[:, :, None], arm.mass_matrix(q) @ qd[:, :, None], atol=1e-11)
    slope = differences(lambda one: arm.mass_matrix(one[None])[0] @ qd[0], q[0])
    np.testing.assert_allclose(by_q[0], slope, atol=1e-7)


def test_metrics_are_the_objectives_own(rng: np.random.Generator) -> None:
    q = rng.uniform(-1, 1, size=(4, 6))
    problem = prepare(composed("+experiment=floating3r"))
    arm = problem.task.arm
    energy = arm.reduced_inertia(q)
    np.testing.assert_allclose(OnMovingBase(problem).metric(q), energy, atol=1e-12)
    turning = OnMovingBase(prepare(composed("+experiment=floating3r", "objective=base_rotation"))).metric(q)
    by_joints = 2 * np.einsum("ki,kj->kij", arm.motion_map(q)[:, 2], arm.motion_map(q)[:, 2])  # 2 (d yaw)^2
    rest = turning - by_joints
    assert (np.linalg.eigvalsh(turning) > 0).all()
    ratio = rest / energy  # the share of the energy that makes it regular
    np.testing.assert_allclose(ratio, ratio.flat[0], rtol=1e-6)
    assert np.trace(rest, axis1=1, axis2=2).mean() == pytest.approx(0.1 * np.trace(by_joints, axis1=1, axis2=2).mean())


@pytest.mark.slow
@pytest.mark.parametrize(
    "words",
    [
        ("objective=base_rotation", "boundary=free"),
        CYCLE,
        ("base.linear_momentum=[0.05,0,0]", "base.angular_momentum=[0,0,0.02]"),
    ],
    ids=["free", "cyclic", "momentum"],
)
def test_starts_keep_momentum_and_boundary(words: tuple[str, ...]) -> None:
    problem = prepare(composed("+experiment=floating3r", "timing.steps=12", *words))
    arm, times = problem.task.arm, problem.times
    motions = Roadmap(problem, times, np.random.default_rng(3), nodes=40).cheapest(4)
    assert 2 <= len(motions) <= 4
    q, qd = motions[:, :-1].reshape(-1, arm.n), (np.diff(motions, axis=1) / np.diff(times)[:, None]).reshape(-1, arm.n)
    left = arm.base.mean_momentum_residual(arm, q, qd, np.tile(np.diff(times), len(motions)))[0]
    joints = np.einsum("kij,kj->ki", np.abs(arm.mass_matrix(q)[:, :3, 3:]), np.abs(qd[:, 3:]))
    assert np.sqrt(np.mean(left**2)) < 0.1 * np.sqrt(np.mean(joints**2))  # exactly is the solver's task
    np.testing.assert_array_equal(motions[:, 0, :3], np.tile(problem.q_init[:3], (len(motions), 1)))
    error = problem.task.error(
        motions.reshape(-1, arm.n), np.tile(problem.reference.position(times), (len(motions), 1))
    )
    if problem.boundary.value == "cyclic":  # the base has not come back, so that the path is the solver's to find
        turns = (motions[:, -1, 3:] - motions[:, 0, 3:]) / (2 * np.pi)
        np.testing.assert_allclose(turns, np.rint(turns), atol=1e-9)
        assert np.abs(error).max() < 0.1
        return
    assert np.abs(error).max() < 1e-6
    if problem.boundary.value == "fixed":
        assert (motions[:, 0] == problem.q_init).all()
    else:
        assert np.ptp(motions[:, 0], axis=0)[3:].max() > 0.5
