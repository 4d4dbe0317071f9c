"""Copies of one arm in one of Drake's plants, so that one call into Drake serves many knots."""

from __future__ import annotations

from typing import Any

import numpy as np
from pydrake.math import RigidTransform, RollPitchYaw
from pydrake.multibody.parsing import Parser
from pydrake.multibody.plant import MultibodyPlant
from pydrake.multibody.tree import FixedOffsetFrame, MultibodyForces, SpatialInertia, UnitInertia

from pipeline.common.arrays import Array
from pipeline.robot.description import Description
from pipeline.robot.mounting import Mounting

BLOCK = 25  # copies per plant: beyond this Drake's cost per knot no longer falls


STEP = 1e-5  # central differences of smooth rigid-body functions: truncation and rounding balance near 1e-10


def assemble(plant: Any, parser: Any, description: Description, mounting: Mounting) -> tuple[Any, Any]:
    """Add one copy of the arm, mounted and with its payload; returns its model and its end-effector frame."""
    xml, root = description.for_drake
    (model,) = parser.AddModelsFromString(xml, "urdf")
    stand = RigidTransform(RollPitchYaw(mounting.base_rpy), mounting.base_position)
    plant.WeldFrames(plant.world_frame(), plant.GetFrameByName(root, model), stand)
    tip = plant.GetFrameByName(description.end_effector, model)
    if np.any(mounting.offset) or np.any(mounting.offset_rpy):
        tool = RigidTransform(RollPitchYaw(mounting.offset_rpy), mounting.offset)
        tip = plant.AddFrame(FixedOffsetFrame("end_effector_point", tip, tool, model))
    if mounting.payload > 0:
        point = SpatialInertia(mounting.payload, np.zeros(3), UnitInertia(0.0, 0.0, 0.0))
        load = plant.AddRigidBody("payload", model, point)
        plant.WeldFrames(tip, load.body_frame())
    return model, tip


class Stack:
    """`size` copies of one arm in one plant, with a context of its own."""

    def __init__(self, description: Description, mounting: Mounting, size: int) -> None:
        plant = MultibodyPlant(0.0)
        plant.mutable_gravity_field().set_gravity_vector(mounting.gravity)
        parser = Parser(plant)
        parser.SetAutoRenaming(True)
        self.tips, joints = [], []
        for _ in range(size):
            model, tip = assemble(plant, parser, description, mounting)
            self.tips.append(tip)
            joints += [plant.GetJointByName(name, model) for name in description.joints]
        plant.Finalize()
        order = [joint.position_start() for joint in joints]
        # The copies are chains, so Drake numbers their positions as we stack them; everything below relies on it.
        assert order == list(range(len(joints))), order
        self.size, self.n = size, len(description.joints)
        self.plant, self.context = plant, plant.CreateDefaultContext()
        self.no_forces = MultibodyForces(plant)
        self.world = plant.world_frame()
        self.zero = np.zeros(size * self.n)
        of_joints = mounting.rotors(len(description.actuated))
        self.armature = np.concatenate([np.zeros(description.base_coordinates), of_joints])
        self.has_gravity = bool(np.any(mounting.gravity))

    def at(self, q: Array, qd: Array | None = None) -> None:
        self.plant.SetPositions(self.context, q.ravel())
        self.plant.SetVelocities(self.context, self.zero if qd is None else qd.ravel())

    def inertial(self, qdd: Array) -> Array:
        """M qdd + n, without gravity."""
        tau: Array = self.plant.CalcInverseDynamics(self.context, qdd.ravel(), self.no_forces)
        return tau.reshape(self.size, self.n) + self.armature * qdd

    def inverse_dynamics(self, qdd: Array) -> Array:
        return self.inertial(qdd) - self.gravity() if self.has_gravity else self.inertial(qdd)

    def gravity(self) -> Array:
        g: Array = self.plant.CalcGravityGeneralizedForces(self.context)
        return g.reshape(self.size, self.n)

    def mass_matrix(self) -> Array:
        m = _diagonal_blocks(self.plant.CalcMassMatrix(self.context), self.size)
        return m + np.diag(self.armature) if np.any(self.armature) else m

    def bias(self) -> Array:
        b: Array = self.plant.CalcBiasTerm(self.context)
        return b.reshape(self.size, self.n)


def _diagonal_blocks(matrix: Array, count: int) -> Array:
    """The (count, n, n) blocks on the diagonal of a (count n, count n) matrix."""
    n = len(matrix) // count
    return np.ascontiguousarray(np.einsum("kikj->kij", matrix.reshape(count, n, count, n)))
