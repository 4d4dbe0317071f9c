"""What the base does (where it floats) or what it feels (where it is held), over time."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from matplotlib.figure import Figure

from pipeline.artifacts.figures.panels import add_legend, draw_lines, new_figure, stacked_panels
from pipeline.evaluation.evaluation import Evaluation
from pipeline.problem.problem import Problem
from pipeline.studies import style


def base(problem: Problem, evaluations: Sequence[Evaluation], name: str) -> Figure | None:
    """Floating: turn, shift, and the running integral of the squared angular velocity. Held: force and torque.

    None of a base that is simply fixed.
    """
    if not problem.task.arm.base.count:
        return None
    floats = problem.task.arm.base.kind == "floating"
    figure = new_figure(f"{name}: the base {'floats' if floats else 'is held'}", 10.0, 7.5 if floats else 6.0)
    panels = stacked_panels(figure, problem, 3 if floats else 2)
    labels = ("Turn from the start [deg]", "Shift from the start [m]", r"$\int|\omega|^2\,dt$ [rad$^2$/s]")
    for axes, label in zip(panels, labels if floats else ("Force [N]", "Torque [N m]"), strict=True):
        axes.set_ylabel(label)
    for e in evaluations:
        own = e.base
        if own.reaction is None:
            shift = np.linalg.norm(own.position - own.position[0], axis=1)
            curves = [np.rad2deg(own.turn), shift, own.integrals["base_rotation"]]
            legend = f"{style.name(e.label)}\n{np.rad2deg(own.turn[-1]):.3g} deg at the end"
        else:
            curves = [np.linalg.norm(own.reaction[:, part], axis=1) for part in (slice(3), slice(3, 6))]
            legend = f"{style.name(e.label)}\npeaks {np.nanmax(curves[0]):.3g} N, {np.nanmax(curves[1]):.3g} N m"
        for number, (axes, values) in enumerate(zip(panels, curves, strict=True)):
            draw_lines(axes, e, values, style.color(e.label), None if number else legend, style.dashes(e.label))
    for axes in panels:
        axes.set_ylim(bottom=0.0)
    add_legend(figure, panels[0])
    return figure
