"""The prescribed path: its geometry and orientation by arc length, its timing law s(t), and the reference that they make.

Points are in task coordinates (2 for a planar task, 3 in space) [m]; s is arc length [m]; t is time [s].
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path as File
from typing import Protocol

import numpy as np
import pandas as pd
from scipy.interpolate import CubicSpline
from scipy.spatial.transform import Rotation, RotationSpline

from pipeline.arrays import Array
from pipeline.errors import PathError


class Geometry(Protocol):
    """A curve by arc length."""

    @property
    def length(self) -> float:
        """Total arc length [m]."""

    def sample(self, s: Array) -> tuple[Array, Array, Array]:
        """Position, unit tangent dx/ds and curvature vector d2x/ds2 at s (K,), each (K, m)."""


def direction_vector(direction: float | Sequence[float], m: int, key: str = "path.direction") -> Array:
    """A unit vector (m,) from an angle in degrees (planar tasks) or from m numbers."""
    if isinstance(direction, int | float):
        if m != 2:
            raise PathError(
                f"{key} = {direction}: a task with {m} coordinates needs a direction of {m} numbers, not an angle"
            )
        angle = np.deg2rad(direction)
        return np.array([np.cos(angle), np.sin(angle)])
    vector = np.asarray(direction, dtype=float)
    if vector.shape != (m,) or not np.linalg.norm(vector) > 0:
        raise PathError(
            f"{key} = {list(direction)}: expected {m} numbers that are not all zero"
            + (", or one angle in degrees" if m == 2 else "")
        )
    unit: Array = vector / np.linalg.norm(vector)
    return unit


@dataclass(frozen=True)
class Line:
    """A straight line of `length` [m] from `start` (m,) along the unit vector `direction` (m,)."""

    start: Array
    direction: Array
    length: float

    def sample(self, s: Array) -> tuple[Array, Array, Array]:
        ones = np.ones((len(s), 1))
        return self.start + s[:, None] * self.direction, ones * self.direction, 0 * ones * self.direction


@dataclass(frozen=True)
class Arc:
    """An arc from `start` (m,) around a centre at `radius` [m] along the unit vector `to_center` (m,).

    `heading` (m,) is the unit tangent at the start, at right angles to `to_center`; `angle` [rad] is the arc's extent
    (2 pi: a circle).
    """

    start: Array
    to_center: Array
    heading: Array
    radius: float
    angle: float = 2 * np.pi

    @property
    def length(self) -> float:
        return self.radius * self.angle

    def sample(self, s: Array) -> tuple[Array, Array, Array]:
        phi = (s / self.radius)[:, None]
        inward, along = self.to_center, self.heading
        x = self.start + self.radius * ((1 - np.cos(phi)) * inward + np.sin(phi) * along)
        tangent = np.sin(phi) * inward + np.cos(phi) * along
        return x, tangent, (np.cos(phi) * inward - np.sin(phi) * along) / self.radius


def circle(
    start: Array,
    center_direction: float | Sequence[float],
    radius: float,
    *,
    clockwise: bool = False,
    normal: Sequence[float] = (0.0, 0.0, 1.0),
    angle: float = 360.0,
) -> Arc:
    """A circle (or an arc of `angle` degrees) through `start`; its centre lies along `center_direction`.

    In space the circle's plane is the one through `center_direction` at right angles to `normal` (3,).
    """
    m = len(start)
    inward = direction_vector(center_direction, m, "path.center_direction")
    if m == 2:
        heading = np.array([inward[1], -inward[0]])  # counter-clockwise: the centre is on the left
    else:
        axis = direction_vector(normal, 3, "path.normal")
        inward = inward - axis * (inward @ axis)
        if np.linalg.norm(inward) < 1e-9:
            raise PathError("path.center_direction is parallel to path.normal: they must span the circle's plane")
        inward /= np.linalg.norm(inward)
        heading = np.cross(inward, axis)
    return Arc(start, inward, -heading if clockwise else heading, radius, float(np.deg2rad(angle)))


class Spline:
    """A cubic spline (C2) through `points` (P, m) [m], reparametrised by arc length."""

    def __init__(self, points: Array) -> None:
        chord = np.linalg.norm(np.diff(points, axis=0), axis=1)
        knots = np.concatenate([[0.0], np.cumsum(chord)])
        self._curve = CubicSpline(knots, points) if len(points) > 2 else CubicSpline(knots, points, bc_type="natural")
        # Arc length by 8-point Gauss-Legendre on short pieces, then its inverse by Newton from a linear guess.
        nodes, weights = np.polynomial.legendre.leggauss(8)
        self._u = np.linspace(0.0, knots[-1], 64 * len(points))
        half = np.diff(self._u)[:, None] / 2
        inner = self._u[:-1, None] + half * (1 + nodes)
        pieces = (half * weights * np.linalg.norm(self._curve(inner, 1), axis=2)).sum(axis=1)
        self._s = np.concatenate([[0.0], np.cumsum(pieces)])
        self._gauss = nodes, weights
        self.length = float(self._s[-1])
        self.marks = np.interp(knots, self._u, self._s)  # (P,) [m] where along the curve the points lie

    def _parameter(self, s: Array) -> Array:
        s = np.clip(s, 0.0, self.length)
        u = np.interp(s, self._s, self._u)
        left = np.clip(np.searchsorted(self._s, s, side="right") - 1, 0, len(self._u) - 2)
        nodes, weights = self._gauss
        for _ in range(4):
            half = ((u - self._u[left]) / 2)[:, None]
            speed = np.linalg.norm(self._curve(self._u[left][:, None] + half * (1 + nodes), 1), axis=2)
            error = self._s[left] + (half * weights * speed).sum(axis=1) - s
            u = u - error / np.linalg.norm(self._curve(u, 1), axis=1)
        return np.clip(u, self._u[0], self._u[-1])

    def sample(self, s: Array) -> tuple[Array, Array, Array]:
        u = self._parameter(s)
        first, second = self._curve(u, 1), self._curve(u, 2)
        speed = np.linalg.norm(first, axis=1, keepdims=True)
        tangent = first / speed
        curvature = (second - tangent * np.einsum("km,km->k", tangent, second)[:, None]) / speed**2
        return self._curve(u), tangent, curvature


class Orientation:
    """A smooth turning along a path, through `rotations` at the arc lengths `marks` (P,) [m].

    Two rotations: about a fixed axis, in proportion to s. More: the spline of scipy's RotationSpline, with continuous
    angular velocity and acceleration.
    """

    def __init__(self, marks: Array, rotations: Rotation) -> None:
        self.marks, self.rotations = np.asarray(marks, dtype=float), rotations
        # Its iteration does not stop on rotations that are all the same.
        self._still = bool(np.all((rotations[0].inv() * rotations).magnitude() < 1e-12))
        self._spline = None if self._still else RotationSpline(self.marks, rotations)

    def sample(self, s: Array) -> tuple[Array, Array, Array]:
        """Rotation vector [rad], angular velocity dphi/ds [rad/m] and its derivative by s, all in the world, each (K, 3)."""
        if self._spline is None:
            still = np.zeros((len(s), 3))
            return still + self.rotations[0].as_rotvec(), still, still
        s = np.clip(s, self.marks[0], self.marks[-1])
        turned = self._spline(s)
        return turned.as_rotvec(), turned.apply(self._spline(s, 1)), turned.apply(self._spline(s, 2))


ROLL_PITCH_YAW, QUATERNION = ("roll", "pitch", "yaw"), ("qx", "qy", "qz", "qw")


def read_waypoints(file: str | File, axes: Sequence[str]) -> Array:
    """The way-points (P, m) of a CSV file with one column for each of `axes` [m]; P >= 2, all finite, no repeats."""
    values = _columns(File(file), axes)
    if len(values) < 2:
        raise PathError(f"path.file = {file}: {len(values)} way-point{'s' * (len(values) != 1)}, at least 2 are needed")
    repeated = np.flatnonzero(np.linalg.norm(np.diff(values, axis=0), axis=1) < 1e-12)
    if repeated.size:
        raise PathError(f"path.file = {file}: way-points {repeated[0] + 1} and {repeated[0] + 2} are the same point")
    return values


def read_orientations(file: str | File) -> Rotation | None:
    """The orientations of the same rows: columns roll, pitch, yaw [rad] or qx, qy, qz, qw; None if there are neither."""
    header = _table(File(file)).columns
    if set(ROLL_PITCH_YAW) <= set(header):
        return Rotation.from_euler("xyz", _columns(File(file), ROLL_PITCH_YAW))
    if set(QUATERNION) <= set(header):
        values = _columns(File(file), QUATERNION)
        zero = np.flatnonzero(np.linalg.norm(values, axis=1) < 1e-9)
        if zero.size:
            raise PathError(f"path.file = {file}: row {zero[0] + 1} of the data holds a quaternion of length zero")
        return Rotation.from_quat(values)
    return None


def _table(file: File) -> pd.DataFrame:
    if not file.is_file():
        raise PathError(f"path.file = {file}: no such file")
    try:
        table = pd.read_csv(file, skipinitialspace=True, comment="#")
    except (ValueError, OSError) as error:
        raise PathError(f"path.file = {file}: not a CSV table ({str(error).splitlines()[0]})") from None
    if not isinstance(table.index, pd.RangeIndex):
        raise PathError(f"path.file = {file}: the rows of the data hold more values than the header has columns")
    return table


def _columns(file: File, names: Sequence[str]) -> Array:
    table = _table(file)
    missing = [name for name in names if name not in table.columns]
    if missing:
        raise PathError(
            f"path.file = {file}: no column {', '.join(missing)}; the header is {', '.join(map(str, table.columns))}, needed are {', '.join(names)}"
        )
    values = table[list(names)].apply(pd.to_numeric, errors="coerce").to_numpy(dtype=float)
    bad = np.flatnonzero(~np.isfinite(values).all(axis=1))
    if bad.size:
        raise PathError(f"path.file = {file}: row {bad[0] + 1} of the data holds a value that is not a finite number")
    return values


class Timing(Protocol):
    """A law s(t) on [0, duration]."""

    @property
    def duration(self) -> float:
        """Motion time T [s]."""

    @property
    def at_rest(self) -> bool:
        """Whether the path starts and ends with zero speed."""

    def sample(self, t: Array, length: float) -> tuple[Array, Array, Array]:
        """s [m], sd [m/s] and sdd [m/s^2] at t (K,)."""


@dataclass(frozen=True)
class RaisedCosine:
    """The papers' law: acceleration (4 L / T^2)(1 - cos(4 pi t / T)), mirrored in the second half; jerk is continuous.

    PMKE paper eq. (5) and Global paper eqs (19), (23), which print s(t) under the label ds/dt.
    """

    duration: float
    at_rest: bool = True

    def sample(self, t: Array, length: float) -> tuple[Array, Array, Array]:
        total, omega = self.duration, 4 * np.pi / self.duration
        scale = 4 * length / total**2
        late = t > total / 2
        u = np.where(late, total - t, t)
        half = scale * (u**2 / 2 + (np.cos(omega * u) - 1) / omega**2)
        speed = scale * (u - np.sin(omega * u) / omega)
        acceleration = scale * (1 - np.cos(omega * u))
        return np.where(late, length - half, half), speed, np.where(late, -acceleration, acceleration)


@dataclass(frozen=True)
class ConstantSpeed:
    """s = L t / T: the path is entered and left at speed."""

    duration: float
    at_rest: bool = False

    def sample(self, t: Array, length: float) -> tuple[Array, Array, Array]:
        speed = length / self.duration
        return speed * t, np.full_like(t, speed), np.zeros_like(t)


@dataclass(frozen=True)
class Quintic:
    """Rest to rest with zero acceleration at both ends: s = L (10 u^3 - 15 u^4 + 6 u^5), u = t / T."""

    duration: float
    at_rest: bool = True

    def sample(self, t: Array, length: float) -> tuple[Array, Array, Array]:
        total = self.duration
        u = t / total
        s = length * u**3 * (10 - 15 * u + 6 * u**2)
        sd = length / total * 30 * u**2 * (1 - u) ** 2
        return s, sd, length / total**2 * 60 * u * (1 - u) * (1 - 2 * u)


@dataclass(frozen=True)
class Reference:
    """The end-effector motion to follow: a geometry, with or without orientations, run through under a timing law."""

    geometry: Geometry
    timing: Timing
    orientation: Orientation | None = None

    @property
    def duration(self) -> float:
        return self.timing.duration

    def sample(self, t: Array) -> tuple[Array, Array, Array]:
        """Targets, their velocities and accelerations at times t (K,), each (K, m), or (K, 6) for poses (see task.py)."""
        s, sd, sdd = self.timing.sample(np.asarray(t, dtype=float), self.geometry.length)
        x, tangent, curvature = self.geometry.sample(s)
        if self.orientation is not None:
            turned = self.orientation.sample(s)
            x, tangent, curvature = (np.hstack(pair) for pair in zip((x, tangent, curvature), turned, strict=True))
        return x, tangent * sd[:, None], curvature * sd[:, None] ** 2 + tangent * sdd[:, None]

    def position(self, t: Array) -> Array:
        return self.sample(t)[0]
