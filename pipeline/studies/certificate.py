"""Hold the planner's optimum against dynamic programming, which is global on its grid: a certificate (r = 1)."""

from __future__ import annotations

from dataclasses import replace

from scipy.interpolate import CubicSpline

from pipeline.problem.costs import objective_values
from pipeline.problem.problem import Problem
from pipeline.problem.solution import Solution, Status
from pipeline.program.transcription import transcribe


def certify(problem: Problem, optimum: Solution, grid_optimum: Solution) -> dict[str, float]:
    """The planner's optimum carried to the knots of the dynamic programming, where both minimise the same sum.

    planner_on_grid [J s]: its cost there. gap: the grid's cost less that; the grid's paths are feasible there, so a gap
    below zero would show a better motion than the planner's. grid_error: by how much the grid's cost may be too high.
    """
    times = grid_optimum.trajectory.time
    guess = CubicSpline(optimum.trajectory.time, optimum.trajectory.q)(times)
    q, outcome, _ = transcribe(replace(problem, times=times), times, guess).solve()
    cost = float(objective_values(problem, times, q[None])[0]) if outcome.converged else float("nan")
    grid_cost = float(grid_optimum.statistics["cost"])
    return {
        "planner_on_grid": cost,
        "gap": grid_cost - cost,
        "grid_error": float(grid_optimum.statistics["grid_error"]),
    }


def sentence(certificate: dict[str, float], intervals: int) -> str:
    """The certificate for people."""
    gap, error = certificate["gap"], certificate["grid_error"]
    verdict = "no better motion exists on this grid" if 0 <= gap <= error else "beyond the grid error: look closer"
    if gap < 0:
        verdict = "the grid holds a better motion than the planner found"
    return (
        f"on {intervals} intervals the planner's best costs {certificate['planner_on_grid']:.5g}, the dynamic programming's "
        f"{certificate['planner_on_grid'] + gap:.5g} with a grid error of {error:.2g}: {verdict}"
    )


def comparable(solutions: list[Solution]) -> tuple[Solution, Solution] | None:
    """The best optimum of both methods, where both were asked for and found one."""
    first = {solution.method: solution for solution in reversed(solutions) if solution.status is Status.SOLVED}
    if "global" in first and "dynamic_programming" in first:
        return first["global"], first["dynamic_programming"]
    return None
