"""`python -m pipeline.inspect robot=panda`: what an arm is, before anything is planned with it.

Prints joints and limits, masses, reach and the redundancy degree for each kind of task, and writes a recording in which
one joint after the other moves through its range.
"""

from __future__ import annotations

import sys
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from omegaconf import DictConfig
from rich.console import Console
from rich.table import Table
from scipy.optimize import minimize

from pipeline import config as schema
from pipeline import session
from pipeline.arm import Arm
from pipeline.arrays import Array
from pipeline.packages import resolve
from pipeline.prepare import initial, load
from pipeline.urdf import link_masses

# Rows of the spatial Jacobian (angular, linear) that each kind of task prescribes.
TASKS = {
    "position in the x-y plane": [3, 4],
    "position": [3, 4, 5],
    "position and pointing": [0, 1, 3, 4, 5],
    "pose": [0, 1, 2, 3, 4, 5],
}
SECONDS = 2.0  # of each joint's sweep
SAMPLES = 40


@dataclass(frozen=True)
class Facts:
    """What is printed. masses: of each moving joint's rigid group of links [kg]. reach [m] from the first joint."""

    arm: Arm
    q_init: Array
    masses: dict[str, float]
    reach: float
    tasks: dict[str, tuple[int, int]]  # of each kind: rank of its Jacobian, and m
    notes: list[str]


def inspect(robot: schema.RobotConfig, gravity: str | list[float] = "none") -> Facts:
    """Load the arm and look at it; raises RobotError, one line, if it cannot be used."""
    arm = load(robot, gravity)
    description = arm.description
    q_init = initial(robot, arm)
    notes = []
    unlimited = [n for n, v in zip(description.joints, description.velocity, strict=True) if not np.isfinite(v)]
    weak = [n for n, v in zip(description.joints, description.effort, strict=True) if not np.isfinite(v)]
    for names, what in ((unlimited, "velocity"), (weak, "effort")):
        if names:
            notes.append(f"no {what} limit stated for {', '.join(names)}")
    outside = (q_init < description.lower) | (q_init > description.upper)
    for joint in np.flatnonzero(outside):
        notes.append(f"robot.q_init of {description.joints[joint]} is outside its limits")
    if description.meshes and not description.collision:
        notes.append("collision shapes are meshes: for obstacles give spheres, boxes or capsules in robot.collision")
    if arm.payload > 0:
        notes.append(f"a payload of {arm.payload:g} kg at the end effector")
    if np.any(arm.armature):
        notes.append(f"rotor inertia {', '.join(f'{a:g}' for a in arm.armature)} kg m^2 added to the joints")
    missing = [
        mesh
        for mesh in description.pictures
        if (file := resolve(mesh, description.file.parent)) is None or not file.is_file()
    ]
    if missing:
        count = f"{len(missing)} mesh file{'s' * (len(missing) > 1)}"
        notes.append(f"{count} not found, such as {missing[0]}: the arm is drawn without")
    return Facts(arm, q_init, link_masses(description), reach(arm), ranks(arm), notes)


def ranks(arm: Arm) -> dict[str, tuple[int, int]]:
    """For each kind of task, the rank of its Jacobian at a generic configuration, and m."""
    q = np.random.default_rng(1).uniform(-1.0, 1.0, size=(8, arm.n))
    frame = arm.pose(q)[1]
    both = arm.spatial_jacobian(q)
    own = np.concatenate([frame.swapaxes(1, 2) @ both[:, :3], both[:, 3:]], axis=1)
    return {task: (int(np.linalg.matrix_rank(own[:, rows], tol=1e-8).max()), len(rows)) for task, rows in TASKS.items()}


