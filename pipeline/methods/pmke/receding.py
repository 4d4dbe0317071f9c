"""PMKE with limits: a receding horizon whose knots are executed as they are.

Every update interval the motion over the next h knots is optimised from the present position and velocity, within the
position, velocity, acceleration, jerk, torque and power limits and clear of the obstacles; its first knots are
executed, so that the executed motion keeps the limits at its knots. It begins at rest where the path does, and where
that is asked for it ends there (`linear.py`). A window that brings the arm too near to itself is solved again
with the rows that keep it off: few do. A few coarse knots carry the window on to the end of the path: a
horizon alone runs into dead ends, where the limits leave no way on.
Windows are solved on their stages (`stages.py`) from the plan before and its multipliers; IPOPT solves them, on the
planner's own lifted program, where the stages do not serve the objective, or where no plan is left, and checks a sample
of them after the motion.
Before anything moves the global planner makes a rough plan of the whole, from which the first window starts. If a later
window has no solution, the rest of the last plan is followed; when that is used up too, the method gives up and says
where.
"""

from __future__ import annotations

import time as clock
from collections.abc import Callable
from dataclasses import replace
from typing import Any, Literal

import numpy as np
from scipy.interpolate import make_interp_spline

from pipeline.common.arrays import Array
from pipeline.config.methods import GlobalOptions, RecedingOptions
from pipeline.methods.global_planner.apart import keeps_own, without_own
from pipeline.methods.global_planner.planner import global_planner
from pipeline.methods.method import ANY, Context, Method
from pipeline.methods.pmke.prediction import path_weight, rollout, solve_window, window_objective
from pipeline.methods.pmke.predictor import SAMPLE
from pipeline.methods.pmke.stages import Answer, Stages, why_not
from pipeline.methods.singularity import singular_value_ratio
from pipeline.model.clearance import Clearance
from pipeline.model.kinematics import project
from pipeline.problem.curve import whole
from pipeline.problem.limits import LIMIT_KINDS
from pipeline.problem.objective import Objective
from pipeline.problem.problem import Boundary, Problem
from pipeline.problem.solution import Solution, Status, Trajectory
from pipeline.program.feasibility import least_violation

TRACKING = 1e-6  # [m]


PLAN_INTERVALS = 24  # of the plan that is made before anything moves


ROUNDS = 6  # motions at most, until one keeps its limits between its knots


KEPT, MARGIN = 1e-7, 1e-3  # relative: excess that is none, and what is taken off beyond it


SMOOTH = {"acceleration": 2, "jerk": 3}  # orders of derivatives that are largest at a cubic spline's knots


FIRST_STARTS = (16, 48)  # of that plan: more if so many find no motion


def solve(problem: Problem, options: RecedingOptions, context: Context) -> list[Solution]:
    """From q_init on knots options.prediction_step apart. Statistics: one entry per update, as of `pmke`.

    The curve through the knots exceeds between them what their differences keep. By so much its limits of acceleration
    and jerk are made smaller, joint by joint, and the path is followed anew; where that does not lead to a curve that
    keeps them, the first motion is the answer.
    """
    first = solution = follow(problem, options)
    stricter, bounds = problem, problem.bounds
    for _ in range(ROUNDS if bounds.smooth else 0):
        if not solution.found:
            break
        found = whole(problem, solution.trajectory)
        reached = {kind: np.abs(found(solution.trajectory.time, order)).max(axis=0) for kind, order in SMOOTH.items()}
        beyond = {kind: most / getattr(bounds, kind) - 1 for kind, most in reached.items()}
        if max(float(excess.max()) for excess in beyond.values()) <= KEPT:
            return [at_rest(problem, solution)]
        limits = {
            kind: getattr(stricter.bounds, kind) / np.where(excess > KEPT, (1 + excess) * (1 + MARGIN), 1.0)
            for kind, excess in beyond.items()
        }
        stricter = replace(problem, limits=replace(bounds, **limits))
        solution = follow(stricter, options)
    return [first]


