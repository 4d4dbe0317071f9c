"""What the base does: where it floats, its pose and turn; where it stands, what holds it."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from pipeline.common.arrays import Array
from pipeline.evaluation.free_body import FreeMotion, integrate, reactions
from pipeline.evaluation.plant import SinglePlant
from pipeline.evaluation.sums import running_integral
from pipeline.problem.problem import Boundary, Problem
from pipeline.problem.solution import Solution, Trajectory


@dataclass(frozen=True)
class BaseMotion:
    """What a base does at the knots: position (N + 1, 3) [m], rotation (N + 1, 3, 3), turn so far (N + 1,) [rad].

    reaction (N + 1, 6) [N, N m]: what holds a base that stands still; None if it floats. integrals, running (N + 1,):
    base_rotation, reaction_force, reaction_torque. floating: the motion that the joints alone give; None if it stands.
    """

    position: Array
    rotation: Array
    turn: Array
    reaction: Array | None
    integrals: dict[str, Array]
    floating: FreeMotion | None


def base_motion(
    problem: Problem, solution: Solution, place: Array, way: Array, turn: Array, joints: tuple[Array, Array, Array]
) -> BaseMotion:
    """What the base does: its pose at the knots from the solution, the rest from the joints alone (`free_body.py`)."""
    arm, time = problem.task.arm, solution.trajectory.time
    dt, nothing = np.diff(time), np.zeros(len(time))
    if arm.base.kind != "floating":
        reaction = reactions(arm, *joints)
        reaction[0] = reaction[0] if problem.boundary is Boundary.CYCLIC else 0.0
        force, torque = ((reaction[:, part] ** 2).sum(axis=1) for part in (slice(3), slice(3, 6)))
        integrals = {"reaction_force": running_integral(force, dt), "reaction_torque": running_integral(torque, dt)}
        return BaseMotion(place, way, turn, reaction, {"base_rotation": nothing, **integrals}, None)
    steps = way[1:] @ way[:-1].swapaxes(1, 2)
    rate = np.concatenate([[0.0], angle_between(np.eye(3), steps) / dt])
    integrals = {"base_rotation": running_integral(rate**2, dt), "reaction_force": nothing, "reaction_torque": nothing}
    finite = np.isfinite(joints[0]).all() and len(time) >= 4 and solution.found
    floating = integrate(problem, time, joints[0]) if finite else None
    return BaseMotion(place, way, turn, None, integrals, floating)


def angle_between(start: Array, rotation: Array) -> Array:
    """The angle (K,) [rad] between rotations (K, 3, 3) and one of them."""
    chord = np.linalg.norm(rotation - start, axis=(1, 2)) / np.sqrt(8)
    return np.asarray(2 * np.arcsin(np.minimum(chord, 1.0)))


def entered_cycle(plant: SinglePlant, trajectory: Trajectory, qd: Array) -> tuple[Array, Array]:
    """Velocities and accelerations of a cycle on a floating base: it is entered with the joints' last velocity, and the
    base's that goes with it at the start.
    """
    qd = qd.copy()
    plant.at(trajectory.q[0], qd[0])
    qd[0] = plant.motion_map() @ qd[0, plant.nb :] + plant.drift()
    change = np.diff(qd, axis=0) / np.diff(trajectory.time)[:, None]
    return qd, np.vstack([change[-1], change])
