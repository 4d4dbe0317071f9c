"""What an arm is: masses, reach, and the redundancy degree for each kind of task."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.optimize import minimize

from pipeline.build.robot import initial, load
from pipeline.common.arrays import Array
from pipeline.config.robot import RobotConfig
from pipeline.model.arm import Arm
from pipeline.robot.packages import resolve
from pipeline.robot.urdf import link_masses

# Rows of the spatial Jacobian (angular, linear) that each kind of task prescribes.
TASKS = {
    "position in the x-y plane": [3, 4],
    "position": [3, 4, 5],
    "position and pointing": [0, 1, 3, 4, 5],
    "pose": [0, 1, 2, 3, 4, 5],
}


@dataclass(frozen=True)
class Facts:
    """What is printed. masses: of each moving joint's rigid group of links [kg]. reach [m] from the first joint."""

    arm: Arm
    q_init: Array
    masses: dict[str, float]
    reach: float
    tasks: dict[str, tuple[int, int]]  # of each kind: rank of its Jacobian, and m
    notes: list[str]


def inspect(robot: RobotConfig, gravity: str | Sequence[float] = "none") -> Facts:
    """Load the arm and look at it; raises RobotError, one line, if it cannot be used."""
    arm = load(robot, gravity)
    description = arm.description
    q_init = initial(robot, arm)
    notes = list(description.notes)
    unlimited = [n for n, v in zip(description.joints, description.velocity, strict=True) if not np.isfinite(v)]
    weak = [n for n, v in zip(description.joints, description.effort, strict=True) if not np.isfinite(v)]
    for names, what in ((unlimited, "velocity"), (weak, "effort")):
        if names:
            notes.append(f"no {what} limit stated for {', '.join(names)}")
    outside = (q_init < description.lower) | (q_init > description.upper)
    for joint in np.flatnonzero(outside):
        notes.append(f"robot.q_init of {description.joints[joint]} is outside its limits")
    if arm.mounting.payload > 0:
        notes.append(f"a payload of {arm.mounting.payload:g} kg at the end effector")
    rotors = arm.mounting.rotors(arm.n)
    if rotors.any():
        notes.append(f"rotor inertia {', '.join(f'{a:g}' for a in rotors)} kg m^2 added to the joints")
    missing = [
        mesh
        for mesh in description.pictures
        if (file := resolve(mesh, description.file.parent)) is None or not file.is_file()
    ]
    if missing:
        count = f"{len(missing)} mesh file{'s' * (len(missing) > 1)}"
        notes.append(f"{count} not found, such as {missing[0]}: the arm is drawn without")
    return Facts(arm, q_init, link_masses(description), reach(arm), ranks(arm), notes)


def ranks(arm: Arm) -> dict[str, tuple[int, int]]:
    """For each kind of task, the rank of its Jacobian at a generic configuration, and m."""
    q = np.random.default_rng(1).uniform(-1.0, 1.0, size=(8, arm.n))
    frame = arm.pose(q)[1]
    both = arm.spatial_jacobian(q)
    own = np.concatenate([frame.swapaxes(1, 2) @ both[:, :3], both[:, 3:]], axis=1)
    return {task: (int(np.linalg.matrix_rank(own[:, rows], tol=1e-8).max()), len(rows)) for task, rows in TASKS.items()}


def reach(arm: Arm) -> float:
    """The largest distance [m] of the end effector from the first joint's axis origin, within the joint limits."""
    low = np.maximum(arm.description.lower, np.where(arm.description.revolute, -np.pi, -1.0))
    high = np.minimum(arm.description.upper, np.where(arm.description.revolute, np.pi, 1.0))
    first = arm.first_joint()
    rng = np.random.default_rng(0)
    q = rng.uniform(low, high, size=(4096, arm.n))
    distance = np.linalg.norm(arm.position(q) - first, axis=1)

    def less(x: Array) -> tuple[float, Array]:
        position, jacobian = arm.position_and_jacobian(x[None])
        gap = position[0] - first
        return -0.5 * float(gap @ gap), -(gap @ jacobian[0])

    bounds = list(zip(low, high, strict=True))
    best = [minimize(less, q[i], jac=True, bounds=bounds, method="L-BFGS-B").fun for i in np.argsort(-distance)[:8]]
    return float(np.sqrt(-2 * min(best)))