def at_rest(problem: Problem, solution: Solution) -> Solution:
    """The motion as the spline that keeps its limits from rest to rest, if that is what is asked; not within a limit of
    jerk, since it accelerates from its first moment on.
    """
    if not all(problem.rest) or np.isfinite(problem.bounds.jerk).any():
        return solution
    still = np.zeros((2, problem.task.arm.n))
    return replace(solution, trajectory=replace(solution.trajectory, ends=still))


def refuses(problem: Problem, options: RecedingOptions) -> str | None:
    """Rest is what limits of accelerations or jerks make of it, and these are served by the stages alone."""
    limited = np.isfinite(problem.bounds.acceleration) | np.isfinite(problem.bounds.jerk)
    if any(problem.rest) and not np.all(limited):
        return "the joints are to rest at an end, but not all accelerations are limited; method=global serves that"
    if not problem.bounds.smooth:
        return None
    why = _stages_why_not(problem, options)
    return why and f"limits of acceleration or jerk together with {why}; method=global serves both"


receding = Method("receding", "PMKE with limits", "#5B7FDB", RecedingOptions, ANY, solve, refuses)


def _stages_why_not(problem: Problem, options: RecedingOptions) -> str | None:
    intervals = max(1, round(problem.reference.duration / options.prediction_step))
    own = max(options.horizon, round(options.update_interval / options.prediction_step))
    asked = replace(problem, objective=window_objective(problem, options.objective))
    return why_not(asked, min(intervals, own + options.tail) * problem.task.arm.n)


def follow(problem: Problem, options: RecedingOptions) -> Solution:
    """One motion, window by window, that keeps its limits at its knots."""
    duration = problem.reference.duration
    count = max(1, round(duration / options.prediction_step))
    times = np.linspace(0.0, duration, count + 1)
    every = max(1, round(options.update_interval / (duration / count)))
    objective = window_objective(problem, options.objective)
    updates = _Updates(replace(problem, objective=objective, boundary=Boundary.FIXED), options)
    q = np.tile(problem.q_init, (count + 1, 1))
    plan, why = _first_plan(problem, objective)
    if plan is None:
        return _given_up(why, options, times, q[:1], [])
    planned = 0  # the last knot that there is a plan for
    for i in range(0, count, every):
        last = min(i + max(options.horizon, every), count)
        window = continued(updates.problem, times, q[: i + 1])
        window = replace(window, times=_knots(times, i, last, options.tail))
        found = updates(window, plan, alone=planned < min(i + every, count))
        if found is not None:
            plan, planned = _through(window.times, found), last
            q[i : last + 1] = found[: last + 1 - i]
        elif planned < min(i + every, count):
            return _given_up(_why(window), options, times, q[: i + 1], updates.log)
    updates.confirm()
    log = updates.log
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
    asked = replace(problem, times=times, objective=objective, boundary=Boundary.FIXED)
    # By differences as the windows are, unless accelerations or jerks are limited, of which those know nothing.
    form: Literal["differences"] | None = None if problem.bounds.smooth else "differences"
    for starts in FIRST_STARTS:
        options = GlobalOptions(transcription=form, optimised=starts, budget=starts, refine_to=None)
        first = global_planner(asked, options)[0]
        if first.found:
            return _through(first.trajectory.time, first.trajectory.q), ""
    return None, first.message


def continued(problem: Problem, times: Array, done: Array) -> Problem:
    """The problem from where done (i + 1, n), executed at the first of times, ends: with its velocity and acceleration
    by backward differences, as `linear.py` goes on from them.
    """
    if len(done) == 1:
        return problem
    dt = np.diff(times[: len(done)])[:, None]
    step = np.diff(done, axis=0) / dt
    first = np.zeros_like(step[:1]) if problem.reference.timing.at_rest else step[:1]
    change = np.diff(np.vstack([first, step]), axis=0) / dt
    return replace(problem, q_init=done[-1], qd_init=step[-1], qdd_init=change[-1])


def _knots(times: Array, first: int, last: int, tail: int) -> Array:
    """The knots first to last, and at most `tail` evenly spaced ones from there to the end of the path."""
    coarse = np.linspace(times[last], times[-1], min(tail, len(times) - 1 - last) + 1)[1:]
    return np.concatenate([times[first : last + 1], coarse])


