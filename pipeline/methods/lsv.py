"""LSV, the baseline: least-squares joint velocities qd = J+ xd, integrated in time (PMKE paper eq. (2), qd_0 = 0).

The paper prints J+ = (J'J)^-1 J'; the right inverse of a wide Jacobian is J+ = J'(J J')^-1, which is used here.
"""

from __future__ import annotations

import numpy as np

from pipeline.arrays import Array
from pipeline.config import LsvOptions
from pipeline.kinematics import SingularityWatch, pseudoinverse
from pipeline.problem import Problem, Solution, Trajectory


def solve(problem: Problem, options: LsvOptions = LsvOptions()) -> Solution:
    """Integrate from q_init with steps of options.dt; a singular configuration on the way is reported with its time."""
    task, reference = problem.task, problem.reference
    steps = max(1, round(reference.duration / options.dt))
    time = np.linspace(0.0, reference.duration, steps + 1)
    dt = reference.duration / steps
    x_ref, xd_ref, _ = reference.sample(time)
    watch = SingularityWatch(options.singular_value, options.max_drift)

    def velocity(i: int, jacobian: Array, correction: Array) -> Array:
        watch.see(time[i], jacobian)
        return np.asarray(pseudoinverse(jacobian) @ (xd_ref[i] + correction))

    q = np.empty((steps + 1, task.arm.n))
    q[0] = problem.q_init
    for i in range(steps):
        x, jacobian = task.value_and_jacobian(q[i][None])
        # Once per step: the predicted point below is off by more than the drift that is to be corrected.
        correction = options.gain * (x_ref[i] - x[0])
        slope = velocity(i, jacobian[0], correction)
        if options.integrator == "heun":
            ahead = task.jacobian((q[i] + dt * slope)[None])[0]
            slope = (slope + velocity(i + 1, ahead, correction)) / 2
        q[i + 1] = q[i] + dt * slope
    return watch.judge("lsv", Trajectory(time, q), {"steps": steps, "integrator": options.integrator})
