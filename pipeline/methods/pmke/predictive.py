"""PMKE, predictive minimisation of kinetic energy (PMKE paper, Table 1): look h steps ahead, follow in the null space.

Every update interval I the kinetic-energy integral over the next h knots, Delta T apart, is minimised (eq. (4)); the
pseudoinverse follows the path while the null space follows the predicted joint motion (eq. (2), step 7). An objective
of other terms of first order (`problem/lagrangian.py`) takes the kinetic energy's place, and squared torques if asked
for.
Limits and obstacles are not seen: `receding.py` is for them.
"""

from __future__ import annotations

import time as clock
from dataclasses import replace
from functools import partial
from typing import Any

import numpy as np
from scipy.interpolate import BSpline, make_interp_spline

from pipeline.common.arrays import Array
from pipeline.config.methods import PmkeOptions
from pipeline.methods.correction import diverges
from pipeline.methods.method import ANY, Context, Method
from pipeline.methods.pmke.prediction import path_weight, rollout, solve_window, window_objective
from pipeline.methods.pmke.window import Window
from pipeline.methods.singularity import SingularityWatch, lost
from pipeline.model.kinematics import least_velocity, project
from pipeline.problem.lagrangian import Lagrangian
from pipeline.problem.objective import Objective
from pipeline.problem.problem import Boundary, Problem
from pipeline.problem.solution import Solution, Status, Trajectory
from pipeline.program import ipopt


def solve(problem: Problem, options: PmkeOptions, context: Context) -> list[Solution]:
    """Steps 1-10 of Table 1 from q_init. Statistics: one entry per prediction, time, wall time, iterations, status."""
    return [_follow(problem, options)]


pmke = Method("pmke", "PMKE", "#2B6CB0", PmkeOptions, ANY, solve, partial(diverges, "pmke"))


def _follow(problem: Problem, options: PmkeOptions) -> Solution:
    task, reference, arm = problem.task, problem.reference, problem.task.arm
    dt, duration = options.dt, reference.duration
    steps = max(1, round(duration / dt))
    time = np.linspace(0.0, duration, steps + 1)
    dt = duration / steps
    horizon = _fitting_horizon(options, duration)
    window = horizon * options.prediction_step
    update = max(1, round(options.update_interval / dt))

    predictor = _Predictor(problem, options, horizon)
    watch = SingularityWatch(options.singular_value, options.max_drift)
    x_ref, xd_ref, _ = reference.sample(time)
    q, qd = np.empty((steps + 1, arm.n)), np.zeros((steps + 1, arm.n))
    q[0] = problem.q_init
    prediction: BSpline | None = None
    for i in range(1, steps + 1):
        now = time[i - 1]
        # Steps 4-6, repeated every I (8) until only T_p is left (9); the rest follows the last prediction (10).
        if prediction is None or ((i - 1) % update == 0 and now + window <= duration + 1e-9):
            acceleration = (qd[i - 1] - qd[i - 2]) / dt if i > 1 else np.zeros(arm.n)
            prediction = predictor(now, q[i - 1], qd[i - 1], acceleration)
        error, jacobian = task.error_and_jacobian(q[i - 1][None], x_ref[i - 1][None])
        inverse = least_velocity(arm, q[i - 1][None], jacobian)[0]
        watch.see(now, jacobian[0] @ arm.motion_map(q[i - 1][None])[0])
        # Step 7, eq. (2): follow the path, and in the null space the prediction.
        command = task.velocity(q[i - 1][None], xd_ref[i][None])[0] - options.gain * error[0]
        toward = arm.follow(q[i - 1][None], (prediction(min(time[i], prediction.t[-1])) - q[i - 1])[None] / dt)[0]
        qd[i] = inverse @ command + toward - inverse @ (jacobian[0] @ toward)
        q[i] = q[i - 1] + dt * qd[i]
        if lost(q[i]):
            return watch.lost("pmke", time, problem.q_init, i)
    statistics = {
        "steps": steps,
        "horizon": horizon,
        "update_interval": update * dt,
        "predictions": predictor.log,
    }
    solution = watch.judge("pmke", Trajectory(time, q), statistics)
    failed = [entry for entry in predictor.log if not entry["converged"]]
    if failed and solution.status is Status.SOLVED:
        message = (
            f"{len(failed)} of {len(predictor.log)} predictions did not converge, the first at "
            f"t = {failed[0]['time']:.2f} s ({failed[0]['status']})"
        )
        return Solution("pmke", solution.trajectory, Status.NOT_CONVERGED, message, statistics=statistics)
    return solution


