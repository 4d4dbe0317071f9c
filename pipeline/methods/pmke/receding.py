"""PMKE with limits, for any first-order or torque objective: a receding horizon on the planner's own lifted program.

Every update interval the motion over the next h knots is optimised from the present position and velocity, within the
position, velocity, torque and power limits and clear of the obstacles (`program/`); its first knots are
executed as they are, so that the executed motion keeps the limits at its knots. A few coarse knots carry the window on
to the end of the path: a horizon alone runs into dead ends, where the limits leave no way on.
Before anything moves the global planner makes a rough plan of the whole, from which the first window starts. If a later
window has no solution, the rest of the last plan is followed; when that is used up too, the method gives up and says
where.
"""

from __future__ import annotations

import time as clock
from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np
from scipy.interpolate import make_interp_spline

from pipeline.common.arrays import Array
from pipeline.config.methods import GlobalOptions, RecedingOptions
from pipeline.methods.global_planner.planner import global_planner
from pipeline.methods.method import ON_KNOTS, Context, Method
from pipeline.methods.pmke.prediction import path_weight, rollout, solve_window, window_objective
from pipeline.methods.singularity import singular_value_ratio
from pipeline.model.kinematics import project
from pipeline.problem.limits import LIMIT_KINDS
from pipeline.problem.objective import Objective
from pipeline.problem.problem import Boundary, Problem
from pipeline.problem.solution import Solution, Status, Trajectory
from pipeline.program.feasibility import least_violation

TRACKING = 1e-6  # [m]


PLAN_INTERVALS = 24  # of the plan that is made before anything moves


FIRST_STARTS = (16, 48)  # of that plan: more if so many find no motion


def solve(problem: Problem, options: RecedingOptions, context: Context) -> list[Solution]:
    """From q_init on knots options.prediction_step apart. Statistics: one entry per update, as of `pmke`."""
    return [_follow(problem, options)]


receding = Method("receding", "PMKE with limits", "#5B7FDB", RecedingOptions, ON_KNOTS, solve)


def _follow(problem: Problem, options: RecedingOptions) -> Solution:
    duration = problem.reference.duration
    count = max(1, round(duration / options.prediction_step))
    times = np.linspace(0.0, duration, count + 1)
    every = max(1, round(options.update_interval / (duration / count)))
    objective = window_objective(problem, options.objective)
    q = np.tile(problem.q_init, (count + 1, 1))
    plan, why_not = _first_plan(problem, objective)
    if plan is None:
        return _given_up(why_not, options, times, q[:1], [])
    planned = 0  # the last knot that there is a plan for
    log: list[dict[str, Any]] = []
    for i in range(0, count, every):
        last = min(i + max(options.horizon, every), count)
        ahead = _knots(times, i, last, options.tail)
        window = replace(
            problem,
            q_init=q[i],
            qd_init=None if i == 0 else (q[i] - q[i - 1]) / (times[i] - times[i - 1]),
            times=ahead,
            boundary=Boundary.FIXED,
            objective=objective,
        )
        found, entry = _update(window, plan, options)
        log.append(entry)
        if found is not None:
            plan, planned = _through(ahead, found), last
            q[i : last + 1] = found[: last + 1 - i]
        elif planned < min(i + every, count):
            return _given_up(_why(window), options, times, q[: i + 1], log)
    failed = sum(not entry["converged"] for entry in log)
    message = f"{failed} of {len(log)} windows were not solved: the plan before was followed there" if failed else ""
    statistics = {
        "steps": count,
        "horizon": options.horizon,
        "update_interval": every * duration / count,
        "predictions": log,
        "smallest_singular_value_ratio": float(singular_value_ratio(problem.task.jacobian(q)).min()),
    }
    return Solution(
        "receding",
        Trajectory(times, q),
        Status.SOLVED,
        message,
        tracking_tolerance=TRACKING,
        limits_kept=LIMIT_KINDS,
        grid="method.receding.prediction_step",
        statistics=statistics,
    )


def _first_plan(problem: Problem, objective: Objective) -> tuple[Callable[[Array], Array] | None, str]:
    """The whole motion on a coarse grid, as the global planner finds it; or None, and why there is none."""
    times = np.linspace(0.0, problem.reference.duration, PLAN_INTERVALS + 1)
    whole = replace(problem, times=times, objective=objective, boundary=Boundary.FIXED)
    for starts in FIRST_STARTS:
        first = global_planner(
            whole, GlobalOptions(transcription="differences", optimised=starts, budget=starts, refine_to=None)
        )[0]
        if first.found:
            return _through(times, first.trajectory.q), ""
    return None, first.message


def _knots(times: Array, first: int, last: int, tail: int) -> Array:
    """The knots first to last, and at most `tail` evenly spaced ones from there to the end of the path."""
    coarse = np.linspace(times[last], times[-1], min(tail, len(times) - 1 - last) + 1)[1:]
    return np.concatenate([times[first : last + 1], coarse])


def _through(times: Array, q: Array) -> Callable[[Array], Array]:
    return make_interp_spline(times, q, k=min(3, len(times) - 1))


def _update(
    window: Problem, plan: Callable[[Array], Array], options: RecedingOptions
) -> tuple[Array | None, dict[str, Any]]:
    """One window: the motion found from the plan, or else from a roll-out, or None; and what is known of the update."""
    begin = clock.perf_counter()
    targets = window.reference.position(window.times[1:])
    ahead = plan(window.times[1:])
    moved, left = project(window.task, ahead, targets, path_weight(window.task.arm, ahead), tolerance=1e-9)
    guesses = [moved] if np.all(left < 1e-3) else []
    guesses.append(rollout(window, window.q_init, targets))
    results = []
    for guess in guesses:
        results.append(solve_window(window, window.times, np.vstack([window.q_init, guess]), options.tolerance))
        if results[-1][2].converged:
            break  # the plan is followed on, not left for another optimum
    best = min(results, key=lambda result: (not result[2].converged, result[1]))
    entry = {
        "time": float(window.times[0]),
        "wall_time_s": clock.perf_counter() - begin,
        "solver_time_s": sum(result[2].wall_time for result in results),
        "solves": len(results),
        "iterations": best[3],
        "converged": best[2].converged,
        "status": best[2].status,
        "objective": best[1],
    }
    return (best[0] if best[2].converged else None), entry


def _given_up(message: str, options: RecedingOptions, times: Array, done: Array, log: list[dict[str, Any]]) -> Solution:
    q = np.vstack([done, np.tile(done[-1], (len(times) - len(done), 1))])
    statistics = {"predictions": log, "update_interval": options.update_interval}
    return Solution("receding", Trajectory(times, q), Status.INFEASIBLE, message, statistics=statistics, found=False)


def _why(window: Problem) -> str:
    """The limit that a window's motion was not found to keep."""
    targets = window.reference.position(window.times[1:])
    guess = np.vstack([window.q_init, rollout(window, window.q_init, targets)])
    relaxed = least_violation(window, window.times, [guess]) if window.constrained else None
    why = "" if relaxed is None or relaxed.feasible else f": {relaxed.sentence}"
    return f"no solution was found for the window from t = {window.times[0]:.3g} s on, and no plan is left{why}"
