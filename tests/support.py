"""What many tests need: arms, problems and configurations by name, and central differences."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
from hydra import compose, initialize_config_dir

from pipeline.build.problem import prepare
from pipeline.build.robot import load
from pipeline.common.arrays import Array
from pipeline.config import run as config
from pipeline.config.compose import checked
from pipeline.model.arm import Arm
from pipeline.problem.problem import Problem

ROOT = Path(__file__).resolve().parents[1]


RUN_FILES = {  # what every run leaves that has a confirmed motion
    *("summary.csv", "summary.md", "trajectories.parquet", "recording.rrd", "run.json", "figures", ".hydra"),
    *("motion.csv", "motion.json", "motion.yaml"),
}


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
