"""What many tests need: arms, problems and configurations by name, central differences, solids with their distances."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
from hydra import compose, initialize_config_dir
from scipy.spatial.transform import Rotation

from pipeline.build.problem import prepare
from pipeline.build.robot import load
from pipeline.common.arrays import Array
from pipeline.config import run as config
from pipeline.config.compose import checked
from pipeline.config.methods import GlobalOptions
from pipeline.model.arm import Arm
from pipeline.problem.problem import Problem
from pipeline.robot.shapes import Shape, capsule

ROOT = Path(__file__).resolve().parents[1]


RUN_FILES = {  # what every run leaves that has a confirmed motion
    *(
        "summary.csv",
        "summary.md",
        "trajectories.parquet",
        "report.html",
        "recording.rrd",
        "run.json",
        "figures",
        ".hydra",
    ),
    *("motion.csv", "motion.json", "motion.yaml"),
}


def dense(blocks: tuple[Array, ...], cyclic: bool) -> Array:
    """(U s, U s) of blocks (U, s, s) on the diagonal and above it."""
    count, size = blocks[0].shape[:2]
    out = np.zeros((count, size, count, size))
    for apart, band in enumerate(blocks):
        assert len(band) == (count if cyclic else count - apart)
        for k, block in enumerate(band):
            other = (k + apart) % count
            out[k, :, other] += block
            if apart:
                out[other, :, k] += block.T
    return out.reshape(count * size, count * size)


def differences(function: Callable[[Array], Array], x: Array, step: float = 1e-6) -> Array:
    """Central differences of function((k,)) -> (...): (..., k)."""
    columns = [(function(x + step * e) - function(x - step * e)) / (2 * step) for e in np.eye(len(x))]
    return np.stack(columns, axis=-1)


def free_line(intervals: int) -> Problem:
    """Simulation 1 of the Global paper: 0.40 m in 1 s, free start at rest, on so many intervals."""
    timing = {"duration": 1.0, "steps": intervals}
    return prepare(config.check({"boundary": {"kind": "free"}, "path": {"kind": "line"}, "timing": timing}))


def backward_differences(problem: Problem, times: Array, motions: Array) -> Array:
    """sum_i 1/2 qd_i' M(q_i) qd_i dt_i of each motion (P, N + 1, n)."""
    dt = np.diff(times)
    velocity = np.diff(motions, axis=1) / dt[:, None]
    energy = problem.task.arm.kinetic_energy(motions[:, 1:].reshape(-1, 3), velocity.reshape(-1, 3))
    return energy.reshape(len(motions), -1) @ dt


# Starts enough for the optima of the tests' arms and paths, at a fraction of what the defaults cost.
FEW = GlobalOptions(configurations=12, candidates=150, optimised=6)
FEW_STARTS = tuple(f"method.global.{key}={getattr(FEW, key)}" for key in ("configurations", "candidates", "optimised"))


@cache
def composed(*overrides: str) -> config.RunConfig:
    """The checked configuration of a command line."""
    with initialize_config_dir(str(ROOT / "conf"), version_base="1.3"):
        return checked(compose("config", overrides=list(overrides)))


ROBOTS = ("planar3r", "planar4r", "panda", "xarm7")


@cache
def robot(name: str, **mounting: Any) -> Arm:
    """The arm of `robot=<name>`, with gravity and rotor inertia where it is asked for."""
    arm = load(composed(f"robot={name}").robot)
    return Arm(arm.description, replace(arm.mounting, **mounting))


def within_limits(arm: Arm, count: int, rng: np.random.Generator) -> Array:
    """Random configurations (count, n) inside the joint limits."""
    low = np.maximum(arm.description.lower, -np.pi)
    return rng.uniform(low, np.minimum(arm.description.upper, np.pi), size=(count, arm.n))


# --- solids -----------------------------------------------------------------------------------------------------------

