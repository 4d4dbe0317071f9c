"""Arms on a base that moves, against Drake's free body with a quaternion, and a simulation under internal torques."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from pydrake.multibody.parsing import Parser
from pydrake.multibody.plant import MultibodyPlant
from pydrake.multibody.tree import JacobianWrtVariable
from pydrake.systems.analysis import Simulator
from pydrake.systems.framework import DiagramBuilder
from pydrake.systems.primitives import Multiplexer, Sine
from scipy.spatial.transform import Rotation

from pipeline.build.robot import load
from pipeline.common.arrays import Array
from pipeline.evaluation.free_body import BasePlant
from pipeline.evaluation.plant import SinglePlant
from pipeline.model.arm import Arm
from pipeline.model.base import Held
from pipeline.model.coordinates import PLANE, SPACE
from pipeline.model.floating import Floating, pose_coordinates
from pipeline.robot.mounting import Mounting
from pipeline.robot.spacecraft import Spacecraft
from tests.support import composed, robot, within_limits

CRAFT = Spacecraft(12.0, ((0.9, 0.1, 0.0), (0.1, 0.8, -0.05), (0.0, -0.05, 0.7)), (0.05, -0.02, -0.1))
PLATE = Spacecraft(8.0, ((0.3, 0.0, 0.0), (0.0, 0.3, 0.0), (0.0, 0.0, 0.5)), (-0.1, 0.05, 0.0))
MOVING = {"momentum": (0.4, -0.3, 0.2, 0.05, -0.08, 0.1)}
KINDS = ("planar3r_base", "planar4r", "panda", "xarm7", "mounted panda", "panda with momentum")


def on_craft(kind: str) -> Arm:
    """The arm on a spacecraft; in a mount that is shifted and turned, with payload and rotors, or with momentum."""
    if kind == "planar3r_base":
        return Arm(robot(kind).description, robot(kind).mounting, Floating(Spacecraft(), PLANE))
    if kind == "planar4r":
        return Arm(robot(kind).description, robot(kind).mounting, Floating(PLATE, PLANE))
    arm, moving = robot(kind.split()[-1] if kind.startswith("mounted") else kind.split()[0]), replace(CRAFT, **MOVING)
    if kind == "mounted panda":
        mounting = Mounting(
            (0.02, 0.0, 0.05), base_position=(1.0, -2.0, 0.5), base_rpy=(0.3, -0.4, 0.5), payload=0.7, armature=0.02
        )
        return Arm(arm.description, mounting, Floating(moving))
    return Arm(arm.description, arm.mounting, Floating(moving if kind == "panda with momentum" else CRAFT))


def states(arm: Arm, count: int, rng: np.random.Generator) -> tuple[Array, Array]:
    """Configurations and velocities (count, n): the base anywhere, its pitch away from 90 degrees."""
    base = rng.uniform(-1.0, 1.0, size=(count, arm.base.count))
    joints = within_limits(arm.on_fixed_base, count, rng)
    return np.hstack([base, joints]), rng.normal(size=(count, arm.n))


@pytest.fixture(params=KINDS)
def arm(request: pytest.FixtureRequest) -> Arm:
    return on_craft(request.param)


def pose(arm: Arm, q: Array) -> tuple[Array, Rotation]:
    """The base's place in the world by its coordinates: intrinsic yaw, pitch, roll after the shift, in the mount."""
    mount = Rotation.from_euler("xyz", arm.mounting.base_rpy)
    if arm.base.count == 3:
        shift, turn = np.array([q[0], q[1], 0.0]), Rotation.from_euler("z", q[2])
    else:
        shift, turn = q[:3], Rotation.from_euler("ZYX", q[3:6])
    return arm.mounting.base_position + mount.apply(shift), mount * turn


def free_state(arm: Arm, q: Array, qd: Array) -> tuple[BasePlant, Array]:
    """Drake's free body in the same state, its base velocities by central differences of the pose; and these."""
    plant, h, nb = BasePlant(arm), 1e-6, arm.base.count
    position, rotation = pose(arm, q)
    (ahead, turned), (behind, back) = pose(arm, q + h * qd), pose(arm, q - h * qd)
    velocity = np.concatenate([(turned * back.inv()).as_rotvec(), ahead - behind]) / (2 * h)
    plant.at(position, rotation.as_quat(), q[nb:], np.concatenate([velocity, qd[nb:]]))
    return plant, velocity


