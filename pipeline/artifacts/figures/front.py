"""The Pareto front as a picture: both axes labelled, extremes and knee marked, classes by colour, dominated apart."""

from __future__ import annotations

from pathlib import Path

import pandas as pd
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure

from pipeline.artifacts import style
from pipeline.common.files import write_beside
from pipeline.problem.integrals import INTEGRALS
from pipeline.studies.front import hypervolume


def draw(front: pd.DataFrame, name: str) -> Figure:
    """From the table of `pipeline.front.table`."""
    objectives = [column for column in INTEGRALS if column in front.columns]
    objectives.sort(key=list(front.columns).index)
    x, y = objectives
    figure = Figure(figsize=(7.4, 5.4), layout="constrained")
    FigureCanvasAgg(figure)
    axes = figure.add_subplot()
    good = front[front["status"] == "optimal"].sort_values(x)
    axes.step(good[x], good[y], where="post", color="0.8", linewidth=1.0, zorder=1, label="dominated region's edge")
    for number in range(1, int(good["path_class"].max()) + 1):
        points = good[good["path_class"] == number]
        for bounded, marker in ((y, "o"), (x, "s"), ("", "D")):
            some = points[points["bounded"] == bounded]
            if some.empty:
                continue
            bound = {y: f"{y.replace('_', ' ')} bounded", x: f"{x.replace('_', ' ')} bounded", "": "unbounded"}[bounded]
            axes.plot(
                some[x],
                some[y],
                marker,
                color=style.joint_color(number - 1),
                markersize=6,
                label=f"path class {number}, {bound}",
            )
    apart = front[front["status"] == "dominated"]
    if not apart.empty:
        axes.plot(apart[x], apart[y], "x", color="0.55", label="dominated")
    for row in good[good["extreme"]].to_dict("records"):
        left = row[x] > good[x].mean()
        shift = (-8 if left else 8, 9)
        side = "right" if left else "left"
        axes.annotate("extreme", (row[x], row[y]), xytext=shift, textcoords="offset points", fontsize=9, ha=side)
        axes.plot(row[x], row[y], "o", markersize=13, markerfacecolor="none", color="0.2")
    for row in good[good["knee"]].to_dict("records"):
        axes.annotate(
            "knee",
            (row[x], row[y]),
            xytext=(10, 10),
            textcoords="offset points",
            fontsize=9,
            arrowprops={"arrowstyle": "->"},
        )
    share = hypervolume(good[[x, y]].to_numpy())
    axes.set(
        xlabel=_label(x),
        ylabel=_label(y),
        title=f"{name}: Pareto front, hypervolume {share:.3f} of the extremes' rectangle",
    )
    axes.grid(True, color="0.93")
    axes.set_axisbelow(True)
    axes.legend(fontsize=9)
    return figure


def _label(name: str) -> str:
    return f"{INTEGRALS[name].label} [{INTEGRALS[name].unit}]"


def write(folder: Path, front: pd.DataFrame, *, name: str) -> Path:
    """Draw it into `folder`/front.png."""
    file = folder / "front.png"
    figure = draw(front, name)
    write_beside(file, lambda part: figure.savefig(part, format="png", dpi=130))
    return file
