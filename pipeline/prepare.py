"""From a configuration to the problem that it states; bad input ends here, in one line."""

from __future__ import annotations

import difflib
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path as File
from typing import Any

import numpy as np
from scipy.spatial.transform import Rotation

from pipeline import base, packages, urdf
from pipeline import config as schema
from pipeline.arm import Arm
from pipeline.arrays import Array
from pipeline.clearance import Clearance, Obstacles
from pipeline.errors import ConfigError, PathError, RobotError
from pipeline.geometry import Shape, capsule
from pipeline.kinematics import place, project
from pipeline.path import (
    ConstantSpeed,
    Geometry,
    Line,
    Orientation,
    Quintic,
    RaisedCosine,
    Reference,
    Spline,
    Timing,
    circle,
    direction_vector,
    read_orientations,
    read_waypoints,
)
from pipeline.problem import Boundary, Limits, Objective, Problem
from pipeline.secondary import Secondary
from pipeline.task import PositionTask, Task, pose_task
from pipeline.urdf import Description

PROJECT = File(__file__).resolve().parent.parent
GRAVITY = {"none": (0.0, 0.0, 0.0), "earth": (0.0, 0.0, -9.80665)}  # [m/s^2]
TIMINGS: dict[str, Callable[[float], Timing]] = {
    "raised_cosine": RaisedCosine,
    "constant_speed": ConstantSpeed,
    "quintic": Quintic,
}


def prepare(config: schema.RunConfig) -> Problem:
    """The problem that a configuration states; raises InputError, one line, if it cannot be posed."""
    robot = config.robot
    arm = load(robot, config.gravity)
    task = _task(robot, arm)
    q_init = initial(robot, arm)
    geometry, orientation, q_init = _path(config.path, task, q_init)
    reference = Reference(geometry, TIMINGS[config.timing.law](config.timing.duration), orientation)
    problem = Problem(
        task,
        reference,
        q_init,
        _knots(config.timing),
        objective=_objective(config, arm),
        limits=_limits(config.limits, arm),
        boundary=Boundary(config.boundary.kind),
        obstacles=_obstacles(config.obstacles, arm),
    )
    _check(problem)
    if config.base.kind == "fixed":
        _require_reach(problem)
    return base.place(problem, config)


def load(robot: schema.RobotConfig, gravity: str | list[float] = "none") -> Arm:
    """The arm of a configuration; raises RobotError or ConfigError, one line."""
    description = urdf.read(find(robot.urdf), robot.end_effector, robot.base, robot.locked)
    if robot.collision is not None:
        shapes = _link_shapes(robot.collision, description)
        description = replace(description, collision=shapes)
    if isinstance(robot.armature, list) and len(robot.armature) != len(description.joints):
        raise ConfigError(
            f"robot.armature has {len(robot.armature)} values, the arm has {len(description.joints)} moving joints"
        )
    return Arm(
        description,
        robot.offset,
        offset_rpy=robot.offset_rpy,
        base_position=robot.base_position,
        base_rpy=robot.base_rpy,
        gravity=GRAVITY[gravity] if isinstance(gravity, str) else gravity,
        payload=robot.payload,
        armature=robot.armature,
    )


def initial(robot: schema.RobotConfig, arm: Arm) -> Array:
    """robot.q_init, or the middle of the joints' ranges; zero where a joint has none."""
    if robot.q_init is None:
        low, high = arm.description.lower, arm.description.upper
        ranged = np.isfinite(high - low)
        return np.where(ranged, np.where(ranged, low + high, 0.0) / 2, 0.0)
    if len(robot.q_init) != arm.n:
        names = ", ".join(arm.description.joints)
        raise RobotError(f"robot.q_init has {len(robot.q_init)} values, the arm has {arm.n} moving joints ({names})")
    return np.array(robot.q_init)


def _knots(timing: schema.TimingConfig) -> Array:
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


def _limits(limits: schema.LimitsConfig, arm: Arm) -> Limits:
    """The description's limits as far as `kind` takes them, overridden by the values given."""
    description, free = arm.description, np.full(arm.n, np.inf)
    joint, all_of_them = limits.kind != "none", limits.kind == "joint_torque_power"

    def bound(key: str, own: Array) -> Array:
        given = getattr(limits, key)
        if given is None:
            return own
        if isinstance(given, list) and len(given) != arm.n:
            raise ConfigError(f"limits.{key} has {len(given)} values, the arm has {arm.n} moving joints")
        return np.broadcast_to(np.asarray(given, dtype=float), arm.n).copy()

    return Limits(
        lower=bound("lower", description.lower if joint else -free),
        upper=bound("upper", description.upper if joint else free),
        velocity=bound("velocity", description.velocity if joint else free),
        torque=bound("torque", description.effort if all_of_them else free),
        power=bound("power", free),
        attitude=np.inf if limits.attitude is None else limits.attitude,
    )


