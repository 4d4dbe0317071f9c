"""Refuse what no motion can meet, before anything is solved."""

from __future__ import annotations

import numpy as np

from pipeline.build.collision import too_near
from pipeline.common.errors import ConfigError, PathError
from pipeline.model.clearance import Clearance, Close
from pipeline.model.kinematics import ATTEMPTS, reach
from pipeline.problem.problem import CLOSED, Boundary, Problem
from pipeline.robot.limits import require_room

TURN = 2 * np.pi  # [rad] and more of a joint: it may have been written in degrees


def check_problem(problem: Problem, moved: bool = False) -> None:
    """Refuse what no motion can meet: contradicting limits, a fixed start outside them, an open path for a cycle.

    moved: whether the start is not robot.q_init but was sought from there for a path that says where it begins.
    """
    limits, description = problem.bounds, problem.task.arm.description
    names = description.joints
    for key, values in (("velocity", limits.velocity), ("effort", limits.torque)):
        require_room(description, key, values)
    for joint in np.flatnonzero(limits.lower >= limits.upper):
        raise ConfigError(
            f"limits.lower of {names[joint]} ({limits.lower[joint]:.4g}) is not below limits.upper "
            f"({limits.upper[joint]:.4g})"
        )
    if problem.boundary is Boundary.FIXED:
        outside = np.flatnonzero((problem.q_init < limits.lower) | (problem.q_init > limits.upper))
        for joint in outside:
            value, turns = problem.q_init[joint], description.revolute[joint]
            where = ", moved to where the path begins," if moved else ""
            degrees = f"; in degrees? {value:g} deg are {np.deg2rad(value):.4g} rad"
            raise ConfigError(
                f"robot.q_init of {names[joint]}{where} is {value:.4g}, outside its limits {limits.lower[joint]:.4g} "
                f"to {limits.upper[joint]:.4g} {'rad' if turns else 'm'}, and boundary = fixed starts there"
                + (degrees if turns and abs(value) > TURN else "")
            )
        for close in _closest(problem) if problem.keeps_clear and too_near(problem, problem.q_init) else ():
            if close.distance < close.margin:
                raise ConfigError(f"robot.q_init: {_said(close)}, and boundary = fixed starts there")
    if problem.boundary is Boundary.CYCLIC and not problem.closed_path:
        gaps = [f"{gap:.3g} {unit}" for gap, unit in zip(problem.gap, ("m", "rad"), strict=True) if gap > CLOSED]
        raise PathError(
            f"boundary = cyclic: the path ends {' and '.join(gaps)} from where it starts; a cycle needs a closed path"
        )


def _closest(problem: Problem) -> list[Close]:
    return Clearance(problem.task.arm, problem.obstacles, problem.own).closest(problem.q_init)


def _said(close: Close) -> str:
    if close.kind == "clearance":
        return (
            f"{close.first} is {close.distance:.3g} m from obstacle {close.second}, less than obstacles.margin = "
            f"{close.margin:g} m (collision.allow=[[{close.first},{close.second}]] lets them touch)"
        )
    return (
        f"{close.first} is {close.distance:.3g} m from {close.second}, less than collision.margin = {close.margin:g} m "
        f"(collision.allow=[[{close.first},{close.second}]] lets them touch)"
    )


def require_reach(problem: Problem) -> None:
    """Refuse a path that leaves the arm's reach, saying where along it and by how much."""
    task, geometry = problem.task, problem.reference.geometry
    s = np.linspace(0.0, geometry.length, 101)
    points = geometry.sample(s)[0]
    if problem.reference.orientation is not None:
        points = np.hstack([points, problem.reference.orientation.sample(s)[0]])
    _, gap = reach(task, problem.q_init, points)
    out = np.flatnonzero(gap > 1e-6)
    if out.size:
        worst = int(np.argmax(gap))
        raise PathError(
            f"path: out of reach from {s[out[0]]:.3g} m along its {geometry.length:.3g} m on; "
            f"the nearest of {ATTEMPTS} attempts misses it by up to {gap[worst]:.3g} "
            f"m{' and rad' * (points.shape[1] > 3)} (at {s[worst]:.3g} m)"
        )
