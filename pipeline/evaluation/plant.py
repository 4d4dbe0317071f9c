"""One arm in a plant of its own, evaluated knot by knot through Drake's own energy, torque and pose calls.

It shares nothing with the stacked plants and the scaling of the solvers (`pipeline.model`, `pipeline.program`): what
the evaluation says of a motion comes from here.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from pydrake.math import RigidTransform, RotationMatrix
from pydrake.multibody.parsing import Parser
from pydrake.multibody.plant import MultibodyPlant
from pydrake.multibody.tree import FixedOffsetFrame, JacobianWrtVariable, MultibodyForces, SpatialInertia
from scipy.spatial.transform import Rotation

from pipeline.common.arrays import Array
from pipeline.model.arm import Arm
from pipeline.model.task import PositionTask, Task
from pipeline.problem.problem import Problem
from pipeline.robot.description import Description
from pipeline.robot.mounting import Mounting


@dataclass(frozen=True)
class Parts:
    """What `add_arm` has added: Drake's model, the frame of its root, the end-effector frame, its joints in order."""

    model: Any
    root: Any
    end: Any
    joints: list[Any]


def add_arm(plant: Any, description: Description, mounting: Mounting) -> Parts:
    """Add one arm with its tool frame, payload, rotors and gravity to a plant; it does not stand on anything yet."""
    xml, root = description.for_drake
    (model,) = Parser(plant).AddModelsFromString(xml, "urdf")
    link = plant.GetFrameByName(description.end_effector, model)
    tool = RigidTransform(RotationMatrix(Rotation.from_euler("xyz", mounting.offset_rpy).as_matrix()), mounting.offset)
    end = plant.AddFrame(FixedOffsetFrame("evaluated_point", link, tool, model))
    plant.mutable_gravity_field().set_gravity_vector(mounting.gravity)
    joints = [plant.GetJointByName(name, model) for name in description.joints]
    own = joints[description.base_coordinates :]
    for joint, inertia in zip(own, mounting.rotors(len(own)), strict=True):
        plant.AddJointActuator(joint.name(), joint).set_default_rotor_inertia(inertia)
    if mounting.payload > 0:
        # A ball so small that it is a point, which Drake's check of inertias also lets pass.
        ball = plant.AddRigidBody("load", model, SpatialInertia.SolidSphereWithMass(mounting.payload, 1e-6))
        plant.WeldFrames(end, ball.body_frame())
    return Parts(model, plant.GetFrameByName(root, model), end, joints)


def weld(plant: Any, root: Any, mounting: Mounting) -> Array:
    """Let the frame `root` stand where the mounting says; returns its rotation matrix (3, 3)."""
    turn = np.asarray(Rotation.from_euler("xyz", mounting.base_rpy).as_matrix())
    plant.WeldFrames(plant.world_frame(), root, RigidTransform(RotationMatrix(turn), mounting.base_position))
    return turn


