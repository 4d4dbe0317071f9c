"""What a Pareto front says, from its points' verified costs: which points count, how much it gains, where it bends."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, ClassVar

import numpy as np
import pandas as pd

from pipeline.common.arrays import Array
from pipeline.common.markdown import cells, markdown_table
from pipeline.evaluation.evaluation import Evaluation
from pipeline.problem.integrals import INTEGRALS
from pipeline.studies import style
from pipeline.studies.study import Motions, Result

if TYPE_CHECKING:
    from matplotlib.figure import Figure

DURATION, TOLERANCE = "duration", "path_tolerance"  # beside the integrals
EQUAL = 1e-6  # relative: costs closer than this are the same
FEW = 4  # motions between the extremes that figures show one by one


@dataclass(frozen=True)
class Front(Result):
    """table: one row per point, see `table`."""

    name: ClassVar[str] = "front"
    cover: ClassVar[str] = "front"
    table: pd.DataFrame

    @property
    def good(self) -> pd.DataFrame:
        """The points that nothing dominates."""
        return self.table[self.table["status"] == "optimal"]

    @property
    def objectives(self) -> list[str]:
        """The two integrals that are traded, in the order of the table's columns."""
        return [column for column in self.table.columns if column in (DURATION, TOLERANCE, *INTEGRALS)]

    @property
    def share(self) -> float:
        """The hypervolume."""
        return hypervolume(self.good[self.objectives].to_numpy())

    def tables(self) -> Mapping[str, pd.DataFrame]:
        return {"front": self.table}

    def section(self) -> list[str]:
        head = f"Hypervolume {self.share:.4f} of the rectangle between the extremes."
        return ["## Pareto front", "", head, "", *markdown_table(cells(self.table.drop(columns=["solver_status"])))]

    def figures(self, title: str) -> Mapping[str, Figure]:
        return {"front": draw(self, title)}

    def hides(self, motion: Evaluation) -> bool:
        """Of a front its extremes, its knee and a few points between them are shown."""
        good = self.good
        shown = set(good[good["extreme"] | good["knee"]]["point"]) | set(
            good["point"].iloc[:: max(1, len(good) // FEW)]
        )
        return motion.method == "pareto" and motion.solution.optimum not in shown


def study(motions: Motions) -> Front | None:
    """Where a front was asked for and found."""
    points = motions.confirmed("pareto")
    return Front(table(points)) if points and "front" in points[0].solution.statistics else None


def table(front: Sequence[Evaluation]) -> pd.DataFrame:
    """One row per point: status (optimal, dominated, none found, failed), path class, bound, verified costs, knee.

    The costs are the evaluation's; `bound_excess` is how far the bounded one is above its bound, relative.
    """
    statistics = front[0].solution.statistics
    rows = pd.DataFrame(statistics["front"])
    names = statistics["objectives"]
    costs = {e.solution.optimum: {name: cost(e, name) for name in names} for e in front}
    for name in names:
        rows[name] = [costs[point][name] if point in costs else np.nan for point in rows["point"]]
    bounded = [row[row["bounded"]] / row["bound"] - 1 if row["bounded"] else np.nan for row in rows.to_dict("records")]
    rows["bound_excess"] = bounded
    values = rows[names].to_numpy()
    solved = np.isfinite(values).all(axis=1)
    is_dominated = np.zeros(len(rows), dtype=bool)
    is_dominated[solved] = dominated(values[solved])
    none_found = rows["solver_status"].str.contains("infeasib")  # from the starts that it had, which proves nothing
    rows["status"] = np.where(
        ~solved, np.where(none_found, "none found", "failed"), np.where(is_dominated, "dominated", "optimal")
    )
    rows["knee"] = False
    good = np.flatnonzero(solved & ~is_dominated)
    if len(good) > 2:
        rows.loc[good[knee(values[good])], "knee"] = True
    return rows[
        [
            "point",
            "status",
            *names,
            "path_class",
            "extreme",
            "knee",
            "direction",
            "bounded",
            "bound",
            "bound_excess",
            "solver_status",
        ]
    ]


def cost(motion: Evaluation, name: str) -> float:
    """What `motion` costs by one of the integrals; its duration [s]; or its largest distance from the path [m]."""
    own = {DURATION: float(motion.time[-1]), TOLERANCE: motion.tracking_error_between}
    return own[name] if name in own else motion.integral(name)


def unit(name: str) -> str:
    """Of that cost."""
    own = {DURATION: "s", TOLERANCE: "m"}
    return own[name] if name in own else INTEGRALS[name].unit


def label(name: str) -> str:
    """Of an axis, with its unit."""
    own = {DURATION: "motion time", TOLERANCE: "largest distance from the path"}
    return f"{own[name] if name in own else INTEGRALS[name].label} [{unit(name)}]"


def dominated(values: Array) -> Array:
    """Whether each of the points (P, 2) has another that is no worse in both and better in one, beyond EQUAL."""
    scale = EQUAL * np.abs(values).max(axis=0)
    no_worse = np.all(values[None] <= values[:, None] + scale, axis=2)
    better = np.any(values[None] < values[:, None] - scale, axis=2)
    return np.any(no_worse & better, axis=1)


def knee(values: Array) -> int:
    """The point (of P, sorted by the first cost) farthest below the line between both ends, costs scaled to [0, 1]."""
    span = np.ptp(values, axis=0)
    scaled = (values - values.min(axis=0)) / np.where(span > 0, span, 1.0)
    return int(np.argmin(scaled.sum(axis=1)))


def hypervolume(values: Array) -> float:
    """Share of the rectangle between the extremes that the non-dominated points (P, 2) dominate, 0 to 1."""
    span = np.ptp(values, axis=0)
    if not np.all(span > 0):
        return 0.0
    scaled = (values - values.min(axis=0)) / span
    scaled = scaled[np.argsort(scaled[:, 0])]
    right = np.append(scaled[1:, 0], 1.0)
    return float(((right - scaled[:, 0]) * (1 - np.minimum.accumulate(scaled[:, 1]))).sum())


def draw(front: Front, name: str) -> Figure:
    """Both axes labelled, extremes and knee marked, classes by colour, dominated points apart."""
    (x, y), good, table = front.objectives, front.good.sort_values(front.objectives[0]), front.table
    figure = style.sheet(7.4, 5.4)
    axes = figure.add_subplot()
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
    apart = table[table["status"] == "dominated"]
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
    axes.set(
        xlabel=label(x),
        ylabel=label(y),
        title=f"{name}: Pareto front, hypervolume {front.share:.3f} of the extremes' rectangle",
    )
    for name, scale in ((x, axes.set_xscale), (y, axes.set_yscale)):
        if name == TOLERANCE:  # from a motion on its path to one that is as far off as it may be
            scale("log")
    axes.grid(True, color="0.93")
    axes.set_axisbelow(True)
    axes.legend(fontsize=9)
    return figure
