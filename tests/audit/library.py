"""What pinocchio and coal make of a run's folder: arm, base, path and clearance, from its files alone.

Of `pipeline` only the place of a robot's file is asked for: no model, no path and no formula of it.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from itertools import pairwise
from pathlib import Path
from typing import Any

import coal
import numpy as np
import pandas as pd
import pinocchio as pin
import yaml
from scipy.interpolate import CubicSpline
from scipy.spatial.transform import Rotation

from pipeline.robot.packages import locate
from tests.readings.planar import Values, law

SUBSTEPS = 40  # of the base's integration, in each interval of the knots
NODES, WEIGHTS = np.polynomial.legendre.leggauss(6)


@dataclass(frozen=True)
class Robot:
    """The arm of a run in pinocchio, its base floating or welded, joints beside the chain's held at zero."""

    config: dict[str, Any]
    joints: int

    @cached_property
    def model(self) -> Any:
        file, robot = str(locate(self.config["robot"]["urdf"], "robot.urdf")), self.config["robot"]
        floats = self.config["base"]["kind"] == "free"
        model = pin.buildModelFromUrdf(file, pin.JointModelFreeFlyer()) if floats else pin.buildModelFromUrdf(file)
        beside = list(range(1 + floats + self.joints, model.njoints))
        model = pin.buildReducedModel(model, beside, pin.neutral(model))
        model.gravity.setZero()
        armature = np.zeros(model.nv)
        armature[6 * floats :] = robot["armature"]
        model.armature = armature
        return model

    @cached_property
    def data(self) -> Any:
        return self.model.createData()

    @property
    def floats(self) -> int:
        """Coordinates of the base's velocity: 6 or 0."""
        return int(self.model.nv - self.joints)

    def whole(self, q: Values, base: Values | None = None) -> Values:
        """Configuration of base (7,) and joints (n,); the base where it was at first."""
        return np.concatenate([pin.neutral(self.model)[: 7 if self.floats else 0] if base is None else base, q])

    def velocity(self, q: Values, qd: Values) -> Values:
        """Of base, with no momentum, and joints: (nv,)."""
        m, f = self.inertia(q), self.floats
        return np.concatenate([-np.linalg.solve(m[:f, :f], m[:f, f:] @ qd), qd])

    def inertia(self, q: Values) -> Values:
        """M (nv, nv)."""
        m = np.array(pin.crba(self.model, self.data, self.whole(q)))
        return np.triu(m) + np.triu(m, 1).T

    def energy(self, q: Values, v: Values) -> float:
        """[J] at joints q (n,) and the velocity v (nv,) of base and joints."""
        return float(0.5 * v @ self.inertia(q) @ v)

    def torque(self, q: Values, v: Values, a: Values) -> Values:
        """(n,) [N m] of the joints at the accelerations a (nv,) of base and joints."""
        return np.array(pin.rnea(self.model, self.data, self.whole(q), v, a))[self.floats :]

    def tip(self, q: Values, base: Values | None = None) -> Values:
        """(3,) [m]."""
        pin.framesForwardKinematics(self.model, self.data, self.whole(q, base))
        return np.array(self.data.oMf[self.model.getFrameId(self.config["robot"]["end_effector"])].translation)

    def bases(self, time: Values, q: Values) -> Values:
        """(N + 1, 7): where the base floats to, by the joints' spline and no momentum, in small midpoint steps."""
        spline, poses = CubicSpline(time, q), [self.whole(q[0])[:7]]
        free = pin.Model()
        free.addJoint(0, pin.JointModelFreeFlyer(), pin.SE3.Identity(), "base")
        for begin, end in pairwise(time):
            pose, h = poses[-1], (end - begin) / SUBSTEPS
            for k in range(SUBSTEPS):
                middle = begin + (k + 0.5) * h
                pose = pin.integrate(free, pose, h * self.velocity(spline(middle), spline(middle, 1))[:6])
            poses.append(pose)
        return np.array(poses)

    def clearance(self, q: Values) -> float:
        """The least distance [m] of a moving link from an obstacle, over the motion q (N + 1, n)."""
        file = locate(self.config["robot"]["urdf"], "robot.urdf")
        solids = [solid(values) for values in self.config["obstacles"]["shapes"].values()]
        shares = [str(up) for up in file.parents]
        links = pin.buildGeomFromUrdf(self.model, str(file), pin.GeometryType.COLLISION, package_dirs=shares)
        for link in links.geometryObjects:
            if isinstance(link.geometry, coal.BVHModelBase):  # a mesh stands for its hull
                link.geometry.buildConvexHull(True, "Qt")
                link.geometry = link.geometry.convex
        placed, least = links.createData(), np.inf
        for one in q:
            pin.updateGeometryPlacements(self.model, self.data, links, placed, one)
            for link, place in zip(links.geometryObjects, placed.oMg, strict=True):
                if link.parentJoint == 0:
                    continue  # it does not move
                for shape, where in solids:
                    pose = coal.Transform3s(place.rotation, place.translation)
                    answer = coal.DistanceResult()
                    coal.distance(link.geometry, pose, shape, where, coal.DistanceRequest(True, True), answer)
                    least = min(least, answer.min_distance)
        return float(least)


