"""The planner's optimum on finer and finer grids, beside the extremal of the maximum principle that it tends to."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import ClassVar

import numpy as np
import pandas as pd
from scipy.interpolate import CubicSpline

from pipeline.common.markdown import cells, markdown_table
from pipeline.model.kinematics import wrap
from pipeline.problem.costs import objective_values
from pipeline.problem.problem import Problem
from pipeline.problem.solution import Solution, Trajectory
from pipeline.program.transcription import transcribe
from pipeline.studies.study import Motions, Result

HALVINGS = 3


@dataclass(frozen=True)
class Convergence(Result):
    """table: see `table`."""

    name: ClassVar[str] = "convergence"
    table: pd.DataFrame

    def tables(self) -> Mapping[str, pd.DataFrame]:
        return {"convergence": self.table}

    def section(self) -> list[str]:
        title = "## Planner on finer grids, against the extremal of the maximum principle"
        return [title, "", *markdown_table(cells(self.table))]


def study(motions: Motions) -> Convergence | None:
    """Where both methods were asked for and found a motion."""
    optimum, extremal = motions.best("global"), motions.best("pontryagin")
    if optimum is None or extremal is None:
        return None
    return Convergence(table(motions.problem, optimum.solution.trajectory, extremal.solution))


def table(problem: Problem, optimum: Trajectory, extremal: Solution) -> pd.DataFrame:
    """One row per grid: intervals, objective, its error relative to the extremal's, the order that the last two errors
    show, and the largest joint difference [rad] at the end.
    """
    exact, revolute = extremal.statistics["integral"], problem.task.arm.description.revolute
    place = np.arange(len(optimum.time))
    rows: list[dict[str, float]] = []
    for halving in range(HALVINGS, -1, -1):
        intervals = max(2, (len(optimum.time) - 1) >> halving)
        times = np.interp(np.linspace(0, place[-1], intervals + 1), place, optimum.time)
        guess = CubicSpline(optimum.time, optimum.q)(times)
        q, outcome, _ = transcribe(replace(problem, times=times), times, guess).solve(tolerance=1e-10)
        if not outcome.converged:
            continue
        value = float(objective_values(problem, times, q[None])[0])
        error = value / exact - 1
        order = (
            np.log(rows[-1]["relative_error"] / error) / np.log(intervals / rows[-1]["intervals"]) if rows else np.nan
        )
        last = float(np.abs(wrap(q[-1] - extremal.trajectory.q[-1], revolute)).max())
        rows.append(
            {
                "intervals": intervals,
                "objective": value,
                "relative_error": error,
                "order": order,
                "end_difference": last,
            }
        )
    return pd.DataFrame(rows)
