"""What a base does and feels, from a plant that shares nothing with the solver's: Drake's free body with a quaternion.

Where the base floats, its motion is found again from the joint motion alone: the cubic spline through the joints' knots
drives it, and the momentum equation M_bb V = p - M_bm qd_m, in the base's own frame, is integrated by RK4. Momentum is
then computed from that motion by Drake, between the steps. Where the base stands still, the force and torque that hold
it are the inverse dynamics of the same plant.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from pydrake.math import RigidTransform
from pydrake.multibody.plant import MultibodyPlant
from pydrake.multibody.tree import MultibodyForces, RotationalInertia, SpatialInertia, UnitInertia
from scipy.interpolate import CubicSpline
from scipy.spatial.transform import Rotation

from pipeline.common.arrays import Array
from pipeline.evaluation.plant import add_arm
from pipeline.model.arm import Arm
from pipeline.problem.problem import Problem

STEPS = 1000  # of RK4 at least, along the whole motion
LEAST = 4  # of them in every interval
IDENTITY = np.array([0.0, 0.0, 0.0, 1.0])


@dataclass(frozen=True)
class FreeMotion:
    """A floating base's motion, integrated at times (S,) [s]: position (S, 3) [m] and rotation of the root link.

    linear, angular: the largest error of the system's momentum between those times, relative to the largest momentum
    that the moving arm has of its own (with the base at rest). path_error [m]: the end effector's distance from its
    path.
    """

    time: Array
    position: Array
    rotation: Rotation
    linear: float
    angular: float
    path_error: float

    @property
    def turn(self) -> Array:
        """The angle (S,) [rad] by which the root link has turned from its start."""
        return np.asarray((self.rotation * self.rotation[0].inv()).magnitude())


class BasePlant:
    """The arm and its spacecraft as one free body with joints; velocities: [w, v of the root link's origin, qd_m]."""

    def __init__(self, arm: Arm) -> None:
        fixed, plant, craft = arm.on_fixed_base.description, MultibodyPlant(0.0), arm.base.spacecraft
        parts = add_arm(plant, fixed, arm.mounting)
        self.plant, self.root, self.end = plant, parts.root.body(), parts.end
        if craft.mass > 0:
            (xx, xy, xz), (_, yy, yz), (_, _, zz) = craft.inertia
            about = RotationalInertia(xx, yy, zz, xy, xz, yz)
            unit = UnitInertia().SetFromRotationalInertia(about, craft.mass)
            body = plant.AddRigidBody("craft", parts.model, SpatialInertia(craft.mass, np.zeros(3), unit))
            plant.WeldFrames(parts.root, body.body_frame(), RigidTransform(list(craft.com)))
        plant.Finalize()
        self.context, self.forces = plant.CreateDefaultContext(), MultibodyForces(plant)
        first = self.root.floating_velocities_start_in_v()
        self.base, self.joints = np.arange(first, first + 6), [joint.velocity_start() for joint in parts.joints]
        self.places = [joint.position_start() for joint in parts.joints]
        self.floating = np.arange(7) + self.root.floating_positions_start()  # w, x, y, z and the position
        self.start = Rotation.from_euler("xyz", arm.mounting.base_rpy).as_quat(), np.array(arm.mounting.base_position)

    def at(self, position: Array, quaternion: Array, q: Array, velocity: Array) -> None:
        """quaternion (4,), last component real. velocity (6 + joints,): [w, v, qd_m]."""
        x, v = np.empty(7 + len(q)), np.empty(6 + len(q))
        x[self.floating[0]], x[self.floating[1:4]], x[self.floating[4:]] = quaternion[3], quaternion[:3], position
        x[self.places] = q
        v[self.base], v[self.joints] = velocity[:6], velocity[6:]
        self.plant.SetPositions(self.context, x)
        self.plant.SetVelocities(self.context, v)

    def driven(self, q: Array, qd: Array) -> tuple[Array, Array]:
        """Of joints (K, joints) in the root link's own frame: the base's velocity [w, v] (K, 6) without momentum, and
        what each unit of momentum [angular, linear] adds to it (K, 6, 6). Neither depends on the base's pose.
        """
        rows, columns = np.ix_(self.base, self.base), np.ix_(self.base, self.joints)
        own, coupled = np.empty((len(q), 6, 6)), np.empty((len(q), 6, q.shape[1]))
        for i in range(len(q)):
            self.at(np.zeros(3), IDENTITY, q[i], np.zeros(6 + q.shape[1]))
            inertia = np.asarray(self.plant.CalcMassMatrix(self.context))
            own[i], coupled[i] = inertia[rows], inertia[columns]
        adds = np.linalg.inv(own)
        return -(adds @ (coupled @ qd[:, :, None]))[:, :, 0], adds

    def velocity(self, position: Array, quaternion: Array, alone: Array, adds: Array, momentum: Array) -> Array:
        """[w, v] (6,) of the base in the world at which the system has `momentum` (6,): linear, and angular about the
        start. alone (6,) and adds (6, 6) from `driven`.
        """
        way = _matrix(quaternion)
        if momentum.any():
            angular = momentum[3:] - np.cross(position - self.start[1], momentum[:3])
            alone = alone + adds @ np.concatenate([angular @ way, momentum[:3] @ way])
        return np.concatenate([way @ alone[:3], way @ alone[3:]])

    def momentum(self) -> Array:
        """Linear momentum, and angular momentum about the start (6,), in the world."""
        total = self.plant.CalcSpatialMomentumInWorldAboutPoint(self.context, self.start[1])
        return np.concatenate([total.translational(), total.rotational()])

    def reaction(self, q: Array, qd: Array, qdd: Array) -> Array:
        """Force [N] and torque [N m] (6,), about the root link's origin in the world, that hold the base still."""
        quaternion, position = self.start
        self.at(position, quaternion, q, np.concatenate([np.zeros(6), qd]))
        rates = np.zeros(6 + len(q))
        rates[self.joints] = qdd
        tau = self.plant.CalcInverseDynamics(self.context, rates, self.forces)
        tau = np.asarray(tau - self.plant.CalcGravityGeneralizedForces(self.context))[self.base]
        return np.concatenate([tau[3:], tau[:3]])

    def tip(self) -> Array:
        return np.asarray(self.end.CalcPoseInWorld(self.context).translation())


def reactions(arm: Arm, q: Array, qd: Array, qdd: Array) -> Array:
    """Forces and torques (K, 6) that hold the base still while the joints move (K, n); nan where that is not finite."""
    plant, out = BasePlant(arm), np.full((len(q), 6), np.nan)
    for i in np.flatnonzero(np.isfinite(np.hstack([q, qd, qdd])).all(axis=1)):
        out[i] = plant.reaction(q[i], qd[i], qdd[i])
    return out


def integrate(problem: Problem, time: Array, q: Array) -> FreeMotion:
    """The base under the joint motion through q (N + 1, joints) at the knots time (N + 1,)."""
    arm = problem.task.arm
    plant, momentum = BasePlant(arm), np.array(arm.base.spacecraft.momentum, dtype=float)
    joints = CubicSpline(time, q)
    parts = max(LEAST, -(-STEPS // (len(time) - 1)))
    fine = np.interp(np.arange(parts * (len(time) - 1) + 1) / parts, np.arange(len(time)), time)
    quaternion, position = plant.start
    states = [np.concatenate([quaternion, position])]

    stages = np.interp(np.arange(2 * len(fine) - 1) / 2, np.arange(len(fine)), fine)  # RK4's: ends and middles
    alone, adds = plant.driven(joints(stages), joints(stages, 1))

    def rate(state: Array, i: int) -> Array:
        both = plant.velocity(state[4:], state[:4], alone[i], adds[i], momentum)
        (wx, wy, wz), (x, y, z, r) = both[:3], state[:4]
        # dq/dt = (w, 0) q / 2 for an angular velocity w in the world.
        turned = (
            wx * r + wy * z - wz * y,
            wy * r + wz * x - wx * z,
            wz * r + wx * y - wy * x,
            -wx * x - wy * y - wz * z,
        )
        return np.concatenate([np.multiply(turned, 0.5), both[3:]])

    for i, h in enumerate(np.diff(fine)):
        state = states[-1]
        k1 = rate(state, 2 * i)
        k2 = rate(state + h / 2 * k1, 2 * i + 1)
        k3 = rate(state + h / 2 * k2, 2 * i + 1)
        k4 = rate(state + h * k3, 2 * i + 2)
        state = state + h / 6 * (k1 + 2 * k2 + 2 * k3 + k4)
        state[:4] /= np.sqrt(state[:4] @ state[:4])
        states.append(state)
    found = np.array(states)
    return _check(problem, plant, fine, found[:, 4:], found[:, :4], joints, momentum)


def _check(
    problem: Problem, plant: BasePlant, time: Array, position: Array, quaternion: Array, joints: Any, momentum: Array
) -> FreeMotion:
    """The momentum of the integrated motion midway between its steps, by splines; continuous quaternions."""
    moved, turned = CubicSpline(time, position), CubicSpline(time, quaternion)
    middle = (time[1:] + time[:-1]) / 2
    places, ways, q, qd = moved(middle), turned(middle), joints(middle), joints(middle, 1)
    velocity, angular = moved(middle, 1), _angular_velocity(ways, turned(middle, 1))
    ways /= np.linalg.norm(ways, axis=1, keepdims=True)
    error, own = np.empty((len(middle), 6)), np.empty((len(middle), 6))
    for i in range(len(middle)):
        plant.at(places[i], ways[i], q[i], np.concatenate([angular[i], velocity[i], qd[i]]))
        error[i] = plant.momentum() - momentum
        plant.at(places[i], ways[i], q[i], np.concatenate([np.zeros(6), qd[i]]))
        own[i] = plant.momentum()
    linear, angular_error = (
        float(np.linalg.norm(error[:, part], axis=1).max() / max(np.linalg.norm(own[:, part], axis=1).max(), 1e-300))
        for part in (slice(3), slice(3, 6))
    )
    target, rows, q = problem.reference.position(time), problem.task.rows, joints(time)
    off = np.empty(len(time))
    for i in range(len(time)):
        plant.at(position[i], quaternion[i], q[i], np.zeros(6 + q.shape[1]))
        off[i] = np.linalg.norm(plant.tip()[rows] - target[i, : len(rows)])
    return FreeMotion(time, position, Rotation.from_quat(quaternion), linear, angular_error, float(off.max()))


def _matrix(quaternion: Array) -> Array:
    """The rotation matrix (3, 3) of a quaternion (4,) of any length, last component real."""
    x, y, z, r = quaternion / np.sqrt(quaternion @ quaternion)
    return np.array(
        [
            [1 - 2 * (y * y + z * z), 2 * (x * y - z * r), 2 * (x * z + y * r)],
            [2 * (x * y + z * r), 1 - 2 * (x * x + z * z), 2 * (y * z - x * r)],
            [2 * (x * z - y * r), 2 * (y * z + x * r), 1 - 2 * (x * x + y * y)],
        ]
    )


def _angular_velocity(quaternion: Array, rate: Array) -> Array:
    """w (K, 3) in the world of quaternions (K, 4), last component real, that change at `rate`: 2 dq/dt q^-1."""
    vector, real = quaternion[:, :3], quaternion[:, 3:]
    w = rate[:, :3] * real - rate[:, 3:] * vector - np.cross(rate[:, :3], vector)
    return np.asarray(2 * w / (quaternion**2).sum(axis=1, keepdims=True))
