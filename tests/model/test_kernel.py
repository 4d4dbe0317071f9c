"""The vectorised kernel beside Drake's plant, at random configurations of every arm of the suite."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from pipeline.common.arrays import Array
from pipeline.model.arm import Arm
from pipeline.model.kernel.arm import BLOCK, KernelArm
from pipeline.model.kernel.chain import Chain
from pipeline.model.kernel.energy import energy, mass_matrix
from pipeline.model.kernel.few import Few
from pipeline.model.kernel.few_rows import FewRows
from pipeline.model.kernel.rows import TaskRows
from pipeline.model.kernel.torque import inverse_dynamics
from pipeline.model.task import PoseTask, PositionTask, Task
from pipeline.robot import urdf
from pipeline.robot.mounting import Mounting
from tests.model.test_arm import AutoDiffPlant, states
from tests.model.test_arm import spatial as spatial  # a fixture: one sliding joint, nothing aligned
from tests.support import differences, robot

ARMS = ("planar3r", "planar4r", "unit3r", "panda", "xarm7", "generated")


def with_sliding_joints(folder: Path) -> Arm:
    """Six joints, two of them sliding, mounted aslant under gravity, with payload, rotor inertia and a tool."""
    kinds = ("revolute", "prismatic", "revolute", "continuous", "prismatic", "revolute")
    parts = ['<link name="l0"/>']
    for i, kind in enumerate(kinds, 1):
        axis = ("0 0 1", "0.6 0 0.8", "0 1 0", "1 0 0", "0 -0.6 0.8", "0 1 0")[i - 1]
        limit = "" if kind == "continuous" else '<limit lower="-2" upper="2" effort="9" velocity="9"/>'
        parts.append(
            f'<joint name="j{i}" type="{kind}"><parent link="l{i - 1}"/><child link="l{i}"/>'
            f'<origin xyz="0.1 0.0{i} 0.2" rpy="0.{i} -0.3 0.2"/><axis xyz="{axis}"/>{limit}</joint>'
            f'<link name="l{i}"><inertial><origin xyz="0.0{i} 0.02 -0.03" rpy="0.1 0.2 0.{i}"/>'
            f'<mass value="{0.5 * i}"/>'
            '<inertia ixx="0.02" iyy="0.025" izz="0.03" ixy="0.002" ixz="-0.001" iyz="0.003"/></inertial></link>'
        )
    file = folder / "sliding.urdf"
    file.write_text(f'<robot name="sliding">{"".join(parts)}</robot>')
    mounting = Mounting(
        offset=(0.02, -0.01, 0.1),
        offset_rpy=(0.3, -0.2, 0.5),
        base_position=(0.1, 0.2, -0.3),
        base_rpy=(0.4, -0.5, 0.6),
        gravity=(0.3, -1.0, -9.81),
        payload=1.7,
        armature=(0.1, 0.0, 0.3, 0.02, 0.5, 0.04),
    )
    return Arm(urdf.read(file, "l6"), mounting)


@pytest.fixture(scope="module", params=ARMS)
def arm(request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory) -> Arm:
    return with_sliding_joints(tmp_path_factory.mktemp("arm")) if request.param == "generated" else robot(request.param)


def compare(got: Array, right: Array, relative: float) -> None:
    np.testing.assert_allclose(got, right, rtol=0, atol=relative * max(1.0, float(np.abs(right).max())))


def test_values_equal_drakes(arm: Arm, rng: np.random.Generator) -> None:
    chain = Chain.of(arm)
    q, qd, qdd = states(arm, 40, rng)
    at = chain.places(q)
    position, rotation, jacobian = arm.pose_and_jacobian(q)
    x = chain.tip_position(at)
    compare(x.T, position, 1e-12)
    compare(chain.tip_rotation(at), rotation, 1e-12)
    compare(chain.tip_jacobian(at, x).transpose(2, 1, 0), jacobian[:, 3:], 1e-12)
    compare(at.turning.transpose(2, 1, 0), jacobian[:, :3], 1e-12)
    found = energy(chain, q, qd)
    compare(found.value, arm.kinetic_energy(q, qd), 1e-12)
    compare(found.by_qd, (arm.mass_matrix(q) @ qd[:, :, None])[:, :, 0], 1e-12)
    compare(found.mass, arm.mass_matrix(q), 1e-12)
    compare(mass_matrix(chain, q), arm.mass_matrix(q), 1e-12)
    compare(inverse_dynamics(chain, q, qd, qdd)[0], arm.inverse_dynamics(q, qd, qdd), 1e-12)


def test_an_arm_on_the_kernel_is_the_same_arm(arm: Arm, rng: np.random.Generator) -> None:
    """More knots than one block holds; the derivative of the energy by q is by differences in Drake's arm."""
    own = KernelArm(arm)
    q, qd, _ = states(arm, BLOCK + 3, rng)
    compare(own.position(q), arm.position(q), 1e-12)
    compare(own.jacobian(q), arm.jacobian(q), 1e-12)
    compare(own.spatial_jacobian(q), arm.spatial_jacobian(q), 1e-12)
    compare(own.jacobian_rate_term(q, qd), arm.jacobian_rate_term(q, qd), 1e-12)
    for one, other in (
        (own.position_and_jacobian(q), arm.position_and_jacobian(q)),
        (own.jacobian_and_gradient(q), arm.jacobian_and_gradient(q)),
        (own.kinetic_energy_gradient(q, qd), arm.kinetic_energy_gradient(q, qd)),
    ):
        for mine, drakes, exact in zip(one, other, (1e-12, 1e-8, 1e-12), strict=False):
            compare(mine, drakes, exact)


