"""The maximum principle as the Pontryagin report prints it, integrated as it stands.

Eqs (21), (22), Euler steps from lambda(0) = 2 J+ xd, the transversality condition eq. (12) taken at the start. It is of
the end where q is free: with q(0) given, (I - J+J) lambda(T) = 0 and lambda(0) is unknown (`boundary_value.py`). The
report also adds k0 w to what it minimises, so that w is made small.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from pipeline.config.methods import PontryaginAsPrintedOptions
from pipeline.methods.method import Context, Method
from pipeline.methods.pontryagin.conditions import SERVES, rates, transversality
from pipeline.model.kinematics import pseudoinverse
from pipeline.problem.lagrangian import Lagrangian
from pipeline.problem.problem import Problem
from pipeline.problem.solution import Solution, Status, Trajectory


def solve(problem: Problem, options: PontryaginAsPrintedOptions, context: Context) -> list[Solution]:
    """Eqs (21), (22) from q_init with steps of options.dt, on those times."""
    objective = problem.objective
    if objective.secondary is not None:
        objective = replace(objective, secondary=replace(objective.secondary, k0=-objective.secondary.k0))
    lagrangian = Lagrangian(problem.task, objective)
    steps = max(1, round(problem.reference.duration / options.dt))
    time = np.linspace(0.0, problem.reference.duration, steps + 1)
    xd = problem.reference.sample(time)[1]
    q = np.empty((steps + 1, problem.task.arm.n))
    q[0] = problem.q_init
    start = pseudoinverse(problem.task.jacobian(q[:1])) @ xd[0]
    costate = (lagrangian.metric(q[:1]) @ start[:, :, None])[:, :, 0]
    for k in range(1, steps + 1):
        qd, slope = rates(lagrangian, xd[k : k + 1], q[k - 1 : k], costate)
        q[k], costate = q[k - 1] + (time[k] - time[k - 1]) * qd[0], costate + (time[k] - time[k - 1]) * slope
    gap = float(np.linalg.norm(problem.task.error(q[-1:], problem.reference.position(time[-1:]))))
    left = transversality(lagrangian, q[-1], costate[0])
    message = (
        f"solved as the report prints it: {gap:.3g} m off at the end, |(I - J+J) lambda(T)| = {left:.3g} instead of 0"
    )
    return [
        Solution(
            "pontryagin_as_printed",
            Trajectory(time, q),
            Status.SOLVED,
            message,
            tracking_tolerance=options.max_drift,
            grid="method.pontryagin_as_printed.dt",
            statistics={"steps": steps, "final_error": gap, "transversality_end": left},
        )
    ]


pontryagin_as_printed = Method(
    "pontryagin_as_printed", "Pontryagin, as printed", "#B7791F", PontryaginAsPrintedOptions, SERVES, solve
)
