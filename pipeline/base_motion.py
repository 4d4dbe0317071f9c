"""What a base does and feels, from a plant that shares nothing with the solver's: Drake's own free body with a quaternion.

Where the base floats, its motion is found again from the joint motion alone: the cubic spline through the joints' knots
drives it, and the momentum equation M_bb V = p - M_bm qd_m is integrated by RK4. Momentum is then computed from that
motion by Drake, between the steps. Where the base stands still, the force and torque that hold it are the inverse
dynamics of the same plant.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from pydrake.math import RigidTransform, RotationMatrix
from pydrake.multibody.parsing import Parser
from pydrake.multibody.plant import MultibodyPlant
from pydrake.multibody.tree import FixedOffsetFrame, MultibodyForces, RotationalInertia, SpatialInertia, UnitInertia
from scipy.interpolate import CubicSpline
from scipy.spatial.transform import Rotation

from pipeline.arm import Arm
from pipeline.arrays import Array
from pipeline.floating import FloatingArm
from pipeline.problem import Problem

STEPS = 1000  # of RK4 at least, along the whole motion
LEAST = 4  # of them in every interval


@dataclass(frozen=True)
class Floating:
    """A floating base's motion, integrated at times (S,) [s]: position (S, 3) [m] and rotation of the root link.

    linear, angular: the largest error of the system's momentum between those times, relative to the largest momentum
    that the moving arm has of its own (with the base at rest). path_error [m]: the end effector's distance from its path.
    """

    time: Array
    position: Array
    rotation: Rotation
    linear: float
    angular: float
    path_error: float


class BasePlant:
    """The arm and its spacecraft as one free body with joints; velocities are [w, v of the root link's origin, qd_m]."""

    def __init__(self, arm: Arm) -> None:
        fixed = arm.on_fixed_base if isinstance(arm, FloatingArm) else arm
        xml, root = fixed.description.for_drake
        plant = self.plant = MultibodyPlant(0.0)
        (model,) = Parser(plant).AddModelsFromString(xml, "urdf")
        self.root = plant.GetBodyByName(root, model)
        link = plant.GetFrameByName(fixed.description.end_effector, model)
        tool = RigidTransform(RotationMatrix(Rotation.from_euler("xyz", fixed.offset_rpy).as_matrix()), fixed.offset)
        self.end = plant.AddFrame(FixedOffsetFrame("end", link, tool, model))
        if fixed.payload > 0:
            ball = plant.AddRigidBody("load", model, SpatialInertia.SolidSphereWithMass(fixed.payload, 1e-6))
            plant.WeldFrames(self.end, ball.body_frame())
        if isinstance(arm, FloatingArm) and arm.spacecraft.mass > 0:
            craft = arm.spacecraft
            (xx, xy, xz), (_, yy, yz), (_, _, zz) = craft.inertia
            about = RotationalInertia(xx, yy, zz, xy, xz, yz)
            unit = UnitInertia().SetFromRotationalInertia(about, craft.mass)
            body = plant.AddRigidBody("craft", model, SpatialInertia(craft.mass, np.zeros(3), unit))
            plant.WeldFrames(self.root.body_frame(), body.body_frame(), RigidTransform(list(craft.com)))
        joints = [plant.GetJointByName(name, model) for name in fixed.description.joints]
        for joint, inertia in zip(joints, fixed.armature, strict=True):
            plant.AddJointActuator(joint.name(), joint).set_default_rotor_inertia(inertia)
        plant.mutable_gravity_field().set_gravity_vector(fixed.gravity)
        plant.Finalize()
        self.context, self.forces = plant.CreateDefaultContext(), MultibodyForces(plant)
        first = self.root.floating_velocities_start_in_v()
        self.base, self.joints = np.arange(first, first + 6), [joint.velocity_start() for joint in joints]
        self.places = [joint.position_start() for joint in joints]
        self.start = Rotation.from_euler("xyz", fixed.base_rpy), fixed.base_position

    def at(self, position: Array, rotation: Rotation, q: Array, velocity: Array) -> None:
        """velocity (6 + joints,): [w, v, qd_m]."""
        x, v = self.plant.GetPositions(self.context).copy(), np.empty(6 + len(q))
        x[self.places] = q
        v[self.base], v[self.joints] = velocity[:6], velocity[6:]
        self.plant.SetPositions(self.context, x)
        pose = RigidTransform(RotationMatrix(rotation.as_matrix()), position)
        self.plant.SetFreeBodyPose(self.context, self.root, pose)
        self.plant.SetVelocities(self.context, v)

    def follow(self, position: Array, rotation: Rotation, q: Array, qd: Array, momentum: Array) -> Array:
        """[w, v] (6,) of the base at which the system has `momentum` (6,): linear, and angular about the start."""
        self.at(position, rotation, q, np.concatenate([np.zeros(6), qd]))
        inertia = np.asarray(self.plant.CalcMassMatrix(self.context))
        angular = momentum[3:] - np.cross(position - self.start[1], momentum[:3])
        wanted = np.concatenate([angular, momentum[:3]]) - inertia[np.ix_(self.base, self.joints)] @ qd
        return np.linalg.solve(inertia[np.ix_(self.base, self.base)], wanted)

    def momentum(self) -> Array:
        """Linear momentum, and angular momentum about the start (6,), in the world."""
        total = self.plant.CalcSpatialMomentumInWorldAboutPoint(self.context, self.start[1])
        return np.concatenate([total.translational(), total.rotational()])

    def reaction(self, q: Array, qd: Array, qdd: Array) -> Array:
        """Force [N] and torque [N m] (6,), about the root link's origin in the world, that hold the base still."""
        rotation, position = self.start
        self.at(position, rotation, q, np.concatenate([np.zeros(6), qd]))
        rates = np.zeros(6 + len(q))
        rates[self.joints] = qdd
        tau = self.plant.CalcInverseDynamics(self.context, rates, self.forces)
        tau = np.asarray(tau - self.plant.CalcGravityGeneralizedForces(self.context))[self.base]
        return np.concatenate([tau[3:], tau[:3]])

    def tip(self) -> Array:
        return np.asarray(self.end.CalcPoseInWorld(self.context).translation())


def reactions(arm: Arm, q: Array, qd: Array, qdd: Array) -> Array:
    """Forces and torques (K, 6) that hold the base still under a motion of the joints (K, n); nan where that is not finite."""
    plant, out = BasePlant(arm), np.full((len(q), 6), np.nan)
    for i in np.flatnonzero(np.isfinite(np.hstack([q, qd, qdd])).all(axis=1)):
        out[i] = plant.reaction(q[i], qd[i], qdd[i])
    return out


def integrate(problem: Problem, arm: FloatingArm, time: Array, q: Array) -> Floating:
    """The base under the joint motion through q (N + 1, joints) at the knots time (N + 1,)."""
    plant, momentum = BasePlant(arm), np.array(arm.spacecraft.momentum, dtype=float)
    joints = CubicSpline(time, q)
    parts = max(LEAST, -(-STEPS // (len(time) - 1)))
    fine = np.interp(np.arange(parts * (len(time) - 1) + 1) / parts, np.arange(len(time)), time)
    rotation, position = plant.start
    positions, rotations = [position], [rotation]

    def rate(t: float, position: Array, rotation: Rotation) -> Array:
        return plant.follow(position, rotation, joints(t), joints(t, 1), momentum)

    for t, h in zip(fine[:-1], np.diff(fine), strict=True):
        # RK4 on the turn phi since t: dphi/dt = w to the order that counts (phi is small within a step), by its series.
        slopes: list[Array] = []
        for ahead in (0.0, 0.5, 0.5, 1.0):
            turn, move = (ahead * h * slopes[-1][:3], ahead * h * slopes[-1][3:]) if slopes else (np.zeros(3),) * 2
            both = rate(t + ahead * h, position + move, Rotation.from_rotvec(turn) * rotation)
            # d(phi)/dt = w - phi x w / 2 + phi x (phi x w) / 12 for an angular velocity w in the world.
            w = both[:3] - np.cross(turn, both[:3]) / 2 + np.cross(turn, np.cross(turn, both[:3])) / 12
            slopes.append(np.concatenate([w, both[3:]]))
        mean = (slopes[0] + 2 * slopes[1] + 2 * slopes[2] + slopes[3]) / 6
        rotation, position = Rotation.from_rotvec(h * mean[:3]) * rotation, position + h * mean[3:]
        positions.append(position)
        rotations.append(rotation)
    return _check(problem, plant, fine, np.array(positions), Rotation.concatenate(rotations), joints, momentum)


def _check(
    problem: Problem, plant: BasePlant, time: Array, position: Array, rotation: Rotation, joints: Any, momentum: Array
) -> Floating:
    """The momentum of the integrated motion half-way between its steps, from splines through it."""
    quaternion = rotation.as_quat()
    quaternion[1:] *= np.cumprod(np.where((quaternion[1:] * quaternion[:-1]).sum(axis=1) < 0, -1.0, 1.0))[:, None]
    moved, turned = CubicSpline(time, position), CubicSpline(time, quaternion)
    middle = (time[1:] + time[:-1]) / 2
    places, ways = moved(middle), Rotation.from_quat(turned(middle))
    velocity, angular = moved(middle, 1), _angular_velocity(turned(middle), turned(middle, 1))
    error, own = np.empty((len(middle), 6)), np.empty((len(middle), 6))
    for i, t in enumerate(middle):
        qd = joints(t, 1)
        plant.at(places[i], ways[i], joints(t), np.concatenate([angular[i], velocity[i], qd]))
        error[i] = plant.momentum() - momentum
        plant.at(places[i], ways[i], joints(t), np.concatenate([np.zeros(6), qd]))
        own[i] = plant.momentum()
    linear, angular_error = (
        float(np.linalg.norm(error[:, part], axis=1).max() / max(np.linalg.norm(own[:, part], axis=1).max(), 1e-300))
        for part in (slice(3), slice(3, 6))
    )
    target, rows = problem.reference.position(time), problem.task.rows
    off = np.empty(len(time))
    for i, t in enumerate(time):
        plant.at(position[i], rotation[i], joints(t), np.zeros(6 + joints(t).size))
        off[i] = np.linalg.norm(plant.tip()[rows] - target[i, : len(rows)])
    return Floating(time, position, rotation, linear, angular_error, float(off.max()))


def _angular_velocity(quaternion: Array, rate: Array) -> Array:
    """w (K, 3) in the world of quaternions (K, 4), last component real, that change at `rate`: 2 dq/dt q^-1."""
    vector, real = quaternion[:, :3], quaternion[:, 3:]
    w = rate[:, :3] * real - rate[:, 3:] * vector - np.cross(rate[:, :3], vector)
    return np.asarray(2 * w / (quaternion**2).sum(axis=1, keepdims=True))
