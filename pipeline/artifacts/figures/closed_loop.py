"""The closed-loop check as a picture: errors, and torques beside their limits, with saturation shaded."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure

from pipeline.artifacts import style
from pipeline.common.files import write_beside
from pipeline.problem.problem import Problem
from pipeline.studies.closed_loop import ClosedLoop

POINTS = 2000  # most per line


def draw(loop: ClosedLoop, problem: Problem, name: str) -> Figure:
    """Joint errors, end-effector error, and torques relative to their limits (or in N m where there are none)."""
    figure = Figure(figsize=(9.0, 7.5), layout="constrained")
    FigureCanvasAgg(figure)
    panels = figure.subplots(3, 1, sharex=True)
    thin = slice(None, None, max(1, len(loop.time) // POINTS))
    time = loop.time[thin]
    limited = bool(np.isfinite(loop.effort).all())
    torques = loop.wanted[thin] / loop.effort if limited else loop.wanted[thin]
    for j, joint in enumerate(problem.task.arm.description.joints):
        color = style.joint_color(j)
        panels[0].plot(time, loop.joint_error[thin, j], color=color, linewidth=1.3, label=joint)
        panels[2].plot(time, torques[:, j], color=color, linewidth=1.3)
    panels[1].plot(time, loop.end_effector_error[thin], color=style.color(loop.method), linewidth=1.5)
    if limited:
        for bound in (-1.0, 1.0):
            panels[2].axhline(bound, color="#C53030", linestyle=(0, (4, 3)), linewidth=1.0)
    for axes in panels:
        axes.fill_between(
            time, 0, 1, where=loop.saturated.any(axis=1)[thin], transform=axes.get_xaxis_transform(), color="#F6D5D5"
        )
        axes.grid(color="#E2E8F0", linewidth=0.7)
        axes.set_axisbelow(True)
        axes.spines[["top", "right"]].set_visible(False)
    panels[0].set_ylabel("Joint error [rad]")
    panels[1].set_ylabel("End-effector error [m]")
    panels[2].set_ylabel("Wanted torque / limit" if limited else "Torque [N m]")
    panels[2].set_xlabel("Time [s]; shaded: a joint is at its effort limit")
    figure.legend(
        *panels[0].get_legend_handles_labels(), loc="outside lower center", ncols=7, fontsize=8, frameon=False
    )
    figure.suptitle(f"{name}: closed loop, {style.name(loop.method)}", fontweight="bold")
    return figure


def write(folder: Path, loop: ClosedLoop, problem: Problem, *, name: str) -> Path:
    """Draw it into `folder`/closed_loop.png."""
    file = folder / "closed_loop.png"
    figure = draw(loop, problem, name)
    write_beside(file, lambda part: figure.savefig(part, format="png", dpi=130))
    return file
