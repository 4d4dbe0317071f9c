"""Steps 4 to 6 of PMKE's Table 1: the optimal knots of the next window, and the joint motion through them.

All guesses of a window are solved at once by Newton's method (`exact.py`); IPOPT solves the winner again where
`confirm` asks for it, and every guess where Newton's method does not serve the window or did not converge.
"""

from __future__ import annotations

import time as clock
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from scipy.interpolate import BSpline, make_interp_spline

from pipeline.common.arrays import Array
from pipeline.config.methods import PmkeOptions
from pipeline.methods.pmke import exact
from pipeline.methods.pmke.exact import ExactWindow
from pipeline.methods.pmke.prediction import path_weight, rollout, solve_window, window_objective
from pipeline.methods.pmke.window import Window
from pipeline.model.kinematics import project
from pipeline.problem.lagrangian import Lagrangian
from pipeline.problem.objective import Objective
from pipeline.problem.problem import Boundary, Problem
from pipeline.program import ipopt

SAMPLE = 10  # windows that confirm=last solves again, at least


@dataclass(frozen=True)
class Prediction:
    """The knots ahead (h, n), their objective, how they were found; apart [rad] from IPOPT's, where it was asked."""

    ahead: Array
    objective: float
    converged: bool
    status: str
    iterations: int
    solves: int
    solver_time: float
    apart: float | None = None


class Predictor:
    """Predictions of one problem, one after another. log: of each what run.json keeps."""

    def __init__(self, problem: Problem, options: PmkeOptions, *, alone: bool = False) -> None:
        """alone: Newton's method alone, as a control loop needs it: what it does not find is not sought otherwise."""
        self.problem, self.task, self.options, self.alone = problem, problem.task, options, alone
        duration = problem.reference.duration
        self.step = min(options.prediction_step, duration)
        self.horizon = max(1, min(options.horizon, int(duration / options.prediction_step + 1e-9)))
        self.objective = window_objective(problem, options.objective)
        self.lagrangian = Lagrangian(problem.task, self.objective)
        # The small programs know objectives of first order, and no momentum.
        self.lifted = options.objective == "torque" or bool(problem.task.arm.base.count)
        if not self.lagrangian.is_quadratic:
            self.lagrangian = Lagrangian(problem.task, Objective())
        self.why_not = "torques" if self.lifted else exact.why_not(self.lagrangian, self.horizon)
        self.exact = None if self.why_not else ExactWindow(self.lagrangian, self.horizon, self.step)
        self.program = None if self.lifted or alone else Window(self.lagrangian, self.horizon, self.step)
        self.times = self.step * np.arange(self.horizon + 1)
        self.degree = {"cubic": 3, "quartic": 4, "quintic": 5}[options.interpolation]
        self.spline = _splines(self.times, self.degree)
        self.previous: tuple[float, Array] | None = None
        self.solved: list[tuple[Array, Array, Array]] = []  # windows by Newton's method: q, x_ref, knots ahead
        self.log: list[dict[str, Any]] = []

    @property
    def span(self) -> float:
        """How far a prediction reaches [s]."""
        return float(self.times[-1])

    def __call__(self, now: float, q: Array, qd: Array, qdd: Array) -> BSpline | None:
        """The motion ahead from q, qd, qdd (n,) at `now` [s]; None: `alone`, and none was found."""
        begin, processor = clock.perf_counter(), clock.process_time()
        x_ref = self.problem.reference.position(now + self.times[1:])
        found = self._by_newton(now, q, x_ref)
        if found is None and not self.alone:
            found = self._by_ipopt(now, q, qd, x_ref)
        spline = None
        if found is not None:
            points = np.concatenate([q[None], found.ahead])
            self.previous = now, points
            spline = self._interpolate(now, points, qd, qdd)
        took, used = clock.perf_counter() - begin, clock.process_time() - processor
        found = found or Prediction(q[None], np.nan, False, "no guess converged", 0, 0, took)
        self.log.append(
            {
                "time": float(now),
                "wall_time_s": took,
                "processor_time_s": used,
                "solver_time_s": found.solver_time,
                "solves": found.solves,
                "iterations": found.iterations,
                "converged": found.converged,
                "status": found.status,
                "objective": found.objective,
                "apart_from_ipopt": found.apart,
            }
        )
        return spline

    def confirm(self) -> None:
        """confirm=last: a sample of the windows by IPOPT too, evenly spread over the motion."""
        if self.options.confirm != "last" or self.program is None:
            return
        own = [entry for entry in self.log if entry["status"] == "newton"]
        for i in np.unique(np.linspace(0, len(own) - 1, SAMPLE).round().astype(int)) if own else ():
            q, x_ref, ahead = self.solved[i]
            found = self.program.solve(q, x_ref, ahead, tolerance=self.options.tolerance)
            own[i]["apart_from_ipopt"] = float(np.abs(found[0] - ahead).max())

    def _by_newton(self, now: float, q: Array, x_ref: Array) -> Prediction | None:
        if self.exact is None:
            return None
        begin = clock.perf_counter()
        guesses = [self.exact.rollout(q, x_ref)]
        if self.previous is not None:
            guesses.append(self._held(now))  # Newton's first step takes it onto the path
        found = self.exact.solve(q, x_ref, np.array(guesses))
        if not found.converged.any():
            return None
        best = found.best
        ahead, value = found.q[best], float(found.cost[best])
        took = clock.perf_counter() - begin
        if self.program is None or self.options.confirm != "every":
            if self.options.confirm == "last":
                self.solved.append((q.copy(), x_ref, ahead))
            return Prediction(ahead, value, True, "newton", found.steps, len(guesses), took)
        sure, value, outcome, iterations = self.program.solve(q, x_ref, ahead, tolerance=self.options.tolerance)
        apart = float(np.abs(sure - ahead).max())
        solves, took = len(guesses) + 1, took + outcome.wall_time
        return Prediction(sure, value, outcome.converged, outcome.status, iterations, solves, took, apart)

    def _by_ipopt(self, now: float, q: Array, qd: Array, x_ref: Array) -> Prediction:
        """The best of all guesses, each by its own program."""
        results = [
            self._lifted(now, q, qd, guess)
            if self.program is None
            else self.program.solve(q, x_ref, guess, tolerance=self.options.tolerance)
            for guess in self._guesses(now, q, x_ref)
        ]
        best = min(results, key=lambda result: (not result[2].converged, result[1]))
        took = sum(result[2].wall_time for result in results)
        return Prediction(best[0], best[1], best[2].converged, best[2].status, best[3], len(results), took)

    def _lifted(self, now: float, q: Array, qd: Array, guess: Array) -> tuple[Array, float, ipopt.Outcome, int]:
        """The prediction by the planner's program: squared torques, whose accelerations tie it to the velocity qd that
        the arm has now, or a base that conserves momentum.
        """
        times = now + self.times
        window = replace(
            self.problem,
            q_init=q,
            qd_init=qd,
            boundary=Boundary.FIXED,
            objective=self.objective,
            limits=None,
            obstacles=None,
            own=None,
            times=times,
        )
        result = solve_window(window, times, np.vstack([q, guess]), self.options.tolerance)
        return result[0][1:], *result[1:]

    def _guesses(self, now: float, q: Array, x_ref: Array) -> list[Array]:
        """Start points: an inertia-weighted pseudoinverse roll-out, and the previous prediction moved on to now.

        A guess that repeats q can converge to a motion wound by 2 pi; neither of these does.
        """
        guesses = [rollout(self.problem, q, x_ref)]
        if self.previous is not None:
            # Beyond its end the previous motion is at rest: the last step onto the path carries it on.
            shifted = self._held(now)
            weight = path_weight(self.task.arm, shifted)
            moved, left = project(self.task, shifted, x_ref, weight, tolerance=1e-6)
            if np.all(left < 1e-3):
                guesses.append(moved)
        return guesses

    def _held(self, now: float) -> Array:
        """The previous prediction (h, n) at the knots of this one, at rest beyond its end."""
        assert self.previous is not None
        then, points = self.previous
        ahead = now - then + self.times[1:]
        return np.array([np.interp(ahead, self.times, column) for column in points.T]).T

    def _interpolate(self, now: float, points: Array, qd: Array, qdd: Array) -> BSpline:
        """Step 6: value, velocity (and acceleration) matched at the start, zero at the end."""
        knots, by_points, by_qd, by_qdd = self.spline
        coefficients = by_points @ points + by_qd[:, None] * qd
        if by_qdd is not None:
            coefficients += by_qdd[:, None] * qdd
        spline: BSpline = BSpline.construct_fast(now + knots, coefficients, self.degree)
        return spline