def test_energy_and_place_are_those_of_a_free_body(arm: Arm, rng: np.random.Generator) -> None:
    q, qd = states(arm, 6, rng)
    energy, tip = arm.kinetic_energy(q, qd), arm.position(q)
    for i in range(len(q)):
        free, _ = free_state(arm, q[i], qd[i])
        assert free.plant.CalcKineticEnergy(free.context) == pytest.approx(energy[i], rel=1e-7)
        np.testing.assert_allclose(free.tip(), tip[i], atol=1e-12)


def test_motion_conserves_the_momentum_it_should(arm: Arm, rng: np.random.Generator) -> None:
    """Drake's momentum of the motion that `follow` gives is the spacecraft's, about the place where the base starts."""
    q, qd = states(arm, 6, rng)
    moving = arm.follow(q, qd)
    np.testing.assert_array_equal(moving[:, arm.base.count :], qd[:, arm.base.count :])
    assert np.abs(arm.base.momentum_residual(arm, q, moving)[0]).max() < 1e-12
    for i in range(len(q)):
        free, velocity = free_state(arm, q[i], moving[i])
        np.testing.assert_allclose(free.momentum(), arm.base.spacecraft.momentum, atol=1e-7)
        assert np.abs(velocity).max() > 1e-3
        # And the other way round: the free body's own momentum equation gives these velocities.
        position, rotation = pose(arm, q[i])
        (alone,), (adds,) = free.driven(q[i : i + 1, arm.base.count :], qd[i : i + 1, arm.base.count :])
        wanted = free.velocity(position, rotation.as_quat(), alone, adds, np.array(arm.base.spacecraft.momentum))
        np.testing.assert_allclose(wanted, velocity, atol=1e-7)


def test_the_evaluations_own_plant_says_the_same(arm: Arm, rng: np.random.Generator) -> None:
    """What a motion of the joints does to the base, from a plant that holds one arm only."""
    plant, (q, qd) = SinglePlant(arm), states(arm, 4, rng)
    moving = arm.follow(q, qd)
    for i in range(len(q)):
        plant.at(q[i], qd[i])
        own = plant.motion_map() @ qd[i, arm.base.count :] + plant.drift()
        np.testing.assert_allclose(own, moving[i], atol=1e-10)


def test_generalized_jacobian_and_reduced_inertia(arm: Arm, rng: np.random.Generator) -> None:
    """J* = J_m - J_b M_bb^-1 M_bm and M* = M_mm - M_mb M_bb^-1 M_bm of Drake's free body."""
    q, _ = states(arm, 4, rng)
    nb, spread = arm.base.count, arm.motion_map(q)
    ours, reduced = arm.jacobian(q) @ spread, arm.reduced_inertia(q)
    for i in range(len(q)):
        free, _ = free_state(arm, q[i], np.zeros(arm.n))
        inertia = np.asarray(free.plant.CalcMassMatrix(free.context))
        both = free.plant.CalcJacobianTranslationalVelocity(
            free.context,
            JacobianWrtVariable.kV,
            free.end,
            np.zeros(3),
            free.plant.world_frame(),
            free.plant.world_frame(),
        )
        b, m = free.base, free.joints
        follow = np.linalg.solve(inertia[np.ix_(b, b)], inertia[np.ix_(b, m)])
        np.testing.assert_allclose(ours[i], both[:, m] - both[:, b] @ follow, atol=1e-10)
        np.testing.assert_allclose(reduced[i], inertia[np.ix_(m, m)] - inertia[np.ix_(m, b)] @ follow, atol=1e-10)
        unweighted = np.tile(np.eye(arm.n - nb), (1, 1, 1))
        np.testing.assert_allclose(arm.lift(q[i : i + 1], unweighted)[0], spread[i] @ spread[i].T, atol=1e-12)
        inverse = spread[i] @ np.linalg.inv(reduced[i]) @ spread[i].T
        np.testing.assert_allclose(arm.inverse_inertia(q[i : i + 1])[0], inverse, rtol=1e-8, atol=1e-9)