def _through(times: Array, q: Array) -> Callable[[Array], Array]:
    return make_interp_spline(times, q, k=min(3, len(times) - 1))


class _Updates:
    """The windows of one motion, one after another. log: of each what run.json keeps."""

    def __init__(self, problem: Problem, options: RecedingOptions) -> None:
        self.problem, self.options = problem, options
        self.stages = None if _stages_why_not(problem, options) else Stages(without_own(problem))
        self.own = Clearance(problem.task.arm, None, problem.own) if keeps_own(problem) else None
        # Its program knows neither accelerations nor jerks: it would find another motion.
        self.ipopt = not problem.bounds.smooth
        self.before: Answer | None = None  # of the last window, where it was solved
        self.solved: list[tuple[int, Problem, Answer]] = []
        self.log: list[dict[str, Any]] = []

    def __call__(self, window: Problem, plan: Callable[[Array], Array], *, alone: bool) -> Array | None:
        """The motion found from the plan (U + 1, n), or None. alone: no plan is left to follow instead."""
        begin, processor = clock.perf_counter(), clock.process_time()
        found, entry = self._on_stages(window, plan)
        if self.ipopt and (self.stages is None or (found is None and alone)):
            found, entry = self._by_ipopt(window, plan)
        took, used = clock.perf_counter() - begin, clock.process_time() - processor
        common = {"time": float(window.times[0]), "wall_time_s": took, "processor_time_s": used}
        self.log.append({**common, "solver_time_s": took, **entry, "apart_from_ipopt": None})
        return found

    def confirm(self) -> None:
        """IPOPT from the answers of the windows that its check is asked for: how far it moves them."""
        which = {"every": len(self.solved), "last": SAMPLE, "none": 0}[self.options.confirm]
        for i in _spread(len(self.solved), which if self.ipopt else 0):
            place, window, answer = self.solved[i]
            q, _, outcome, _ = solve_window(window, window.times, answer.q, self.options.tolerance)
            if outcome.converged:
                self.log[place]["apart_from_ipopt"] = float(np.abs(q - answer.q).max())

    def _on_stages(self, window: Problem, plan: Callable[[Array], Array]) -> tuple[Array | None, dict[str, Any]]:
        if self.stages is None:
            return None, {}
        guess = np.vstack([window.q_init, plan(window.times[1:])])
        most, free = self.options.real_time_iterations, without_own(window)
        answer = self.stages.solve(free, guess, self.before, most)
        self.before = answer if answer.converged else None
        if self.own is None or not answer.converged or self.own.clear(answer.q[1:]).all():
            window = free
        else:
            answer = Stages(window).solve(window, guess, None, most)
        if answer.converged:
            self.solved.append((len(self.log), window, answer))
        entry = {
            "solves": 1,
            "iterations": answer.iterations,
            "converged": answer.converged,
            "status": answer.status,
            "objective": answer.cost,
        }
        return (answer.q if answer.converged else None), entry

    def _by_ipopt(self, window: Problem, plan: Callable[[Array], Array]) -> tuple[Array | None, dict[str, Any]]:
        """From the plan or else from a roll-out."""
        targets = window.reference.position(window.times[1:])
        ahead = plan(window.times[1:])
        moved, left = project(window.task, ahead, targets, path_weight(window.task.arm, ahead), tolerance=1e-9)
        guesses = [moved] if np.all(left < 1e-3) else []
        guesses.append(rollout(window, window.q_init, targets))
        results = []
        for guess in guesses:
            start = np.vstack([window.q_init, guess])
            results.append(solve_window(window, window.times, start, self.options.tolerance))
            if results[-1][2].converged:
                break  # the plan is followed on, not left for another optimum
        best = min(results, key=lambda result: (not result[2].converged, result[1]))
        entry = {
            "solver_time_s": sum(result[2].wall_time for result in results),
            "solves": len(results),
            "iterations": best[3],
            "converged": best[2].converged,
            "status": best[2].status,
            "objective": best[1],
        }
        return (best[0] if best[2].converged else None), entry


def _spread(count: int, most: int) -> list[int]:
    """At most so many of `count` places, evenly."""
    return sorted({round(place) for place in np.linspace(0, count - 1, min(most, count))})


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