def _objective(config: schema.RunConfig, arm: Arm) -> Objective:
    """The objective; joints are centred in the ranges of the description, or those that `limits` gives."""
    own = config.objective
    weights: dict[str, Any] = {"kinetic_energy": 0.0, **own.weights}
    if isinstance(own, schema.WeightedConfig) and abs(sum(own.weights.values()) - 1.0) > 1e-9:
        names = " + ".join(f"objective.{name}" for name in own.weights)
        raise ConfigError(f"{names} = {sum(own.weights.values()):g}: the weights must add up to 1")
    if not any(own.weights.values()):
        raise ConfigError(f"objective = {own.kind}: all its weights are zero")
    if not own.criteria:
        return Objective(**weights)
    ranges = _limits(replace(config.limits, kind="joint"), arm)
    if "joint_centering" in own.criteria and not np.isfinite(ranges.upper - ranges.lower).any():
        raise ConfigError(
            f"objective.secondary = {own.secondary}: {arm.description.name} states no joint limits to centre its joints in; "
            "give limits.lower and limits.upper"
        )
    return Objective(**weights, secondary=Secondary(own.criteria, own.k0, ranges.lower, ranges.upper))


def _shape(name: str, shape: Any, frame: str | None = None) -> Shape:
    if isinstance(shape, schema.CapsuleConfig):
        return capsule(name, np.array(shape.start), np.array(shape.end), shape.radius, frame)
    center = tuple(shape.center)
    if isinstance(shape, schema.SphereConfig):
        return Shape(name, "sphere", (shape.radius,), center, frame=frame)
    turn = tuple(Rotation.from_euler("xyz", shape.rpy).as_rotvec().tolist())
    return Shape(name, "box", tuple(shape.size), center, turn, frame)


def _link_shapes(table: dict[str, list[Any]], description: Description) -> tuple[Shape, ...]:
    """The shapes that the configuration gives the links, in place of those of the description."""
    links = description.links
    for link in table:
        if link not in links:
            close = difflib.get_close_matches(link, links, n=3, cutoff=0.4) or list(links)[:12]
            raise ConfigError(f"robot.collision.{link}: no such link; did you mean {', '.join(close)}?")
    return tuple(_shape(link, shape, link) for link, shapes in table.items() for shape in shapes)


def _obstacles(obstacles: schema.ObstaclesConfig, arm: Arm) -> Obstacles | None:
    if not obstacles.shapes:
        return None
    if not arm.description.collision:
        meshes = f" (those of {', '.join(arm.description.meshes)} are meshes)" if arm.description.meshes else ""
        raise ConfigError(
            f"obstacles.shapes: {arm.description.name} has no primitive collision shapes{meshes}; give spheres, boxes or "
            "capsules in robot.collision"
        )
    shapes = tuple(_shape(name, shape) for name, shape in obstacles.shapes.items())
    return Obstacles(shapes, obstacles.margin, obstacles.influence)


def _check(problem: Problem) -> None:
    """Refuse what no motion can meet: contradicting limits, a fixed start outside them, an open path for a cycle."""
    limits, names = problem.bounds, problem.task.arm.description.joints
    for joint in np.flatnonzero(limits.lower >= limits.upper):
        raise ConfigError(
            f"limits.lower of {names[joint]} ({limits.lower[joint]:.4g}) is not below limits.upper ({limits.upper[joint]:.4g})"
        )
    if problem.boundary is Boundary.FIXED:
        outside = np.flatnonzero((problem.q_init < limits.lower) | (problem.q_init > limits.upper))
        for joint in outside:
            raise ConfigError(
                f"robot.q_init of {names[joint]} is {problem.q_init[joint]:.4g}, outside its limits "
                f"{limits.lower[joint]:.4g} to {limits.upper[joint]:.4g}, and boundary = fixed starts there"
            )
        if problem.obstacles is not None:
            distance, link, obstacle = Clearance(problem.task.arm, problem.obstacles).closest(problem.q_init)
            if distance < problem.obstacles.margin:
                raise ConfigError(
                    f"robot.q_init: {link} is {distance:.3g} m from obstacle {obstacle}, less than obstacles.margin = "
                    f"{problem.obstacles.margin:g} m, and boundary = fixed starts there"
                )
    if problem.boundary is Boundary.CYCLIC:
        ends = problem.reference.position(np.array([0.0, problem.reference.duration]))
        gap = float(np.linalg.norm(ends[1] - ends[0]))
        if gap > 1e-9:
            raise PathError(
                f"boundary = cyclic: the path ends {gap:.3g} m{' and rad' * (len(ends[0]) > 3)} from where it starts; "
                "a cycle needs a closed path"
            )