@pytest.mark.slow
def test_derivatives_equal_central_differences(arm: Arm, rng: np.random.Generator) -> None:
    q, qd = states(arm, 100, rng)
    h, units = 1e-6, np.eye(arm.n)

    def by(function: Any, at: Array) -> Array:
        return np.stack([(function(at + h * e) - function(at - h * e)) / (2 * h) for e in units], axis=-1)

    value, by_q, by_qd = arm.base.momentum_residual(arm, q, qd)
    scale = 1 + np.abs(value).max()
    np.testing.assert_allclose(by_q, by(lambda x: arm.base.momentum_residual(arm, x, qd)[0], q), atol=1e-6 * scale)
    np.testing.assert_allclose(by_qd, by(lambda x: arm.base.momentum_residual(arm, q, x)[0], qd), atol=1e-7 * scale)
    value, by_q, by_qd = arm.base.turning(q, qd)
    np.testing.assert_allclose(by_q, by(lambda x: arm.base.turning(x, qd)[0], q), atol=1e-7)
    np.testing.assert_allclose(by_qd, by(lambda x: arm.base.turning(q, x)[0], qd), atol=1e-7)
    np.testing.assert_allclose(value, np.einsum("ki,kij,kj->k", qd, arm.base.turning_metric(q), qd), rtol=1e-12)
    cosine, by_q = arm.base.attitude_cosine(q)
    np.testing.assert_allclose(by_q, by(lambda x: arm.base.attitude_cosine(x)[0], q), atol=1e-8)
    for i in range(5):
        turn = pose(arm, q[i])[1] * Rotation.from_euler("xyz", arm.mounting.base_rpy).inv()
        assert np.cos(turn.magnitude()) == pytest.approx(cosine[i], abs=1e-12)
        _, velocity = free_state(arm, q[i], qd[i])
        assert velocity[:3] @ velocity[:3] == pytest.approx(value[i], rel=1e-6)


def test_center_of_mass_and_mean_momentum(arm: Arm, rng: np.random.Generator) -> None:
    """The centre is Drake's; over an interval the linear momentum is what moves it, the angular one is the middle's."""
    base, (q, qd) = arm.base, states(arm, 3, rng)
    assert isinstance(base, Floating)
    dt, h = np.array([0.1, 0.2, 0.3]), 1e-5
    center, _ = base.center_of_mass(arm, q)
    count, mount = center.shape[1], Rotation.from_euler("xyz", arm.mounting.base_rpy)
    value, by_q, by_qd = arm.base.mean_momentum_residual(arm, q, qd, dt)
    after = base.center_of_mass(arm, q + dt[:, None] * qd)[0]
    linear = mount.inv().apply(arm.base.spacecraft.momentum[:3])[:count]
    np.testing.assert_allclose(value[:, :count], base.mass(arm) * (after - center) / dt[:, None] - linear, atol=1e-11)
    middle = arm.base.momentum_residual(arm, q + dt[:, None] / 2 * qd, qd)[0]
    np.testing.assert_allclose(value[:, count:], middle[:, count:], atol=1e-11)
    for i in range(3):
        free, _ = free_state(arm, q[i], qd[i])
        seen = mount.inv().apply(free.plant.CalcCenterOfMassPositionInWorld(free.context) - arm.mounting.base_position)
        np.testing.assert_allclose(center[i], seen[:count], atol=1e-10)
        assert base.mass(arm) == pytest.approx(free.plant.CalcTotalMass(free.context), rel=1e-12)
    scale = 1 + np.abs(by_q).max() + np.abs(by_qd).max()
    for j, unit in enumerate(np.eye(arm.n)):
        for at, got in (((h * unit, 0.0), by_q), ((0.0, h * unit), by_qd)):
            ahead, behind = (
                arm.base.mean_momentum_residual(arm, q + sign * at[0], qd + sign * at[1], dt)[0] for sign in (1, -1)
            )
            np.testing.assert_allclose(got[:, :, j], (ahead - behind) / (2 * h), atol=1e-7 * scale)


def test_in_the_plane_or_in_space() -> None:
    assert pose_coordinates(robot("planar3r"), PLATE) is PLANE
    assert pose_coordinates(robot("planar3r_base"), Spacecraft()) is PLANE
    for arm, craft in (
        (robot("planar3r"), replace(PLATE, com=(0.0, 0.0, 0.1))),
        (robot("planar3r"), CRAFT),
        (robot("panda"), PLATE),
    ):
        assert pose_coordinates(arm, craft) is SPACE


def test_where_the_base_may_be_after_a_cycle(arm: Arm, rng: np.random.Generator) -> None:
    """Off its start by turns that leave the system's centre of mass; anywhere, if that drifts."""
    q, _ = states(arm, 1, rng)
    turns = arm.base.after_cycle(arm, q[0])
    if any(arm.base.spacecraft.momentum[:3]):
        assert turns is None
        return
    assert turns is not None
    assert turns.shape == (arm.base.count, 1 if arm.base.count == 3 else 3)
    for turn in turns.T:
        free, _ = free_state(arm, q[0], np.concatenate([turn, np.zeros(arm.n - arm.base.count)]))
        assert np.abs(free.plant.CalcCenterOfMassTranslationalVelocityInWorld(free.context)).max() < 1e-7


