"""What a Pareto front says, from its points' verified costs: which points count, how much it gains, where it bends."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import pandas as pd

from pipeline.common.arrays import Array
from pipeline.evaluation.evaluation import Evaluation

EQUAL = 1e-6  # relative: costs closer than this are the same


def table(evaluations: Sequence[Evaluation]) -> pd.DataFrame | None:
    """One row per point: status (optimal, dominated, infeasible, failed), path class, bound, verified costs, knee.

    None if the run has no front. The costs are the evaluation's; `bound_excess` is how far the bounded one is above its
    bound, relative.
    """
    front = [e for e in evaluations if e.method == "pareto" and e.confirmed]
    if not front or "front" not in front[0].solution.statistics:
        return None
    statistics = front[0].solution.statistics
    rows = pd.DataFrame(statistics["front"])
    names = statistics["objectives"]
    costs = {e.solution.optimum: {name: e.integral(name) for name in names} for e in front}
    for name in names:
        rows[name] = [costs[point][name] if point in costs else np.nan for point in rows["point"]]
    bounded = [row[row["bounded"]] / row["bound"] - 1 if row["bounded"] else np.nan for row in rows.to_dict("records")]
    rows["bound_excess"] = bounded
    values = rows[names].to_numpy()
    solved = np.isfinite(values).all(axis=1)
    is_dominated = np.zeros(len(rows), dtype=bool)
    is_dominated[solved] = dominated(values[solved])
    infeasible = rows["solver_status"].str.contains("infeasib")
    rows["status"] = np.where(
        ~solved, np.where(infeasible, "infeasible", "failed"), np.where(is_dominated, "dominated", "optimal")
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
