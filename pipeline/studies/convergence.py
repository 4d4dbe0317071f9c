"""The planner's optimum on finer and finer grids, held against the extremal of the maximum principle that it tends to."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pandas as pd
from scipy.interpolate import CubicSpline

from pipeline.model.kinematics import wrap
from pipeline.problem.costs import objective_values
from pipeline.problem.problem import Problem
from pipeline.problem.solution import Solution, Status
from pipeline.program.transcription import transcribe

HALVINGS = 3


def table(problem: Problem, solutions: list[Solution]) -> pd.DataFrame | None:
    """One row per grid: intervals, objective, its error relative to the extremal's, the order that the last two errors
    show, and the largest joint difference [rad] at the end. None without an optimum of both methods.
    """
    best = {solution.method: solution for solution in reversed(solutions) if solution.status is Status.SOLVED}
    if "global" not in best or "pontryagin" not in best:
        return None
    extremal, optimum = best["pontryagin"], best["global"].trajectory
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