def _fitting_horizon(options: PmkeOptions, duration: float) -> int:
    """h, or fewer if the window would outlast the motion."""
    return max(1, min(options.horizon, int(duration / options.prediction_step + 1e-9)))


class _Predictor:
    """Steps 4 to 6: the optimal knots of the next window, and the joint motion through them."""

    def __init__(self, problem: Problem, options: PmkeOptions, horizon: int) -> None:
        self.task, self.reference, self.options, self.horizon = problem.task, problem.reference, options, horizon
        self.step = min(options.prediction_step, problem.reference.duration)
        self.objective = window_objective(problem, options.objective)
        lagrangian = Lagrangian(problem.task, self.objective)
        # The small program knows objectives of first order, and no momentum.
        self.lifted = options.objective == "torque" or bool(problem.task.arm.base.count)
        if not lagrangian.is_quadratic:
            lagrangian = Lagrangian(problem.task, Objective())
        self.program = None if self.lifted else Window(lagrangian, horizon, self.step)
        self.problem = problem
        self.previous: tuple[Array, Array] | None = None
        self.log: list[dict[str, Any]] = []

    def __call__(self, now: float, q: Array, qd: Array, qdd: Array) -> BSpline:
        begin = clock.perf_counter()
        knots = now + self.step * np.arange(1, self.horizon + 1)
        x_ref = self.reference.position(knots)
        results = [
            self._lifted(now, knots, q, qd, guess)
            if self.program is None
            else self.program.solve(q, x_ref, guess, tolerance=self.options.tolerance)
            for guess in self._guesses(q, x_ref, knots)
        ]
        best = min(results, key=lambda result: (not result[2].converged, result[1]))
        ahead, value, outcome, iterations = best
        times = np.concatenate([[now], knots])
        points = np.vstack([q, ahead])
        self.previous = times, points
        spline = self._interpolate(times, points, qd, qdd)
        self.log.append(
            {
                "time": float(now),
                "wall_time_s": clock.perf_counter() - begin,
                "solver_time_s": sum(result[2].wall_time for result in results),
                "solves": len(results),
                "iterations": iterations,
                "converged": outcome.converged,
                "status": outcome.status,
                "objective": value,
            }
        )
        return spline

    def _lifted(
        self, now: float, knots: Array, q: Array, qd: Array, guess: Array
    ) -> tuple[Array, float, ipopt.Outcome, int]:
        """The prediction by the planner's program: squared torques, whose accelerations tie it to the velocity qd that
        the arm has now, or a base that conserves momentum.
        """
        times = np.concatenate([[now], knots])
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

    def _guesses(self, q: Array, x_ref: Array, knots: Array) -> list[Array]:
        """Start points: an inertia-weighted pseudoinverse roll-out, and the previous prediction moved on to now.

        A guess that repeats q can converge to a motion wound by 2 pi; neither of these does.
        """
        guesses = [rollout(self.problem, q, x_ref)]
        if self.previous is not None:
            times, points = self.previous
            # Beyond its end the previous motion is at rest: the last roll-out step carries it on.
            shifted = np.array([np.interp(knots, times, column) for column in points.T]).T
            weight = path_weight(self.task.arm, shifted)
            moved, left = project(self.task, shifted, x_ref, weight, tolerance=1e-6)
            if np.all(left < 1e-3):
                guesses.append(moved)
        return guesses

    def _interpolate(self, times: Array, points: Array, qd: Array, qdd: Array) -> BSpline:
        """Step 6: value, velocity (and acceleration) matched at the start, zero at the end."""
        zero = np.zeros_like(qd)
        if self.options.interpolation == "cubic":
            return make_interp_spline(times, points, k=3, bc_type=([(1, qd)], [(1, zero)]))
        ends: tuple[Any, Any] = ([(1, qd), (2, qdd)], [(1, zero), (2, zero)])
        if self.options.interpolation == "quintic":
            return make_interp_spline(times, points, k=5, bc_type=ends)
        return make_interp_spline(times, points, k=4, t=_quartic_knots(times), bc_type=ends)


def _quartic_knots(times: Array) -> Array:
    """Of the spline of degree 4 through points at times (h + 1,) that meets four end conditions more: (h + 10,).

    One knot inside for each interval, at the mean of four conditions' times in a row: de Boor, A Practical Guide to
    Splines, ch. XIII. For h = 2 these are 3/8 and 5/8 of the window, 0.75 and 1.25 s of the paper's 2 s.
    """
    conditions = np.concatenate([[times[0]] * 2, times, [times[-1]] * 2])
    inside = np.convolve(conditions[1:-1], np.full(4, 0.25), "valid")
    return np.concatenate([[times[0]] * 5, inside, [times[-1]] * 5])
