from __future__ import annotations

import pickle
from types import SimpleNamespace

import numpy as np
import pytest
from pydrake.autodiffutils import AutoDiffXd, ExtractGradient, ExtractValue, InitializeAutoDiff
from pydrake.multibody.parsing import Parser
from pydrake.multibody.plant import MultibodyPlant
from pydrake.multibody.tree import MultibodyForces_

from pipeline.common.arrays import Array
from pipeline.model.arm import Arm
from pipeline.model.stack import BLOCK
from pipeline.robot import urdf
from pipeline.robot.mounting import Mounting
from tests.support import differences

JOINTS = [  # type, xyz, rpy, axis: nothing is aligned with anything, one joint slides
    ("revolute", "0 0 0.3", "0 0 0", "0 0 1"),
    ("continuous", "0.05 0 0.1", "-1.5 0 0.2", "0 0 1"),
    ("prismatic", "0 -0.3 0", "1.4 0 0", "0 1 0"),
    ("revolute", "0.08 0 0", "1.5 0.3 0", "0 0 2"),
    ("revolute", "-0.08 0.38 0", "-1.5 0 0", "0.6 0 0.8"),
    ("revolute", "0 0 0.1", "1.5 0 -0.4", "0 -1 0"),
    ("revolute", "0.09 0 0", "1.6 0 0", "1 0 0"),
]


def spatial_urdf() -> str:
    parts = []
    for i, (kind, xyz, rpy, axis) in enumerate(JOINTS, 1):
        parts.append(
            f'<joint name="j{i}" type="{kind}"><parent link="l{i - 1}"/><child link="l{i}"/>'
            f'<origin xyz="{xyz}" rpy="{rpy}"/><axis xyz="{axis}"/>'
            f'<limit lower="-2" upper="2" effort="{10 * i}" velocity="{i}"/></joint>'
            f'<link name="l{i}"><inertial><origin xyz="0.0{i} 0.02 -0.03" rpy="0.1 0.2 0.{i}"/>'
            f'<mass value="{3.5 - 0.4 * i}"/>'
            '<inertia ixx="0.02" iyy="0.025" izz="0.03" ixy="0.002" ixz="-0.001" iyz="0.003"/></inertial></link>'
        )
    return (
        f'<robot name="spatial"><link name="l0"/>{"".join(reversed(parts))}</robot>'  # tip first: order is ours to find
    )


@pytest.fixture(scope="module")
def spatial(tmp_path_factory: pytest.TempPathFactory) -> Arm:
    file = tmp_path_factory.mktemp("robot") / "spatial.urdf"
    file.write_text(spatial_urdf())
    return Arm(urdf.read(file, "l7"), Mounting(offset=(0.02, -0.01, 0.1)))


@pytest.fixture(params=["planar", "spatial"])
def any_arm(request: pytest.FixtureRequest, arm: Arm, spatial: Arm) -> Arm:
    return arm if request.param == "planar" else spatial


def states(arm: Arm, count: int, rng: np.random.Generator) -> tuple[Array, Array, Array]:
    return tuple(rng.uniform(-3, 3, size=(count, arm.n)) for _ in range(3))  # type: ignore[return-value]


class AutoDiffPlant:
    """The robot's own file, parsed and differentiated by Drake; the stacks' XML is not involved."""

    def __init__(self, arm: Arm) -> None:
        plant = MultibodyPlant(0.0)
        Parser(plant).AddModels(str(arm.description.file))
        plant.WeldFrames(plant.world_frame(), plant.GetFrameByName(arm.description.base))
        plant.mutable_gravity_field().set_gravity_vector(np.zeros(3))
        plant.Finalize()
        self.plant, self.point = plant.ToAutoDiffXd(), np.array(arm.mounting.offset, dtype=object).reshape(3, 1)
        self.tip = self.plant.GetFrameByName(arm.description.end_effector)
        self.context = self.plant.CreateDefaultContext()

    def __call__(self, q: Array, qd: Array, qdd: Array) -> tuple[Array, Array, Array]:
        """Position (3), kinetic energy (1) and torque (n), each as rows [value, d/dq, d/dqd, d/dqdd]."""
        x = InitializeAutoDiff(np.concatenate([q, qd, qdd])).ravel()
        self.plant.SetPositionsAndVelocities(self.context, x[: 2 * len(q)])
        forces = MultibodyForces_[AutoDiffXd](self.plant)
        torque = self.plant.CalcInverseDynamics(self.context, x[2 * len(q) :], forces)
        energy = np.array([self.plant.CalcKineticEnergy(self.context)])
        world = self.plant.world_frame()
        position = self.plant.CalcPointsPositions(self.context, self.tip, self.point, world)

        def rows(values: Array) -> Array:
            column = np.asarray(values).reshape(-1, 1)
            return np.hstack([ExtractValue(column), ExtractGradient(column)])

        return rows(position), rows(energy), rows(torque)


def test_planar_arm_equals_the_formulas_written_out(arm: Arm, peer: SimpleNamespace, rng: np.random.Generator) -> None:
    q, qd, qdd = states(arm, 40, rng)
    close = {"atol": 1e-12, "rtol": 1e-11}
    np.testing.assert_allclose(arm.position(q)[:, :2], peer.position(q), **close)
    np.testing.assert_allclose(arm.jacobian(q)[:, :2], peer.jacobian(q), **close)
    np.testing.assert_allclose(arm.jacobian_rate_term(q, qd)[:, :2], peer.jacobian_rate(q, qd), **close)
    np.testing.assert_allclose(arm.mass_matrix(q), peer.mass(q), **close)
    np.testing.assert_allclose(arm.bias(q, qd), peer.bias(q, qd), **close)
    np.testing.assert_allclose(arm.inverse_dynamics(q, qd, qdd), peer.torque(q, qd, qdd), **close)
    np.testing.assert_allclose(arm.kinetic_energy(q, qd), peer.energy(q, qd), **close)
    assert not arm.position(q)[:, 2].any()


