"""Rest at the ends, and limits of acceleration and jerk: refuse what does not go together, saying what would."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np

from pipeline.common.arrays import Array
from pipeline.common.errors import ConfigError
from pipeline.common.files import shipped
from pipeline.config.run import RunConfig
from pipeline.model.kinematics import project
from pipeline.path.reference import Reference
from pipeline.problem.problem import Boundary, Problem
from pipeline.robot.limits import STILL

PACE = ("velocity", "acceleration", "jerk", "torque", "power")
STUCK = 1e-6  # [rad/s^2] and below: of a motion that does not get away from a singular start; it says nothing
SHARE = 0.05  # of the motion time, in which the suggested acceleration reaches the motion's largest joint speed


def ends_at_rest(config: RunConfig, reference: Reference) -> tuple[bool, bool]:
    """Whether all joints rest at the start, at the end.

    Where `boundary.rest` says nothing they rest at both, so that the motion can be sent, if the accelerations of all
    joints are limited (`unless_unlimited`): but for the arms of `robots/`, whose motions are the papers', for a path
    that is entered at speed, and where no method can be told to rest, since the planner does not run or the base moves
    or is held.
    """
    if config.timing.law == "optimal" or config.timing.duration == "shortest":
        return True, True
    if config.boundary.rest is not None:
        return "start" in config.boundary.rest, "end" in config.boundary.rest
    papers = shipped(f"robots/{Path(config.robot.urdf).name}").is_file()
    planned = "global" in config.methods and config.base.kind == "fixed" and config.objective.kind != "reaction"
    rests = planned and reference.timing.at_rest and not papers
    return rests, rests


def unless_unlimited(config: RunConfig, problem: Problem) -> Problem:
    """Without rest where nobody asked for it and it would have no best motion, or one that speeds up in no time. What
    is found is then not exported, and the line that says so says what would be.
    """
    told = config.boundary.rest is not None or problem.free_timing
    return problem if told or np.isfinite(problem.bounds.acceleration).all() else replace(problem, rest=(False, False))


def check_rest(problem: Problem) -> None:
    """Raise ConfigError, one line, for rest that no motion can have or that has no best one."""
    bounds, cyclic = problem.bounds, problem.boundary is Boundary.CYCLIC
    if any(problem.rest) and not problem.reference.timing.at_rest:
        raise ConfigError(
            "boundary.rest: the path is entered and left at speed; choose a law that rests there "
            "(timing=raised_cosine, quintic or cruise)"
        )
    if problem.zero_acceleration and not any(problem.rest):
        raise ConfigError("boundary.zero_acceleration: of which ends is said by boundary.rest=[start,end]")
    settles = all(problem.rest) and problem.zero_acceleration
    if np.isfinite(bounds.jerk).any() and not (settles or cyclic):
        raise ConfigError(
            "limits.jerk: a motion that begins or ends with an acceleration has a jerk without bound there; set "
            "boundary.rest=[start,end] and boundary.zero_acceleration=true"
        )
    if problem.free_duration:
        if not any(np.isfinite(getattr(bounds, kind)).any() for kind in PACE):
            raise ConfigError(
                "timing.duration = shortest: nothing limits the motion's pace; set limits.velocity, "
                "limits.acceleration or limits.torque"
            )
        return
    if problem.rest[0] and unlimited_start(problem):
        unit = problem.task.arm.description.unit()
        raise ConfigError(
            "boundary.rest: with a given start and an objective of velocities there is no best motion from rest "
            "unless the accelerations of all joints are limited: it would jump to its speed within one step, however "
            f"short; set limits.acceleration, such as {suggested(problem):g} {unit}/s^2, or a file of them in "
            "limits.file or robot.limits; boundary.rest=[] lets it jump"
        )


def unlimited_start(problem: Problem) -> bool:
    """Whether there is no best motion from rest: see what `check_rest` says of it."""
    bounds = problem.bounds
    limited = np.isfinite(bounds.acceleration) | np.isfinite(bounds.jerk)
    return problem.boundary is Boundary.FIXED and not problem.objective.second_order and not bool(np.all(limited))


def suggested(problem: Problem) -> float:
    """An acceleration [rad/s^2] that leaves a motion time to speed up, and that the torques of the limits and of the
    robot's file allow, to one digit.

    That of the largest joint speed of the inertia-weighted pseudoinverse motion in a share of the motion time, or in
    two steps of the grid if they are longer: a shorter layer would not be resolved.
    """
    times, arm = problem.times, problem.task.arm
    within = max(SHARE * problem.reference.duration, 2 * float(np.diff(times).max()))
    motion = _weighted_motion(problem)
    least = float(np.abs(np.diff(motion, axis=0) / np.diff(times)[:, None]).max()) / within
    effort = arm.description.effort
    torque = np.minimum(problem.bounds.torque, np.where(effort > STILL, effort, np.inf))
    still = np.zeros_like(motion)
    left = np.maximum(torque - np.abs(arm.inverse_dynamics(motion, still, still)), 0.0)
    least = min(least, float((left / np.abs(arm.mass_matrix(motion)).sum(axis=2)).min()))
    least = least if least > STUCK else 1.0
    digit = 10.0 ** np.floor(np.log10(least))
    return float(f"{max(np.floor(least / digit), 1.0) * digit:.1g}")


def _weighted_motion(problem: Problem) -> Array:
    rows = [problem.q_init[None]]
    for target in problem.reference.position(problem.times[1:]):
        inverse = np.linalg.inv(problem.task.arm.mass_matrix(rows[-1]))
        rows.append(project(problem.task, rows[-1], target[None], inverse)[0])
    return np.concatenate(rows)