def _splines(times: Array, degree: int) -> tuple[Array, Array, Array, Array | None]:
    """The knots of the interpolating spline on `times` (h + 1,), and its coefficients by the points (C, h + 1), by the
    velocity and, for degrees 4 and 5, by the acceleration at the start (C,).
    """
    count = len(times)
    units = np.eye(count + 2)
    zero = np.zeros(count + 2)
    ends: tuple[Any, Any] = ([(1, units[count])], [(1, zero)])
    if degree > 3:
        ends = ([(1, units[count]), (2, units[count + 1])], [(1, zero), (2, zero)])
    knots = _quartic_knots(times) if degree == 4 else None
    spline = make_interp_spline(times, units[:count], k=degree, t=knots, bc_type=ends)
    by_points, by_qd, by_qdd = spline.c[:, :count], spline.c[:, count], spline.c[:, count + 1]
    return spline.t, by_points, by_qd, by_qdd if degree > 3 else None


def _quartic_knots(times: Array) -> Array:
    """Of the spline of degree 4 through points at times (h + 1,) that meets four end conditions more: (h + 10,).

    One knot inside for each interval, at the mean of four conditions' times in a row: de Boor, A Practical Guide to
    Splines, ch. XIII. For h = 2 these are 3/8 and 5/8 of the window, 0.75 and 1.25 s of the paper's 2 s.
    """
    conditions = np.concatenate([[times[0]] * 2, times, [times[-1]] * 2])
    inside = np.convolve(conditions[1:-1], np.full(4, 0.25), "valid")
    return np.concatenate([[times[0]] * 5, inside, [times[-1]] * 5])