BALL = Shape("ball", "sphere", (0.06,), (0.25, 0.2, 0.3))
ROD = capsule("rod", np.array([-0.4, 0.3, 0.1]), np.array([-0.2, 0.5, 0.7]), 0.04)
BOX = Shape("box", "box", (0.2, 0.1, 0.3), (0.1, -0.4, 0.4), (0.3, 0.2, -0.5))


def with_shapes(name: str) -> Arm:
    """Capsules in place of the arm's own shapes, along the longest edge of the box around each; planar3r has none of
    its own.
    """
    arm = robot(name)
    links = [link for link in arm.description.links if link != arm.description.base]
    ends = zip((0.25, 0.25, 0.3), links, strict=False)
    rods = [capsule(f"{link} rod", np.zeros(3), np.array([length, 0, 0]), 0.02, link) for length, link in ends]
    if arm.description.collision:
        rods = [_rod(shape) for shape in arm.description.collision]
    return Arm(replace(arm.description, collision=tuple(rods)))


def _rod(shape: Shape) -> Shape:
    if shape.kind == "cylinder":
        return replace(shape, kind="capsule")
    corners = shape.placed(shape.points)
    low, high = corners.min(axis=0), corners.max(axis=0)
    along = np.eye(3)[(high - low).argmax()] * (high - low) / 2
    return capsule(shape.name, (low + high) / 2 - along, (low + high) / 2 + along, 0.05, shape.frame)


def _ends(shape: Shape, position: Array, rotation: Array) -> Array:
    """The segment (2, 3) that a sphere or capsule surrounds, in the world."""
    half = np.array([0, 0, (shape.size[1] if shape.kind == "capsule" else 0.0) / 2])
    inner = Rotation.from_rotvec(shape.rotation)
    own = [np.array(shape.position) + inner.apply(sign * half) for sign in (-1, 1)]
    return np.array([position + rotation @ point for point in own])


def _between_segments(a: Array, b: Array) -> Array:
    """Distances (P,) of segments (P, 2, 3) by brute force, refined: no closed form to get wrong."""
    s = t = np.full(len(a), 0.5)
    width, pairs = 0.5, np.arange(len(a))
    for _ in range(40):
        grid = np.linspace(-width, width, 9)
        u, v = (np.clip(middle[:, None] + grid, 0, 1) for middle in (s, t))
        first, second = (
            segment[:, :1] + at[:, :, None] * (segment[:, 1:] - segment[:, :1]) for segment, at in ((a, u), (b, v))
        )
        distance = np.linalg.norm(first[:, :, None] - second[:, None], axis=3)
        i, j = np.divmod(distance.reshape(len(a), -1).argmin(axis=1), len(grid))
        s, t, width = u[pairs, i], v[pairs, j], width * 0.6
    return distance.min(axis=(1, 2))


def segment_distances(arm: Arm, others: tuple[Shape, ...], q: Array) -> Array:
    """The smallest distance (K,) [m] of the arm's moving spheres and capsules from `others` at q (K, n), without
    Drake's geometry: between segments, less the radii.
    """
    distances = []
    for shape in arm.description.collision:
        if shape.frame is None or shape.frame not in _moving_links(arm):
            continue
        frame = _moving_links(arm)[shape.frame]
        mine = np.array([_ends(shape, *pose) for pose in zip(*frame.pose(q[:, : frame.n]), strict=True)])
        for other in others:
            theirs = np.tile(_ends(other, np.zeros(3), np.eye(3)), (len(q), 1, 1))
            distances.append(_between_segments(mine, theirs) - shape.size[0] - other.size[0])
    return np.min(distances, axis=0)


@cache
def _moving_links(arm: Arm) -> dict[str, Arm]:
    """The arm up to each link whose place depends on the chain's joints alone, with at least one of them."""
    found = {}
    for link in {str(shape.frame) for shape in arm.description.collision} - {arm.description.base}:
        try:
            part = Arm.from_urdf(arm.description.file, link)
        except ValueError:
            continue
        if part.description.joints == arm.description.joints[: part.n]:
            found[link] = part
    return found
