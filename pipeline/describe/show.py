"""Print what an arm is, and make the motion that shows every joint."""

from __future__ import annotations

import numpy as np
from rich.console import Console
from rich.table import Table

from pipeline.common.arrays import Array
from pipeline.describe.facts import Facts

SECONDS = 2.0  # of each joint's sweep


SAMPLES = 40


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
