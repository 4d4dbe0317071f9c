"""The path of a configuration: curve, orientation, knots, and the task that follows it."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
from scipy.spatial.transform import Rotation

from pipeline.common.arrays import Array
from pipeline.common.errors import ConfigError, RobotError
from pipeline.config.messages import shown
from pipeline.config.path import CircleConfig, PathConfig, TimingConfig, WaypointsConfig
from pipeline.config.robot import RobotConfig
from pipeline.model.arm import Arm
from pipeline.model.kinematics import place
from pipeline.model.task import PositionTask, Task, pose_task
from pipeline.path.curves import Geometry, Line, Spline, circle, direction_vector
from pipeline.path.orientation import Orientation
from pipeline.path.timing import ConstantSpeed, Quintic, RaisedCosine, Timing
from pipeline.path.waypoints import read_orientations, read_waypoints

TIMINGS: dict[str, Callable[[float], Timing]] = {
    "raised_cosine": RaisedCosine,
    "constant_speed": ConstantSpeed,
    "quintic": Quintic,
}


def make_knots(timing: TimingConfig) -> Array:
    """The grid (steps + 1,) [s]: even, or finer by the factors of `dense`."""
    if not timing.dense:
        return np.linspace(0.0, timing.duration, timing.steps + 1)
    latest = max(end for _, end, _ in timing.dense)
    if latest > timing.duration:
        raise ConfigError(
            f"timing.dense reaches to {latest:g} s, the motion ends at timing.duration = {timing.duration:g} s"
        )
    fine = np.linspace(0.0, timing.duration, 20 * timing.steps + 1)
    density = np.ones(len(fine) - 1)
    middle = (fine[1:] + fine[:-1]) / 2
    for start, end, factor in timing.dense:
        density = np.where((middle >= start) & (middle <= end), density * factor, density)
    share = np.concatenate([[0.0], np.cumsum(density)])
    return np.interp(np.linspace(0.0, share[-1], timing.steps + 1), share, fine)


def make_task(robot: RobotConfig, arm: Arm) -> Task:
    if robot.orientation == "none":
        return PositionTask(arm, tuple(robot.task))
    if robot.task != ("x", "y", "z"):
        raise RobotError(
            f"robot.task = [{', '.join(robot.task)}]: with robot.orientation = {robot.orientation} it must be [x, y, z]"
        )
    return pose_task(arm, robot.orientation, robot.pointing)


def make_path(path: Any, task: Task, q_init: Array) -> tuple[Geometry, Orientation | None, Array]:
    """The path's curve and orientations, and q_init moved onto its start if the path says where it starts."""
    count = len(task.axes)
    here = task.value(q_init[None])[0]
    geometry = _geometry(path, task, here[:count])
    orientation = _orientation(path, task, geometry, here[count:])
    s = np.zeros(1)
    start = (
        geometry.sample(s)[0] if orientation is None else np.hstack([geometry.sample(s)[0], orientation.sample(s)[0]])
    )
    if np.abs(task.error(q_init[None], start)).max() > 1e-12:
        q_init = place(task, q_init, start[0])
    return geometry, orientation, q_init


def _geometry(path: Any, task: Task, here: Array) -> Geometry:
    count = len(task.axes)
    if isinstance(path, WaypointsConfig):
        if path.file in ("", "???"):
            raise ConfigError("path.file: not given; the way-points are rows of a CSV file, e.g. path.file=points.csv")
        points = read_waypoints(path.file, task.axes)
        return Spline(points + here - points[0] if path.relative else points)
    if path.start is not None and len(path.start) != count:
        raise ConfigError(f"path.start = {shown(path.start)}: must be {count} numbers m, one for each of robot.task")
    start = here if path.start is None else np.array(path.start)
    if isinstance(path, CircleConfig):
        return circle(
            start,
            path.center_direction,
            path.radius,
            clockwise=path.clockwise,
            normal=path.normal,
            angle=path.angle,
        )
    return Line(start, direction_vector(path.direction, count), path.length)


def _orientation(path: PathConfig, task: Task, geometry: Geometry, here: Array) -> Orientation | None:
    """Way-points may bring their own; otherwise from `path.orientation` (or that of q_init) through `path.turn`."""
    given = path.orientation is not None or any(path.turn)
    if isinstance(task, PositionTask):
        if given:
            raise ConfigError(
                "path.orientation, path.turn: the task prescribes no orientation; "
                "set robot.orientation to full or pointing"
            )
        return None
    if isinstance(path, WaypointsConfig) and isinstance(geometry, Spline):
        own = read_orientations(path.file)
        if own is not None and given:
            raise ConfigError(f"path.orientation, path.turn: path.file = {path.file} has orientations of its own")
        if own is not None:
            return Orientation(geometry.marks, own)
    first = Rotation.from_rotvec(here) if path.orientation is None else Rotation.from_euler("xyz", path.orientation)
    # Turns beyond half a turn need marks between: two rotations are joined by the shorter way.
    marks = np.linspace(0.0, 1.0, 2 + int(np.linalg.norm(path.turn) / 2))
    turned = Rotation.from_rotvec(marks[:, None] * np.array(path.turn))
    return Orientation(marks * geometry.length, turned * first)