def test_a_held_base_stands_still(rng: np.random.Generator) -> None:
    arm = Arm(robot("panda").description, base=Held())
    q, qd = states(arm, 3, rng)
    assert not arm.follow(q, qd)[:, :6].any()
    np.testing.assert_allclose(arm.reduced_inertia(q), arm.mass_matrix(q)[:, 6:, 6:])


@pytest.mark.slow
def test_simulation_under_internal_torques() -> None:
    """Two seconds of Drake's Simulator: what is between the joints changes no momentum, and the base does as B says."""
    arm = on_craft("panda")
    xml, root = arm.on_fixed_base.description.for_drake
    builder = DiagramBuilder()
    plant = builder.AddSystem(MultibodyPlant(0.0))
    (model,) = Parser(plant).AddModelsFromString(xml, "urdf")
    plant.mutable_gravity_field().set_gravity_vector(np.zeros(3))
    other = BasePlant(arm)  # the spacecraft's body, as it is built there
    craft = plant.AddRigidBody("craft", model, other.plant.GetBodyByName("craft").default_spatial_inertia())
    from pydrake.math import RigidTransform

    plant.WeldFrames(plant.GetBodyByName(root).body_frame(), craft.body_frame(), RigidTransform(list(CRAFT.com)))
    names = arm.description.actuated
    for name in names:
        plant.AddJointActuator(name, plant.GetJointByName(name))
    plant.Finalize()
    sources = builder.AddSystem(Multiplexer(len(names)))
    for j in range(len(names)):
        wave = builder.AddSystem(Sine(0.4 / (1 + j), 2.0 + j, 0.3 * j, 1))
        builder.Connect(wave.get_output_port(0), sources.get_input_port(j))
    builder.Connect(sources.get_output_port(), plant.get_actuation_input_port())
    simulator = Simulator(builder.Build())
    simulator.get_mutable_integrator().set_target_accuracy(1e-10)
    context = simulator.get_mutable_context()
    inner = plant.GetMyMutableContextFromRoot(context)
    q = np.array(composed("robot=panda").robot.q_init)
    body = plant.GetBodyByName(root)
    positions = plant.GetPositions(inner).copy()
    positions[[plant.GetJointByName(name).position_start() for name in names]] = q
    plant.SetPositions(inner, positions)
    plant.SetFreeBodyPose(inner, body, RigidTransform())
    columns = [plant.GetJointByName(name).velocity_start() for name in names]
    moved = 0.0
    for until in (0.5, 1.0, 1.5, 2.0):
        simulator.AdvanceTo(until)
        momentum = plant.CalcSpatialMomentumInWorldAboutPoint(inner, np.zeros(3))
        assert np.abs(momentum.rotational()).max() < 1e-8
        assert np.abs(momentum.translational()).max() < 1e-8
        velocities = np.asarray(plant.GetVelocities(inner))
        qd = velocities[columns]
        place = body.EvalPoseInWorld(inner)
        yaw, pitch, roll = Rotation.from_matrix(place.rotation().matrix()).as_euler("ZYX")
        joints = np.asarray(plant.GetPositions(inner))[[plant.GetJointByName(n).position_start() for n in names]]
        coordinates = np.concatenate([place.translation(), [yaw, pitch, roll], joints])[None]
        whole = arm.follow(coordinates, np.concatenate([np.zeros(6), qd])[None])
        twist = body.EvalSpatialVelocityInWorld(inner)
        np.testing.assert_allclose(whole[0, :3], twist.translational(), atol=1e-8)
        assert arm.base.turning(coordinates, whole)[0][0] == pytest.approx(
            twist.rotational() @ twist.rotational(), abs=1e-9
        )
        tip = plant.GetFrameByName(arm.description.end_effector).CalcSpatialVelocityInWorld(inner).translational()
        spread = arm.motion_map(coordinates)
        np.testing.assert_allclose((arm.jacobian(coordinates) @ spread)[0] @ qd, tip, atol=1e-8)
        energy = 0.5 * qd @ arm.reduced_inertia(coordinates)[0] @ qd
        assert energy == pytest.approx(plant.CalcKineticEnergy(inner), rel=1e-8)
        moved = max(moved, float(np.linalg.norm(twist.rotational())))
    assert moved > 1e-3, "the base hardly turns: the test shows nothing"


def test_the_description_names_what_it_adds() -> None:
    description = on_craft("xarm7").description
    assert description.joints[:6] == ("base_x", "base_y", "base_z", "base_yaw", "base_pitch", "base_roll")
    assert description.actuated == robot("xarm7").description.joints
    assert load(composed("robot=xarm7").robot).description.base == "world"