def reach(arm: Arm) -> float:
    """The largest distance [m] of the end effector from the first joint's axis origin, within the joint limits."""
    low = np.maximum(arm.description.lower, np.where(arm.description.revolute, -np.pi, -1.0))
    high = np.minimum(arm.description.upper, np.where(arm.description.revolute, np.pi, 1.0))
    first = arm.first_joint()
    rng = np.random.default_rng(0)
    q = rng.uniform(low, high, size=(4096, arm.n))
    distance = np.linalg.norm(arm.position(q) - first, axis=1)

    def less(x: Array) -> tuple[float, Array]:
        position, jacobian = arm.position_and_jacobian(x[None])
        gap = position[0] - first
        return -0.5 * float(gap @ gap), -(gap @ jacobian[0])

    bounds = list(zip(low, high, strict=True))
    best = [minimize(less, q[i], jac=True, bounds=bounds, method="L-BFGS-B").fun for i in np.argsort(-distance)[:8]]
    return float(np.sqrt(-2 * min(best)))


def show(facts: Facts, console: Console) -> None:
    """Print the facts."""
    arm = facts.arm
    description = arm.description
    console.print(
        f"[bold]{description.name}[/bold]  {description.file.name}, {description.base} to {description.end_effector}"
    )
    table = Table(box=None, padding=(0, 1))
    for column in ("joint", "type", "lower", "upper", "velocity", "effort", "q_init", "kg moved"):
        table.add_column(column, justify="left" if column in ("joint", "type") else "right", no_wrap=True)
    for j, name in enumerate(description.joints):
        values = (description.lower[j], description.upper[j], description.velocity[j], description.effort[j])
        cells = [f"{value:.4g}" if np.isfinite(value) else "none" for value in values]
        kind = "turns" if description.revolute[j] else "slides"
        table.add_row(name, kind, *cells, f"{facts.q_init[j]:.4g}", f"{facts.masses[name]:.4g}")
    console.print(table)
    console.print("limits in rad, rad/s and N m (m, m/s and N of joints that slide)")
    tip = arm.position(facts.q_init[None])[0]
    console.print(f"moving mass {sum(facts.masses.values()):.4g} kg, reach {facts.reach:.4g} m from the first joint")
    console.print(f"end effector at q_init: {', '.join(f'{v:.4g}' for v in tip)} m")
    for task, (rank, m) in facts.tasks.items():
        r = arm.n - m
        said = f"r = {r}" if r > 0 else "no redundancy"
        console.print(
            f"  {task} (m = {m}): " + (said if rank == m else f"the arm moves in {rank} of {m} directions only")
        )
    for note in facts.notes:
        console.print(f"note: {note}")


def sweep(facts: Facts) -> tuple[Array, Array]:
    """A motion that shows every joint: time (K,) [s] and q (K, n), each joint in turn through its range from q_init."""
    description = facts.arm.description
    rows = []
    wave = np.sin(np.linspace(0.0, 2 * np.pi, SAMPLES))
    for j in range(facts.arm.n):
        q = np.tile(facts.q_init, (SAMPLES, 1))
        full = 1.0 if description.revolute[j] else 0.1
        up = min(max(description.upper[j] - facts.q_init[j], 0.0), full)
        down = min(max(facts.q_init[j] - description.lower[j], 0.0), full)
        q[:, j] += np.where(wave > 0, wave * up, wave * down)
        rows.append(q)
    q = np.concatenate(rows)
    return np.linspace(0.0, SECONDS * facts.arm.n, len(q)), q


class Session(session.Session):
    """Hydra's hooks: nothing is planned, so neither path nor methods are checked before the output folder is made."""

    def check(self, asked: schema.RunConfig) -> None:
        initial(asked.robot, load(asked.robot, asked.gravity))


def job(values: DictConfig) -> int:
    """Print and record one arm."""
    from hydra.core.hydra_config import HydraConfig

    from pipeline.artifacts import arm_recording

    folder = Path(HydraConfig.get().runtime.output_dir)
    config = session.checked(values)
    facts = inspect(config.robot, config.gravity)
    console = Console()
    show(facts, console)
    file = folder / "recording.rrd"
    arm_recording.write(file, facts.arm, *sweep(facts), name=replace(config.robot).name)
    console.print(f"recording in {file}", highlight=False, soft_wrap=True)
    return 0


def main() -> int:
    """The command line."""
    from pipeline.__main__ import run_job

    hooks = "hydra.callbacks.session._target_=pipeline.inspect.Session"
    return run_job(job, ["hydra.run.dir=outputs/inspect/${robot.name}", hooks])


if __name__ == "__main__":
    sys.exit(main())
