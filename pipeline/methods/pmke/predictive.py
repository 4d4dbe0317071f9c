"""PMKE, predictive minimisation of kinetic energy (PMKE paper, Table 1): look h steps ahead, follow in the null space.

Every update interval I the kinetic-energy integral over the next h knots, Delta T apart, is minimised (eq. (4)); the
pseudoinverse follows the path while the null space follows the predicted joint motion (eq. (2), step 7). An objective
of other terms of first order (`problem/lagrangian.py`) takes the kinetic energy's place, and squared torques if asked
for.
Limits and obstacles are not seen: `receding.py` is for them.
"""

from __future__ import annotations

import numpy as np
from scipy.interpolate import BSpline

from pipeline.common.arrays import Array
from pipeline.config.methods import PmkeOptions
from pipeline.methods.correction import diverges
from pipeline.methods.method import ANY, Context, Method
from pipeline.methods.pmke.prediction import path_weight
from pipeline.methods.pmke.predictor import Predictor
from pipeline.methods.singularity import SingularityWatch, lost
from pipeline.model.kinematics import least_velocity, project
from pipeline.model.task import Task
from pipeline.problem.problem import Problem
from pipeline.problem.solution import Solution, Status, Trajectory

ON_PATH = 1e-9  # [m, rad] from the path where every step is projected onto it


def solve(problem: Problem, options: PmkeOptions, context: Context) -> list[Solution]:
    """Steps 1-10 of Table 1 from q_init. Statistics: one entry per prediction, time, wall time, iterations, status."""
    return [_follow(problem, options)]


def refuses(problem: Problem, options: PmkeOptions) -> str | None:
    """Options that do not go together."""
    if options.project and options.gain:
        return "method.pmke.gain corrects an error that method.pmke.project leaves none of; ask for one of them"
    return diverges("pmke", problem, options)


pmke = Method("pmke", "PMKE", "#2B6CB0", PmkeOptions, ANY, solve, refuses)


def velocity(task: Task, q: Array, error: Array, jacobian: Array, rate: Array, toward: Array, gain: float) -> Array:
    """Step 7, eq. (2): the velocity (n,) that follows the path, and in the null space the velocity `toward` (n,).

    error (m,), jacobian (m, n) at q (n,); rate: the target's. gain [1/s]: how fast the error is corrected.
    """
    arm = task.arm
    inverse = least_velocity(arm, q[None], jacobian[None])[0]
    command = task.velocity(q[None], rate[None])[0] - gain * error
    led = arm.follow(q[None], toward[None])[0]
    return np.asarray(inverse @ (command - jacobian @ led) + led)


def _follow(problem: Problem, options: PmkeOptions) -> Solution:
    task, reference, arm = problem.task, problem.reference, problem.task.arm
    dt, duration = options.dt, reference.duration
    steps = max(1, round(duration / dt))
    time = np.linspace(0.0, duration, steps + 1)
    dt = duration / steps
    update = max(1, round(options.update_interval / dt))

    predictor = Predictor(problem, options)
    watch = SingularityWatch(options.singular_value, 10 * ON_PATH if options.project else options.max_drift)
    x_ref, xd_ref, _ = reference.sample(time)
    q, qd = np.empty((steps + 1, arm.n)), np.zeros((steps + 1, arm.n))
    q[0] = problem.q_init
    prediction: BSpline | None = None
    for i in range(1, steps + 1):
        now, here = time[i - 1], q[i - 1]
        # Steps 4-6, repeated every I (8) until only T_p is left (9); the rest follows the last prediction (10).
        if prediction is None or ((i - 1) % update == 0 and now + predictor.span <= duration + 1e-9):
            acceleration = (qd[i - 1] - qd[i - 2]) / dt if i > 1 else np.zeros(arm.n)
            prediction = predictor(now, here, qd[i - 1], acceleration)
            assert prediction is not None
        error, jacobian = task.error_and_jacobian(here[None], x_ref[i - 1][None])
        watch.see(now, jacobian[0] @ arm.motion_map(here[None])[0])
        toward = (prediction(min(time[i], prediction.t[-1])) - here) / dt
        q[i] = here + dt * velocity(task, here, error[0], jacobian[0], xd_ref[i], toward, options.gain)
        if options.project:
            q[i] = project(task, q[i][None], x_ref[i][None], path_weight(arm, q[i][None]), tolerance=ON_PATH)[0][0]
        qd[i] = (q[i] - here) / dt
        if lost(q[i]):
            return watch.lost("pmke", time, problem.q_init, i)
    predictor.confirm()
    statistics = {
        "steps": steps,
        "horizon": predictor.horizon,
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