def test_derivatives_equal_drakes_autodiff(any_arm: Arm, rng: np.random.Generator) -> None:
    arm, n = any_arm, any_arm.n
    q, qd, qdd = states(arm, 100, rng)
    qd[0], qd[1] = 0.0, 1e-5 * qd[1]  # at rest, and next to it
    drake = AutoDiffPlant(arm)
    position, energy, torque = (np.array(rows) for rows in zip(*map(drake, q, qd, qdd), strict=True))

    x, jacobian = arm.position_and_jacobian(q)
    np.testing.assert_allclose(x, position[:, :, 0], atol=1e-12)
    np.testing.assert_allclose(jacobian, position[:, :, 1 : 1 + n], atol=1e-12)
    np.testing.assert_array_equal(jacobian, arm.jacobian(q))

    value, by_q, by_qd = arm.kinetic_energy_gradient(q, qd)
    got = np.column_stack([value, by_q, by_qd])
    np.testing.assert_allclose(got, energy[:, 0, : 1 + 2 * n], atol=1e-8 * np.abs(energy).max())

    np.testing.assert_allclose(_joined(arm, q, qd, qdd), torque, atol=1e-8 * np.abs(torque).max())


def _joined(arm: Arm, q: Array, qd: Array, qdd: Array) -> Array:
    tau, *gradients = arm.inverse_dynamics_gradient(q, qd, qdd)
    return np.concatenate([tau[:, :, None], *gradients], axis=2)


def test_derivatives_equal_central_differences(any_arm: Arm, rng: np.random.Generator) -> None:
    arm, n = any_arm, any_arm.n
    q, qd, qdd = states(arm, 4, rng)
    _, by_q, by_qd = arm.kinetic_energy_gradient(q, qd)
    jacobian, torque = arm.jacobian(q), _joined(arm, q, qd, qdd)[:, :, 1:]
    for k in range(len(q)):
        energy = differences(lambda x: arm.kinetic_energy(x[None, :n], x[None, n:])[0], np.concatenate([q[k], qd[k]]))
        np.testing.assert_allclose(np.concatenate([by_q[k], by_qd[k]]), energy, atol=1e-6)
        np.testing.assert_allclose(jacobian[k], differences(lambda x: arm.position(x[None])[0], q[k]), atol=1e-8)
        state = np.concatenate([q[k], qd[k], qdd[k]])
        expected = differences(lambda x: arm.inverse_dynamics(*x.reshape(3, 1, n))[0], state)
        np.testing.assert_allclose(torque[k], expected, atol=1e-6)


def test_energy_gradient_equals_the_polarised_bias(any_arm: Arm, rng: np.random.Generator) -> None:
    """dT/dq_i = 1/4 qd'(n(q, qd + e_i) - n(q, qd - e_i)), exact because n is quadratic in qd."""
    q, qd, _ = states(any_arm, 20, rng)
    exact = [
        np.einsum("kn,kn->k", qd, any_arm.bias(q, qd + e) - any_arm.bias(q, qd - e)) / 4 for e in np.eye(any_arm.n)
    ]
    np.testing.assert_allclose(any_arm.kinetic_energy_gradient(q, qd)[1], np.array(exact).T, atol=1e-7)


def test_jacobian_rate_term_is_the_acceleration_left_at_zero_qdd(any_arm: Arm, rng: np.random.Generator) -> None:
    q, qd, _ = states(any_arm, 5, rng)
    step = 1e-6
    ahead, behind = any_arm.jacobian(q + step * qd), any_arm.jacobian(q - step * qd)
    expected = np.einsum("kin,kn->ki", (ahead - behind) / (2 * step), qd)
    np.testing.assert_allclose(any_arm.jacobian_rate_term(q, qd), expected, atol=1e-7)


@pytest.mark.parametrize("count", [1, 24, 25, 26, 60])
def test_stacks_of_any_size_agree_with_one_by_one(any_arm: Arm, count: int, rng: np.random.Generator) -> None:
    assert BLOCK == 25
    q, qd, qdd = states(any_arm, count, rng)
    calls = [
        (any_arm.position, q),
        (any_arm.jacobian, q),
        (any_arm.mass_matrix, q),
        (any_arm.jacobian_rate_term, q, qd),
        (any_arm.bias, q, qd),
        (any_arm.inverse_dynamics, q, qd, qdd),
    ]
    for method, *arguments in calls:
        singly = np.concatenate([method(*(a[k : k + 1] for a in arguments)) for k in range(count)])
        np.testing.assert_allclose(method(*arguments), singly, atol=1e-11, err_msg=method.__name__)
    singly = np.concatenate([_joined(any_arm, q[k : k + 1], qd[k : k + 1], qdd[k : k + 1]) for k in range(count)])
    np.testing.assert_allclose(_joined(any_arm, q, qd, qdd), singly, atol=1e-7)


def test_a_pickled_arm_gives_the_same_numbers(spatial: Arm, rng: np.random.Generator) -> None:
    q, qd, qdd = states(spatial, 17, rng)
    before = spatial.inverse_dynamics(q, qd, qdd)  # its plants exist when it is pickled
    copy = pickle.loads(pickle.dumps(spatial))
    np.testing.assert_array_equal(copy.inverse_dynamics(q, qd, qdd), before)
    np.testing.assert_array_equal(copy.position(q), spatial.position(q))
