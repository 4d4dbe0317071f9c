"""What both predictive methods share: the objective of a window, its solution on the lifted program, and its starts."""

from __future__ import annotations

import numpy as np

from pipeline.common.arrays import Array
from pipeline.model.arm import Arm
from pipeline.model.kinematics import project
from pipeline.problem.costs import objective_values
from pipeline.problem.objective import Objective
from pipeline.problem.problem import Problem
from pipeline.program import ipopt
from pipeline.program.transcription import transcribe

MOST_ITERATIONS = 120


def window_objective(problem: Problem, named: str) -> Objective:
    """What a window minimises: the problem's objective, or the one `named` kinetic_energy or torque."""
    return problem.objective if named == "problem" else Objective({named: 1.0})


def solve_window(
    problem: Problem, times: Array, guess: Array, tolerance: float
) -> tuple[Array, float, ipopt.Outcome, int]:
    """The motion of least objective from problem.q_init and qd_init over `times` (h + 1,), as the guess (h + 1, n)."""
    program = transcribe(problem, times, guess)
    q, outcome, iterations = program.solve(tolerance=tolerance, max_iterations=MOST_ITERATIONS)
    return q, float(objective_values(problem, times, q[None])[0]), outcome, iterations


def rollout(problem: Problem, q: Array, targets: Array) -> Array:
    """The inertia-weighted pseudoinverse's motion (K, n) from q (n,) through targets (K, m)."""
    rows, at = [], q[None]
    for target in targets:
        at, _ = project(problem.task, at, target[None], problem.task.arm.inverse_inertia(at), tolerance=1e-9)
        rows.append(at[0])
    return np.array(rows)


def path_weight(arm: Arm, q: Array) -> Array | None:
    """For `project` from q (K, n): least joint displacements, the base following them; None: it stands still."""
    joints = arm.n - arm.base.count
    return arm.lift(q, np.tile(np.eye(joints), (len(q), 1, 1))) if arm.base.count else None