def find(name: str) -> File:
    """A robot description by package:// name, absolute path, or path relative to the working directory or the project."""
    if name.startswith(packages.PREFIX):
        return packages.locate(name, "robot.urdf")
    given = File(name).expanduser()
    if not given.is_absolute() and not given.is_file() and (PROJECT / given).is_file():
        return PROJECT / given
    return given.absolute()  # kept results are found again from any working directory


def _task(robot: schema.RobotConfig, arm: Arm) -> Task:
    if robot.orientation == "none":
        return PositionTask(arm, tuple(robot.task))
    if robot.task != ["x", "y", "z"]:
        raise RobotError(
            f"robot.task = [{', '.join(robot.task)}]: with robot.orientation = {robot.orientation} it must be [x, y, z]"
        )
    return pose_task(arm, robot.orientation, robot.pointing)


def _path(path: Any, task: Task, q_init: Array) -> tuple[Geometry, Orientation | None, Array]:
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
    if isinstance(path, schema.WaypointsConfig):
        if path.file in ("", "???"):
            raise ConfigError("path.file: not given; the way-points are rows of a CSV file, e.g. path.file=points.csv")
        points = read_waypoints(path.file, task.axes)
        return Spline(points + here - points[0] if path.relative else points)
    if path.start is not None and len(path.start) != count:
        raise ConfigError(f"path.start = {path.start}: must be {count} numbers m, one for each of robot.task")
    start = here if path.start is None else np.array(path.start)
    if isinstance(path, schema.CircleConfig):
        return circle(
            start,
            path.center_direction,
            path.radius,
            clockwise=path.clockwise,
            normal=path.normal,
            angle=path.angle,
        )
    return Line(start, direction_vector(path.direction, count), path.length)


def _orientation(path: schema.PathConfig, task: Task, geometry: Geometry, here: Array) -> Orientation | None:
    """Way-points may bring their own; otherwise from `path.orientation` (or that of q_init) through `path.turn`."""
    given = path.orientation is not None or any(path.turn)
    if isinstance(task, PositionTask):
        if given:
            raise ConfigError(
                "path.orientation, path.turn: the task prescribes no orientation; set robot.orientation to full or pointing"
            )
        return None
    if isinstance(path, schema.WaypointsConfig) and isinstance(geometry, Spline):
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


def _require_reach(problem: Problem) -> None:
    """Refuse a path that leaves the arm's reach, saying where along it and by how much."""
    task, geometry = problem.task, problem.reference.geometry
    s = np.linspace(0.0, geometry.length, 101)
    points = geometry.sample(s)[0]
    if problem.reference.orientation is not None:
        points = np.hstack([points, problem.reference.orientation.sample(s)[0]])
    # From the nearest of several configurations: one start alone can get stuck although the point can be reached.
    rng = np.random.default_rng(0)
    guesses = np.concatenate([problem.q_init[None], rng.uniform(-np.pi, np.pi, (11, task.arm.n))])
    gap = np.full(len(points), np.inf)
    for guess in guesses:
        open_points = gap > 1e-6
        if not open_points.any():
            return
        _, left = project(task, np.tile(guess, (int(open_points.sum()), 1)), points[open_points])
        gap[open_points] = np.minimum(gap[open_points], left)
    out = np.flatnonzero(gap > 1e-6)
    if out.size:
        worst = int(np.argmax(gap))
        raise PathError(
            f"path: out of reach from {s[out[0]]:.3g} m along its {geometry.length:.3g} m on; "
            f"the arm misses it by up to {gap[worst]:.3g} m{' and rad' * (points.shape[1] > 3)} (at {s[worst]:.3g} m)"
        )
