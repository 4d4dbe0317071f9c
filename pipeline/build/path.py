"""The path of a configuration: curve, orientation, knots, and the task that follows it."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import partial
from typing import Any

import numpy as np
from scipy.spatial.transform import Rotation

from pipeline.build.gcode import feeds, is_gcode, moves_of
from pipeline.common.arrays import Array
from pipeline.common.errors import ConfigError, PathError, RobotError
from pipeline.config.messages import shown
from pipeline.config.path import CircleConfig, PathConfig, TimingConfig, WaypointsConfig
from pipeline.config.robot import RobotConfig
from pipeline.model.arm import Arm
from pipeline.model.kinematics import place
from pipeline.model.task import PositionTask, Task, pose_task
from pipeline.path.curves import Geometry, Line, Still, circle, direction_vector
from pipeline.path.mixed import mixed
from pipeline.path.orientation import Orientation
from pipeline.path.reference import Reference
from pipeline.path.spline import Sampled
from pipeline.path.through import SAME, TURN, Through, one_after_the_other, steps, through
from pipeline.path.timing import ConstantSpeed, Cruise, Quintic, RaisedCosine, Stamped, Timing, WithStops
from pipeline.path.waypoints import Waypoints, read, same_point
from pipeline.robot.packages import find

UNITS = {"m": 1.0, "mm": 1e-3}
FAR = 50  # times the arm's length between way-points: no mistake but that of the unit
NEGLIGIBLE = 1e-9  # of the length: a departure from the polygon below it is rounding

TIMINGS: dict[str, Callable[[float], Timing]] = {
    "raised_cosine": RaisedCosine,
    "constant_speed": ConstantSpeed,
    "quintic": Quintic,
    "optimal": RaisedCosine,
}


def timing_law(timing: TimingConfig) -> Callable[[float], Timing]:
    """What makes the law of a motion time [s]; where it is to be found, the one to begin with."""
    return partial(Cruise, ramp=timing.ramp) if timing.law == "cruise" else TIMINGS[timing.law]


def make_knots(timing: TimingConfig, duration: float) -> Array:
    """The grid (steps + 1,) [s]: even, or finer by the factors of `dense`."""
    if not timing.dense:
        return np.linspace(0.0, duration, timing.steps + 1)
    latest = max(end for _, end, _ in timing.dense)
    if latest > duration:
        raise ConfigError(f"timing.dense reaches to {latest:g} s, the motion ends at {duration:g} s")
    fine = np.linspace(0.0, duration, 20 * timing.steps + 1)
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


def make_reference(path: Any, timing: TimingConfig, task: Task, q_init: Array) -> tuple[Reference, Array, bool]:
    """The end effector's motion, q_init moved onto its start if the path says where it starts, and whether the path
    takes nothing from it: neither its start nor an orientation.
    """
    if timing.law == "from_file" and timing.duration == "shortest":
        raise ConfigError("timing.duration = shortest: the times are those of path.file (timing.law = from_file)")
    if timing.dense and timing.duration == "shortest":
        raise ConfigError("timing.dense: its times [s] are of a motion time that is given, not of the shortest")
    count = len(task.axes)
    here = task.value(q_init[None])[0]
    given = path.orientation is not None or any(path.turn) or path.meters_per_radian is not None
    if given and isinstance(task, PositionTask):
        raise ConfigError(
            "path.orientation, path.turn, path.meters_per_radian: the task prescribes no orientation; set "
            "robot.orientation to full or pointing"
        )
    blends = isinstance(path, WaypointsConfig) and path.corners == "blend"
    if path.meters_per_radian is not None and blends:
        raise ConfigError("path.meters_per_radian: path.corners = blend rounds by length alone; choose spline or stop")
    breaks: tuple[float, ...] = ()
    in_world = False
    if isinstance(path, WaypointsConfig) and is_gcode(path):
        found, moves, said = moves_of(path, task.axes, here[:count])
        geometry, orientation = found.geometry, None
        law: Timing
        if timing.law == "from_file":
            law = feeds(path, timing, found, moves)
        else:
            law = _law(path, timing, found, None)
            said.append(f"its feeds are not used, since timing.law = {timing.law}")
        notes = tuple(said)
    elif isinstance(path, WaypointsConfig):
        rows = _read(path, timing, task)
        given_points = rows.points * UNITS[path.units]
        points = given_points + here[:count] - given_points[0] if path.relative else given_points
        _refuse_millimetres(path, given_points, task.arm)
        blend = path.blend if path.corners == "blend" else None
        ends = [*rows.begins[1:], len(points)]
        paths = [
            through(
                points[a:b],
                None if rows.rotations is None else rows.rotations[a:b],
                rest=path.corners == "stop",
                blend=blend,
                radian=path.meters_per_radian,
            )
            for a, b in zip(rows.begins, ends, strict=True)
        ]
        found = one_after_the_other(paths, rows.begins)
        geometry, orientation = found.geometry, found.orientation
        in_world = not path.relative
        law, notes, breaks = _law(path, timing, found, rows.times), _notes(path, found), found.breaks
    else:
        if timing.law == "from_file":
            raise ConfigError(
                f"timing.law = from_file: the times are those of a file; path.kind = {path.kind} has none"
            )
        geometry, orientation, notes = _curve(path, task, here[:count]), None, ()
        in_world = path.start is not None
        law = timing_law(timing)(timing.seconds)
    if orientation is None and not isinstance(task, PositionTask):
        length = geometry.length
        geometry, orientation = _turning(path, geometry, here[count:])
        breaks = tuple(at * geometry.length / length for at in breaks)
        in_world &= path.orientation is not None
    if path.meters_per_radian is not None:
        notes = (*notes, f"a radian of turning counts as {path.meters_per_radian:g} m of the path's length")
    start = np.hstack([one.sample(np.zeros(1))[0] for one in (geometry, orientation) if one is not None])
    if np.abs(task.error(q_init[None], start)).max() > 1e-12:
        q_init = place(task, q_init, start[0])
    tolerances = path.tolerance, path.orientation_tolerance
    return Reference(geometry, law, orientation, *tolerances, notes, path.exact, breaks), q_init, in_world


def _refuse_millimetres(path: WaypointsConfig, points: Array, arm: Arm) -> None:
    """Raise PathError for way-points [m] that are hundreds of times as far apart as the arm can reach."""
    somewhere = np.random.default_rng(0).uniform(-np.pi, np.pi, (64, arm.n))
    room, extent = np.ptp(arm.position(somewhere), axis=0).max(), float(np.ptp(points, axis=0).max())
    if extent > FAR * room:
        raise PathError(
            f"path.file = {path.file}: its points are up to {extent:.4g} m apart, and the arm spans {room:.2g} m; "
            "are they in mm? path.units=mm"
        )


def _curve(path: Any, task: Task, here: Array) -> Geometry:
    """A line or a circle, or the point on which the tool turns."""
    count = len(task.axes)
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
    if not path.length:
        if not any(path.turn):
            raise ConfigError("path.length = 0: the path has no length, in space or in orientation (path.turn)")
        return Still(start, (path.meters_per_radian or TURN) * float(np.linalg.norm(path.turn)))
    return Line(start, direction_vector(path.direction, count), path.length)


def _turning(path: PathConfig, geometry: Geometry, here: Array) -> tuple[Geometry, Sampled]:
    """From `path.orientation` (or that of q_init) through `path.turn`, in proportion to the length; and the curve, by
    length and angle where both count.
    """
    first = Rotation.from_rotvec(here) if path.orientation is None else Rotation.from_euler("xyz", path.orientation)
    # Turns beyond half a turn need marks between: two rotations are joined by the shorter way.
    shares = np.linspace(0.0, 1.0, 2 + int(np.linalg.norm(path.turn) / 2))
    turned, marks = Rotation.from_rotvec(shares[:, None] * np.array(path.turn)), shares * geometry.length
    orientation = Orientation(marks, turned * first)
    if path.meters_per_radian is None:
        return geometry, orientation
    return mixed(geometry, orientation, marks, path.meters_per_radian)[:2]


def _read(path: WaypointsConfig, timing: TimingConfig, task: Task) -> Waypoints:
    """The rows of path.file, all of whose columns serve."""
    if path.file in ("", "???"):
        raise ConfigError("path.file: not given; the way-points are rows of a CSV file, e.g. path.file=points.csv")
    rows, where = read(find(path.file, "path.file"), task.axes), f"path.file = {path.file}"
    if rows.rotations is not None and isinstance(task, PositionTask):
        raise ConfigError(
            f"{where} has orientations, and the task prescribes none; set robot.orientation to full or pointing, or "
            "take the columns out"
        )
    if rows.rotations is not None and (path.orientation is not None or any(path.turn)):
        raise ConfigError(f"path.orientation, path.turn: {where} has orientations of its own")
    stamped = timing.law == "from_file"
    if stamped and rows.times is None:
        raise ConfigError(f"timing.law = from_file: {where} has no column time")
    if not stamped and rows.times is not None:
        raise ConfigError(
            f"{where} has a column time, and timing.law = {timing.law} does not take it; set timing=from_file, or take "
            "the column out"
        )
    if stamped and len(rows.begins) > 1:
        raise ConfigError(f"{where} has a column segment, and timing.law = from_file is for one tool path alone")
    moves, turns = steps(rows.points, rows.rotations)
    still = np.flatnonzero(np.maximum(moves, turns) <= SAME)
    if still.size and (not stamped or len(still) == len(moves)):
        raise PathError(f"{where}: {same_point(int(still[0]))}; to wait there takes a column time and timing=from_file")
    return rows


def _law(path: WaypointsConfig, timing: TimingConfig, found: Through, times: Array | None) -> Timing:
    length = found.geometry.length
    if timing.law == "optimal" and found.stops:
        raise PathError(
            f"timing.law = optimal: path.file = {path.file} comes to rest at way-point {found.stops[0] + 1}, which "
            "a law that is found does not; choose timing=raised_cosine, quintic or cruise"
        )
    if times is not None:
        return Stamped(tuple((times - times[0]).tolist()), tuple((found.marks / length).tolist()), found.stops)
    law = timing_law(timing)
    if not found.stops:
        return law(timing.seconds)
    if not law(timing.seconds).at_rest:
        raise PathError(
            f"path.file = {path.file}: the path turns back, or on the spot, at way-point {found.stops[0] + 1} while "
            f"moving at {length / timing.seconds:.3g} m/s (timing.law = {timing.law}); the laws raised_cosine, "
            "quintic and cruise come to rest there"
        )
    between = [found.marks[i] / length for i in found.stops]
    return WithStops(law, timing.seconds, (0.0, *map(float, between), 1.0))


def _notes(path: WaypointsConfig, found: Through) -> tuple[str, ...]:
    notes = []
    distance, before = found.departure
    if distance > NEGLIGIBLE * found.geometry.length:
        ways = {
            "spline": "; path.corners=blend goes straight and rounds the corners, path.corners=stop stops at them",
            "blend": "",
        }
        notes.append(
            f"the smooth curve leaves the polygon of its way-points by up to {distance:.3g} m, between way-points "
            f"{before} and {before + 1}{ways.get(path.corners, '')}"
        )
    elif path.corners == "stop":
        notes.append("the path keeps to the polygon of its way-points")
    if found.closer:
        notes.append(f"{_listed(found.closer)} lie too close to the next for path.blend: the path keeps closer to them")
    if found.stops:
        why = "" if path.corners == "stop" else ", where it turns back or on the spot"
        notes.append(f"the path comes to rest at {_listed(found.stops)}{why}")
    if found.breaks:
        notes.append(f"the path is {len(found.breaks) + 1} tool paths, one after the other")
    return tuple(notes)


def _listed(which: Sequence[int]) -> str:
    shown_ones = ", ".join(str(i + 1) for i in which[:8]) + ", ..." * (len(which) > 8)
    return f"way-point{'s' * (len(which) > 1)} {shown_ones}"
