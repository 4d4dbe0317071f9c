"""Hold the planner's optimum against dynamic programming, which is global on its grid: a certificate (r = 1)."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import ClassVar

from scipy.interpolate import CubicSpline

from pipeline.problem.costs import objective_values
from pipeline.problem.problem import Problem
from pipeline.problem.solution import Solution
from pipeline.program.transcription import transcribe
from pipeline.studies.study import Motions, Result


@dataclass(frozen=True)
class Certificate(Result):
    """planner_on_grid [J s]: the planner's cost on the grid of so many intervals. gap: the grid's own cost less that;
    its paths are feasible there, so a gap below zero would show a better motion than the planner's. grid_error: by how
    much the grid's cost may be too high.
    """

    name: ClassVar[str] = "certificate"
    planner_on_grid: float
    gap: float
    grid_error: float
    intervals: int

    @property
    def sentence(self) -> str:
        """The certificate for people."""
        verdict = "beyond the grid error: look closer"
        if 0 <= self.gap <= self.grid_error:
            verdict = "no better motion exists on this grid"
        if self.gap < 0:
            verdict = "the grid holds a better motion than the planner found"
        return (
            f"on {self.intervals} intervals the planner's best costs {self.planner_on_grid:.5g}, the dynamic "
            f"programming's {self.planner_on_grid + self.gap:.5g} with a grid error of {self.grid_error:.2g}: {verdict}"
        )

    def section(self) -> list[str]:
        return [f"Certificate: {self.sentence}."]


def study(motions: Motions) -> Certificate | None:
    """Where both methods were asked for and found a motion."""
    optimum, on_grid = motions.best("global"), motions.best("dynamic_programming")
    if optimum is None or on_grid is None:
        return None
    return certify(motions.problem, optimum.solution, on_grid.solution)


def certify(problem: Problem, optimum: Solution, grid_optimum: Solution) -> Certificate:
    """The planner's optimum carried to the knots of the dynamic programming, where both minimise the same sum."""
    times = grid_optimum.trajectory.time
    guess = CubicSpline(optimum.trajectory.time, optimum.trajectory.q)(times)
    q, outcome, _ = transcribe(replace(problem, times=times), times, guess).solve()
    cost = float(objective_values(problem, times, q[None])[0]) if outcome.converged else float("nan")
    gap = float(grid_optimum.statistics["cost"]) - cost
    return Certificate(cost, gap, float(grid_optimum.statistics["grid_error"]), len(times) - 1)