class SinglePlant:
    """One arm in a plant of its own, its rotor inertias in Drake's actuators."""

    def __init__(self, arm: Arm) -> None:
        plant = self.plant = MultibodyPlant(0.0)
        parts = add_arm(plant, arm.description, arm.mounting)
        self.start = weld(plant, parts.root, arm.mounting)
        plant.Finalize()
        self.end, self.joints = parts.end, parts.joints
        self.order = np.array([joint.position_start() for joint in self.joints])
        self.place = np.argsort(self.order)
        self.arm, self.nb = arm, arm.base.count
        self.root = plant.GetBodyByName(arm.description.drake_name(arm.description.base), parts.model)
        self.context = plant.CreateDefaultContext()
        self.forces = MultibodyForces(plant)

    def at(self, q: Array, qd: Array) -> None:
        self.plant.SetPositionsAndVelocities(self.context, np.concatenate([q[self.place], qd[self.place]]))

    def kinetic_energy(self) -> float:
        return float(self.plant.CalcKineticEnergy(self.context))

    def torque(self, qdd: Array) -> Array:
        # Drake's inverse dynamics leaves gravity to the caller.
        tau = self.plant.CalcInverseDynamics(self.context, qdd[self.place], self.forces)
        return np.asarray(tau - self.plant.CalcGravityGeneralizedForces(self.context))[self.order]

    def mass_matrix(self) -> Array:
        return np.asarray(self.plant.CalcMassMatrix(self.context))[np.ix_(self.order, self.order)]

    def tip(self) -> Array:
        return np.asarray(self.end.CalcPoseInWorld(self.context).translation())

    def pace(self, task: Task, qdd: Array) -> tuple[float, float]:
        """Speed [m/s] and acceleration [m/s^2] of the prescribed coordinates, by their vectors' lengths."""
        world = self.plant.world_frame()
        given = (self.context, JacobianWrtVariable.kV, self.end, np.zeros(3), world, world)
        jacobian = self.plant.CalcJacobianTranslationalVelocity(*given)[task.rows]
        bias = self.plant.CalcBiasTranslationalAcceleration(*given).ravel()[task.rows]
        speed = jacobian @ self.plant.GetVelocities(self.context)
        return float(np.linalg.norm(speed)), float(np.linalg.norm(jacobian @ qdd[self.place] + bias))

    def skeleton(self) -> Array:
        return np.array(
            [joint.frame_on_child().CalcPoseInWorld(self.context).translation() for joint in self.joints[self.nb :]]
            + [self.tip()]
        )

    def base(self) -> tuple[Array, Array]:
        """Position (3,) and rotation matrix (3, 3) of the root link."""
        pose = self.root.EvalPoseInWorld(self.context)
        return np.asarray(pose.translation()), np.asarray(pose.rotation().matrix())

    def spin_squared(self) -> float:
        """Of the root link's angular velocity [rad^2/s^2]."""
        return float((self.root.EvalSpatialVelocityInWorld(self.context).rotational() ** 2).sum())

    def motion_map(self) -> Array:
        """All velocities by the joints' (N, n): [-M_bb^-1 M_bm; I] if the base floats, [0; I] if it stands still."""
        nb, out = self.nb, np.eye(len(self.order))[:, self.nb :]
        if self.arm.base.kind == "floating":
            inertia = self.mass_matrix()
            out[:nb] = -np.linalg.solve(inertia[:nb, :nb], inertia[:nb, nb:])
        return out

    def drift(self) -> Array:
        """The velocities (N,) of a floating base whose system has momentum, its joints at rest: M_bb^-1 p.

        p is what the linear and angular momentum do along the base's coordinates: by the Jacobian of the root link.
        """
        out, momentum = np.zeros(len(self.order)), np.array(self.arm.base.spacecraft.momentum, dtype=float)
        if momentum.any():
            world, own = self.plant.world_frame(), self.root.body_frame()
            both = self.plant.CalcJacobianSpatialVelocity(
                self.context, JacobianWrtVariable.kV, own, np.zeros(3), world, world
            )[:, self.order[: self.nb]]
            shift = self.base()[0] - self.arm.mounting.base_position
            about_root = np.concatenate([momentum[3:] - np.cross(shift, momentum[:3]), momentum[:3]])
            out[: self.nb] = np.linalg.solve(self.mass_matrix()[: self.nb, : self.nb], both.T @ about_root)
        return out

    def secondary(self, problem: Problem, q: Array) -> float:
        """w at q (n,): Pontryagin report eqs (14), (15), the latter with its square."""
        criteria, total = problem.objective.secondary, 0.0
        if criteria is None or not np.all(np.isfinite(q)):
            return 0.0 if criteria is None else float("nan")
        if "manipulability" in criteria.criteria:
            self.at(q, np.zeros_like(q))
            jacobian = self.task_jacobian(problem.task)
            total += float(np.sqrt(max(np.linalg.det(jacobian @ jacobian.T), 0.0)))
        if "joint_centering" in criteria.criteria:
            for value, low, high in zip(q, criteria.lower, criteria.upper, strict=True):
                if np.isfinite(high - low):
                    total -= ((value - (high + low) / 2) / (high - low)) ** 2 / (2 * len(q))
        return total

    def task_error(self, task: Task, target: Array) -> tuple[float, float]:
        """Distance [m] and angle [rad] from one target (see task.py)."""
        distance = float(np.linalg.norm(self.tip()[task.rows] - target[: len(task.rows)]))
        if isinstance(task, PositionTask):
            return distance, 0.0
        rotation = self.end.CalcPoseInWorld(self.context).rotation().matrix()
        wanted = Rotation.from_rotvec(target[3:]).as_matrix()
        if task.pointing is None:
            chord = np.linalg.norm(rotation - wanted) / np.sqrt(8)  # sine of half the angle between them
        else:
            axis = np.array(task.pointing) / np.linalg.norm(task.pointing)
            chord = np.linalg.norm((rotation - wanted) @ axis) / 2
        return distance, float(2 * np.arcsin(min(chord, 1.0)))

    def task_jacobian(self, task: Task) -> Array:
        """J (m, n), angular rows in the world: for its singular values."""
        world = self.plant.world_frame()
        both = np.asarray(
            self.plant.CalcJacobianSpatialVelocity(
                self.context, JacobianWrtVariable.kV, self.end, np.zeros(3), world, world
            )
        )[:, self.order]
        if isinstance(task, PositionTask):
            return both[3:][task.rows]
        angular = both[:3]
        if task.pointing is not None:
            axis = self.end.CalcPoseInWorld(self.context).rotation().matrix() @ np.array(task.pointing)
            angular = np.linalg.svd(axis[None])[2][1:] @ angular
        return np.vstack([both[3:], angular])
