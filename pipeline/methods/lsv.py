"""The velocity-level baselines, integrated in time: least joint velocities and least instantaneous kinetic energy.

`lsv`: qd = J+ xd, least squares (PMKE paper eq. (2), qd_0 = 0). The paper prints J+ = (J'J)^-1 J'; the right inverse
of a wide Jacobian is J+ = J'(J J')^-1, which is used here.
`inertia_weighted`: qd = M^-1 J'(J M^-1 J')^-1 xd, least qd'M qd at every instant (Whitney 1969; Global paper eq. (10)).
On a floating base J is the generalized Jacobian and M the reduced inertia (`floating.py`).
"""

from __future__ import annotations

from functools import partial

import numpy as np

from pipeline.common.arrays import Array
from pipeline.config.methods import LsvOptions
from pipeline.methods.correction import diverges
from pipeline.methods.method import ANY, Context, Method
from pipeline.methods.singularity import SingularityWatch, lost
from pipeline.model.kinematics import least_velocity
from pipeline.problem.problem import Problem
from pipeline.problem.solution import Solution, Trajectory


def solve(problem: Problem, options: LsvOptions, context: Context) -> list[Solution]:
    """Integrate the least-squares velocities from q_init; a singular configuration on the way is told with its time."""
    return [_integrate("lsv", problem, options, weighted=False)]


def solve_weighted(problem: Problem, options: LsvOptions, context: Context) -> list[Solution]:
    """The same with the velocities of least kinetic energy."""
    return [_integrate("inertia_weighted", problem, options, weighted=True)]


lsv = Method("lsv", "LSV", "#D9601A", LsvOptions, ANY, solve, partial(diverges, "lsv"))
inertia_weighted = Method(
    "inertia_weighted",
    "Inertia-weighted",
    "#0E7490",
    LsvOptions,
    ANY,
    solve_weighted,
    partial(diverges, "inertia_weighted"),
)


def _integrate(method: str, problem: Problem, options: LsvOptions, *, weighted: bool) -> Solution:
    """From q_init with steps of options.dt."""
    task, reference = problem.task, problem.reference
    steps = max(1, round(reference.duration / options.dt))
    time = np.linspace(0.0, reference.duration, steps + 1)
    dt = reference.duration / steps
    x_ref, xd_ref, _ = reference.sample(time)
    watch = SingularityWatch(options.singular_value, options.max_drift)

    def velocity(i: int, q: Array, jacobian: Array, correction: Array) -> Array:
        watch.see(time[i], jacobian @ task.arm.motion_map(q[None])[0])
        inverse = least_velocity(task.arm, q[None], jacobian[None], weighted=weighted)[0]
        drift = task.arm.follow(q[None], np.zeros_like(q[None]))[0]  # of a base that has momentum
        return np.asarray(
            inverse @ (task.velocity(q[None], xd_ref[i : i + 1])[0] + correction - jacobian @ drift) + drift
        )

    q = np.empty((steps + 1, task.arm.n))
    q[0] = problem.q_init
    for i in range(steps):
        error, jacobian = task.error_and_jacobian(q[i : i + 1], x_ref[i : i + 1])
        # Once per step: the predicted point below is off by more than the drift that is to be corrected.
        correction = -options.gain * error[0]
        slope = velocity(i, q[i], jacobian[0], correction)
        if options.integrator == "heun":
            ahead = q[i] + dt * slope
            if lost(ahead):
                return watch.lost(method, time, problem.q_init, i + 1)
            slope = (slope + velocity(i + 1, ahead, task.jacobian(ahead[None])[0], correction)) / 2
        q[i + 1] = q[i] + dt * slope
        if lost(q[i + 1]):
            return watch.lost(method, time, problem.q_init, i + 1)
    return watch.judge(method, Trajectory(time, q), {"steps": steps, "integrator": options.integrator})
