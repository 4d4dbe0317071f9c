"""How an arm is mounted and what it carries: everything that its description does not say."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from pipeline.common.arrays import Array
from pipeline.common.errors import RobotError

ORIGIN = (0.0, 0.0, 0.0)


@dataclass(frozen=True)
class Mounting:
    """Where an arm stands, the frame of its end effector, what it carries and what pulls at it.

    offset (3,) [m], offset_rpy (3,) [rad]: the end-effector frame in its link. base_position (3,) [m], base_rpy (3,)
    [rad]: the root link in the world. Angles are roll, pitch, yaw about fixed axes, as in a URDF. gravity (3,) [m/s^2].
    payload [kg]: a point mass at the end effector. armature: rotor inertia [kg m^2] (of a sliding joint [kg]), one for
    all joints or one for each, added to the diagonal of M. Raises RobotError where a value cannot be.
    """

    offset: tuple[float, ...] = ORIGIN
    offset_rpy: tuple[float, ...] = ORIGIN
    base_position: tuple[float, ...] = ORIGIN
    base_rpy: tuple[float, ...] = ORIGIN
    gravity: tuple[float, ...] = ORIGIN
    payload: float = 0.0
    armature: float | tuple[float, ...] = 0.0

    def __post_init__(self) -> None:
        for name in ("offset", "offset_rpy", "base_position", "base_rpy", "gravity"):
            given = tuple(map(float, getattr(self, name)))
            if len(given) != 3 or not np.all(np.isfinite(given)):
                raise RobotError(f"{name} = {list(given)}: expected three finite numbers")
            object.__setattr__(self, name, given)  # lists and arrays are welcome, and become what can be compared
        rotors = np.asarray(self.armature, dtype=float)
        object.__setattr__(self, "armature", tuple(rotors.tolist()) if rotors.ndim else float(rotors))
        for name, values in (("payload", self.payload), ("armature", rotors)):
            if not np.all(np.isfinite(values) & (np.asarray(values) >= 0)):
                raise RobotError(f"{name} = {getattr(self, name)}: expected finite numbers >= 0")

    def rotors(self, joints: int) -> Array:
        """The rotor inertias (joints,) of an arm with so many joints; raises RobotError if there are not as many."""
        given = np.asarray(self.armature, dtype=float)
        if given.ndim and len(given) != joints:
            raise RobotError(f"armature has {len(given)} values, the arm has {joints} moving joints")
        return np.broadcast_to(given, joints).copy()