def test_derivatives_equal_those_of_drakes_plant(arm: Arm, rng: np.random.Generator) -> None:
    """First derivatives as the stacked plant has them; second ones by differences of Drake's first."""
    chain = Chain.of(arm)
    q, qd, qdd = states(arm, 4, rng)
    found = energy(chain, q, qd)
    by_q = arm.kinetic_energy_gradient(q, qd)[1]
    compare(found.by_q, by_q, 1e-8)
    mixed = np.array(
        [
            differences(lambda x, v=v: arm.kinetic_energy_gradient(x[None], v[None])[2][0], p)
            for p, v in zip(q, qd, strict=True)
        ]
    )
    compare(found.mixed, mixed, 1e-8)
    compare(inverse_dynamics(chain, q, qd, qdd)[1], arm.inverse_dynamics_gradient(q, qd, qdd)[1], 1e-8)
    compare(inverse_dynamics(chain, q, qd, qdd)[2], arm.inverse_dynamics_gradient(q, qd, qdd)[2], 1e-8)
    compare(inverse_dynamics(chain, q, qd, qdd)[3], arm.mass_matrix(q), 1e-12)


def test_second_derivatives_are_differences_of_the_first(arm: Arm, rng: np.random.Generator) -> None:
    chain = Chain.of(arm)
    q, qd, _ = states(arm, 4, rng)
    found = energy(chain, q, qd)
    by_q_q = np.array(
        [differences(lambda x, v=v: energy(chain, x[None], v[None]).by_q[0], p) for p, v in zip(q, qd, strict=True)]
    )
    compare(found.by_q_q, by_q_q, 1e-8)
    whole, cheap = energy(chain, q, qd), energy(chain, q, qd, second=False)
    np.testing.assert_array_equal(whole.by_q, cheap.by_q)
    assert not cheap.mass.size


def test_the_kernel_for_a_few_knots_is_the_same(arm: Arm, rng: np.random.Generator) -> None:
    """Values beside Drake's, second derivatives beside the other kernel's, twice in the same arrays."""
    few, chain = Few(Chain.of(arm), 3), Chain.of(arm)
    for _ in range(2):
        q, qd, _ = states(arm, 3, rng)
        few.place(q)
        position, rotation, jacobian = arm.pose_and_jacobian(q)
        x, columns = few.tip_and_jacobian()
        compare(x, position, 1e-12)
        compare(few.tip_rotation(), rotation, 1e-12)
        compare(columns.swapaxes(1, 2), jacobian[:, 3:], 1e-12)
        compare(few.turning().swapaxes(1, 2), jacobian[:, :3], 1e-12)
        compare(few.mass_matrix(), arm.mass_matrix(q), 1e-12)
        own, other = few.energy(qd), energy(chain, q, qd)
        compare((qd * own.by_qd).sum(axis=1) / 2, arm.kinetic_energy(q, qd), 1e-12)
        for part in ("by_q", "by_qd", "mass", "mixed", "by_q_q"):
            compare(getattr(own, part), getattr(other, part), 1e-12)


def test_the_exact_derivatives_equal_drakes_autodiff(spatial: Arm, rng: np.random.Generator) -> None:
    """The sliding arm's own file, differentiated by Drake: no differences on either side."""
    chain, n = Chain.of(spatial), spatial.n
    q, qd, qdd = states(spatial, 20, rng)
    drake = AutoDiffPlant(spatial)
    position, kinetic, torque = (np.array(rows) for rows in zip(*map(drake, q, qd, qdd), strict=True))
    tau, by_q, by_qd, M = inverse_dynamics(chain, q, qd, qdd)
    compare(np.concatenate([tau[:, :, None], by_q, by_qd, M], axis=2), torque, 1e-12)
    found = energy(chain, q, qd)
    compare(np.column_stack([found.value, found.by_q, found.by_qd]), kinetic[:, 0, : 1 + 2 * n], 1e-12)
    at = chain.places(q)
    x = chain.tip_position(at)
    compare(chain.tip_jacobian(at, x).transpose(2, 1, 0), position[:, :, 1 : 1 + n], 1e-12)


@pytest.mark.parametrize("kind", ["plane", "space", "pose", "pointing"])
def test_rows_of_every_task(kind: str, rng: np.random.Generator) -> None:
    name = "planar4r" if kind == "plane" else "panda"
    task: Task = {
        "plane": lambda arm: PositionTask(arm),
        "space": lambda arm: PositionTask(arm, ("x", "y", "z")),
        "pose": lambda arm: PoseTask(arm),
        "pointing": lambda arm: PoseTask(arm, (0.0, 0.6, 0.8)),
    }[kind](robot(name))
    rows = TaskRows(Chain.of(task.arm), task)
    q, _, _ = states(task.arm, 6, rng)
    away = task.value(q + 0.2 * rng.normal(size=q.shape))
    found = rows.evaluate(rows.chain.places(q), away)
    error, jacobian = task.error_and_jacobian(q, away)
    compare(found.error, error, 1e-12)
    compare(rows.error(rows.chain.places(q), away), error, 1e-12)
    compare(found.jacobian, jacobian, 1e-11)
    # second derivatives, on the target
    target, pull = task.value(q), rng.normal(size=(len(q), task.m))
    found = rows.evaluate(rows.chain.places(q), target)
    right = [
        differences(lambda x, k=k: pull[k] @ task.error_and_jacobian(x[None], target[k : k + 1])[1][0], q[k], 1e-5)
        for k in range(len(q))
    ]
    compare(rows.curvature(found.columns, pull), np.array(right), 1e-7)
    few = FewRows(Few(rows.chain, len(q)), task)
    few.few.place(q)
    own = few.evaluate(target)
    compare(few.curvature(own, pull), np.array(right), 1e-7)
    own = few.evaluate(away)
    compare(own.error, error, 1e-12)
    compare(own.jacobian, jacobian, 1e-11)