def solid(values: dict[str, Any]) -> tuple[Any, Any]:
    """One obstacle: shape and pose."""
    if values["kind"] != "sphere":
        raise ValueError(f"{values['kind']}: the shipped experiments have spheres alone")
    return coal.Sphere(values["radius"]), coal.Transform3s(np.eye(3), np.array(values["center"]))


def path(config: dict[str, Any], start: Values, t: Values) -> Values | None:
    """(K, 3): where the end effector should be; None for other curves and laws than the documents', and circles out of
    the plane.
    """
    curve, timing = config["path"], config["timing"]
    duration = timing["duration"]
    length = 2 * np.pi * curve["radius"] if curve["kind"] == "circle" else curve.get("length")
    if curve["kind"] not in ("line", "circle") or timing["law"] not in ("raised_cosine", "constant_speed"):
        return None
    if curve["kind"] == "circle" and np.ndim(curve["center_direction"]):
        return None
    s = law(t, length, duration)[0] if timing["law"] == "raised_cosine" else length * t / duration
    if curve["kind"] == "line":
        along = curve["direction"]
        if np.ndim(along):
            return np.asarray(start + s[:, None] * np.array(along) / np.linalg.norm(along))
        return np.asarray(start + s[:, None] * np.array([np.cos(np.radians(along)), np.sin(np.radians(along)), 0.0]))
    side, angle = -1.0 if curve["clockwise"] else 1.0, np.radians(curve["center_direction"])
    centre = start + curve["radius"] * np.array([np.cos(angle), np.sin(angle), 0.0])
    turned = angle + np.pi + side * s / curve["radius"]
    return np.asarray(centre + curve["radius"] * np.stack([np.cos(turned), np.sin(turned), 0 * turned], axis=1))


@dataclass(frozen=True)
class Run:
    """A finished run's folder."""

    folder: Path

    @cached_property
    def composed(self) -> dict[str, Any]:
        return dict(yaml.safe_load((self.folder / ".hydra" / "config.yaml").read_text(encoding="utf-8")))

    @cached_property
    def motions(self) -> pd.DataFrame:
        return pd.read_parquet(self.folder / "trajectories.parquet")

    @cached_property
    def summary(self) -> pd.DataFrame:
        return pd.read_csv(self.folder / "summary.csv")


def columns(motion: pd.DataFrame, name: str) -> Values:
    """(N + 1, n): `name`_1 to `name`_n."""
    return motion[[f"{name}_{j + 1}" for j in range(sum(c.startswith("q_") for c in motion))]].to_numpy()


def poses(motion: pd.DataFrame) -> Values:
    """Bases (N + 1, 7) of a motion: place and quaternion."""
    turn = Rotation.from_rotvec(motion[["base_rx", "base_ry", "base_rz"]].to_numpy(copy=True))
    return np.hstack([motion[["base_x", "base_y", "base_z"]].to_numpy(), turn.as_quat()])


def base_rates(motion: pd.DataFrame) -> tuple[Values, Values]:
    """Velocity and acceleration (N + 1, 6) of a base that turns about z alone, in its own frame, by the documents'
    backward differences of its place and angle.
    """
    time, angle = motion["time"].to_numpy(), motion["base_rz"].to_numpy()
    states = np.column_stack([motion[["base_x", "base_y"]].to_numpy(), angle])
    rate = np.vstack([np.zeros(3), np.diff(states, axis=0) / np.diff(time)[:, None]])
    change = np.vstack([np.zeros(3), np.diff(rate, axis=0) / np.diff(time)[:, None]])
    v, a = np.zeros((2, len(time), 6))
    c, s = np.cos(angle), np.sin(angle)
    for out, given in ((v, rate), (a, change)):
        out[:, 0], out[:, 1], out[:, 5] = (
            c * given[:, 0] + s * given[:, 1],
            c * given[:, 1] - s * given[:, 0],
            given[:, 2],
        )
    a[:, 0] += v[:, 5] * v[:, 1]
    a[:, 1] -= v[:, 5] * v[:, 0]
    return v, a
