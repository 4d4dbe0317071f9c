"""A serial arm in vectorised numpy: where its joints and its end effector are, for many knots in one call.

Every number is read out of Drake's finalized plant: axes and places of the joints, and the inertia of what each of them
carries rigidly. All is written in the world frame; a spatial vector is (angular, linear at the world's origin)
(Featherstone 2008, chapter 2). Knots lie on the LAST axis, so that each numpy operation is long and contiguous.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from pipeline.common.arrays import Array
from pipeline.model.arm import Arm
from pipeline.model.stack import Stack

AHEAD, BEHIND = [1, 2, 0], [2, 0, 1]


def cross(a: Array, b: Array) -> Array:
    """a x b of (..., 3, K)."""
    product: Array = a[..., AHEAD, :] * b[..., BEHIND, :]
    product -= a[..., BEHIND, :] * b[..., AHEAD, :]
    return product


@dataclass(frozen=True)
class Places:
    """Where the joints of a chain are: axes (n, 3, 3, K) with axes[j, c] the c-th column of joint frame j's rotation in
    the world, origins (n, 3, K) [m], and the joints' screws: turning (n, 3, K), moving (n, 3, K) at the world's origin.
    """

    axes: Array
    origins: Array
    turning: Array
    moving: Array


@dataclass(frozen=True)
class Chain:
    """n joints in series. Joint frame j turns about or slides along its z axis; at q_j = 0 it has the orientation
    turn[j] (3, 3) and the place shift[j] (3,) [m] in frame j - 1 (the world for j = 0).

    mass (n,) [kg], moment (n, 3) [kg m] and inertia (n, 3, 3) [kg m^2] about the joint frame's origin: of what moves
    rigidly with it, in its frame. tip (3,) [m], tip_turn (3, 3): the end effector in the last frame. armature (n,);
    gravity (3,).
    """

    turn: Array
    shift: Array
    slides: NDArray[np.bool_]
    mass: Array
    moment: Array
    inertia: Array
    tip: Array
    tip_turn: Array
    armature: Array
    gravity: Array

    @property
    def n(self) -> int:
        """Number of joints."""
        return len(self.mass)

    @cached_property
    def upper(self) -> Array:
        """(n, n): ones on and above the diagonal."""
        return np.triu(np.ones((self.n, self.n)))

    @cached_property
    def above(self) -> Array:
        """(n, n): ones above the diagonal."""
        return np.triu(np.ones((self.n, self.n)), 1)

    def mirrored(self, a: Array) -> Array:
        """The symmetric matrices (K, n, n) that equal `a` on and above the diagonal."""
        return np.asarray(a * self.upper + (a * self.above).swapaxes(-1, -2))

    @classmethod
    def of(cls, arm: Arm) -> Chain:
        """The chain of an arm on a fixed base, out of Drake's plant."""
        stack = Stack(arm.description, arm.mounting, 1)
        plant, context = stack.plant, stack.context
        plant.SetPositions(context, np.zeros(stack.n))
        single = (joint for joint in map(plant.get_joint, plant.GetJointIndices()) if joint.num_positions() == 1)
        joints = sorted(single, key=lambda joint: joint.position_start())
        rotations, places, carried = [], [], []
        for joint in joints:
            pose = joint.frame_on_parent().CalcPoseInWorld(context)
            slides = joint.type_name() == "prismatic"
            axis = joint.translation_axis() if slides else joint.revolute_axis()
            rotations.append(_frame_about(pose.rotation().matrix() @ axis))
            places.append(pose.translation())
            carried.append(set(plant.GetBodiesKinematicallyAffectedBy([joint.index()])))
        mass, moment, inertia = np.zeros(len(joints)), np.zeros((len(joints), 3)), np.zeros((len(joints), 3, 3))
        for j, (rotation, place) in enumerate(zip(rotations, places, strict=True)):
            later = carried[j + 1] if j + 1 < len(joints) else set()
            own = [body for body in sorted(carried[j] - later, key=int) if plant.get_body(body).default_mass() > 0]
            if own:
                whole = plant.CalcSpatialInertia(context, plant.world_frame(), own).Shift(place)
                mass[j] = whole.get_mass()
                moment[j] = rotation.T @ (mass[j] * whole.get_com())
                inertia[j] = rotation.T @ whole.CalcRotationalInertia().CopyToFullMatrix3() @ rotation
        before = [np.eye(3), *rotations[:-1]]
        tip = stack.tips[0].CalcPoseInWorld(context)
        return cls(
            turn=np.array([a.T @ b for a, b in zip(before, rotations, strict=True)]),
            shift=np.array(
                [a.T @ (b - c) for a, b, c in zip(before, places, [np.zeros(3), *places[:-1]], strict=True)]
            ),
            slides=np.array([joint.type_name() == "prismatic" for joint in joints]),
            mass=mass,
            moment=moment,
            inertia=inertia,
            tip=rotations[-1].T @ (tip.translation() - places[-1]),
            tip_turn=rotations[-1].T @ tip.rotation().matrix(),
            armature=np.asarray(stack.armature, dtype=float),
            gravity=np.asarray(plant.gravity_field().gravity_vector()),
        )

    def places(self, q: Array) -> Places:
        """Joint frames and screws at q (K, n)."""
        count, n = len(q), self.n
        angle = np.ascontiguousarray(q.T)
        cos, sin = np.cos(angle), np.sin(angle)
        axes, origins = np.empty((n, 3, 3, count)), np.empty((n, 3, count))
        for j in range(n):
            if j == 0:
                still = np.broadcast_to(self.turn[0].T[:, :, None], (3, 3, count))
                origins[0] = self.shift[0][:, None]
            else:
                columns = axes[j - 1].reshape(3, -1)
                still = (self.turn[j].T @ columns).reshape(3, 3, count)
                np.add(origins[j - 1], (self.shift[j] @ columns).reshape(3, count), out=origins[j])
            if self.slides[j]:
                axes[j] = still
                origins[j] += still[2] * angle[j]
                continue
            np.multiply(still[0], cos[j], out=axes[j, 0])
            axes[j, 0] += still[1] * sin[j]
            np.multiply(still[1], cos[j], out=axes[j, 1])
            axes[j, 1] -= still[0] * sin[j]
            axes[j, 2] = still[2]
        axis = axes[:, 2]
        around = cross(origins, axis)
        if not self.slides.any():
            return Places(axes, origins, axis, around)
        slides = self.slides[:, None, None]
        return Places(axes, origins, np.where(slides, 0.0, axis), np.where(slides, axis, around))

    def tip_position(self, at: Places) -> Array:
        """The end effector (3, K) [m]."""
        last = (self.tip @ at.axes[-1].reshape(3, -1)).reshape(3, -1)
        return np.asarray(at.origins[-1] + last)

    def tip_rotation(self, at: Places) -> Array:
        """Rotation matrices (K, 3, 3) of the end effector's frame in the world."""
        return np.asarray(np.einsum("cak,cb->kab", at.axes[-1], self.tip_turn))

    def tip_jacobian(self, at: Places, x: Array) -> Array:
        """Translational Jacobian (n, 3, K) [m/rad] of the end effector at x (3, K): its column i is v_i + w_i x x."""
        return at.moving + cross(at.turning, np.broadcast_to(x, at.turning.shape))


def _frame_about(axis: Array) -> Array:
    """A rotation (3, 3) whose third column is the unit vector `axis`."""
    first = np.cross(axis, np.eye(3)[np.argmin(np.abs(axis))])
    first /= np.linalg.norm(first)
    return np.array([first, np.cross(axis, first), axis]).T


def outward(links: Array) -> Array:
    """Sums (n, ...) over all links from each one on."""
    total: Array = links.copy()
    for j in range(len(links) - 2, -1, -1):
        total[j] += total[j + 1]
    return total
