"""Configurations on the self-motion manifold of the path's start, drawn at random (Global paper eq. (13))."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from pipeline.common.arrays import Array
from pipeline.common.errors import InputError
from pipeline.model.kinematics import wrap, wrap_angles
from pipeline.model.task import Task
from pipeline.problem.problem import Boundary, Problem
from pipeline.search.self_motion import CLOSED, close_gap, least_move


def starting_points(problem: Problem, count: int, rng: np.random.Generator, draw: str) -> Array:
    """The initial configurations (C, n) a boundary allows: q_init alone, or those spread by random self-motion."""
    if problem.boundary is Boundary.FIXED:
        return problem.q_init[None]
    arm, q_init = problem.task.arm, problem.q_init
    # Before the motion begins the base stands where it stands.
    nb = arm.base.count
    found = random_configurations(replace(problem.task, arm=arm.on_fixed_base), q_init[nb:], count, rng, draw)
    return np.hstack([np.tile(q_init[:nb], (len(found), 1)), found])


KINDS = ("normal", "latin_hypercube", "uniform")


def random_configurations(
    task: Task, q_init: Array, count: int, rng: np.random.Generator, kind: str = "normal"
) -> Array:
    """Distinct configurations (K, n), K <= count, that hold the task point of q_init (n,), the first. Any r >= 1.

    `normal`, `latin_hypercube`: self-motions q_init + int_0^1 (I - J+J) qd_p dt with random constant qd_p, of standard
    deviation pi or stratified in (-2 pi, 2 pi) [rad/s] (Global paper eq. (17)); they stay on the component of q_init.
    `uniform`: random joint angles, projected; they reach every component.
    """
    if kind not in KINDS:
        raise InputError(f"kind of initial configurations = {kind}: allowed are {', '.join(KINDS)}")
    n, revolute, steps = task.arm.n, task.arm.description.revolute, 40
    x = np.repeat(task.value(q_init[None]), count, axis=0)
    kept = wrap_angles(q_init, revolute)[None]
    for _ in range(5):
        q = np.repeat(q_init[None], count, axis=0)
        if kind == "uniform":
            q = rng.uniform(-np.pi, np.pi, size=(count, n))
        elif kind == "normal":
            velocity = rng.normal(scale=np.pi, size=(count, n))
        else:
            from scipy.stats import qmc  # takes a quarter of a second to import

            velocity = 2 * np.pi * (2 * qmc.LatinHypercube(n, rng=rng).random(count) - 1)
        for _ in range(0 if kind == "uniform" else steps):
            error, jacobian = task.error_and_jacobian(q, x)
            q += velocity / steps - least_move(jacobian, error + (jacobian @ velocity[:, :, None])[:, :, 0] / steps)
        q, on = close_gap(task, q, x, steps=30, tolerance=CLOSED)
        for candidate in wrap_angles(q[on], revolute):
            if len(kept) < count and (np.abs(wrap(kept - candidate, revolute)).max(axis=1) > 1e-3).all():
                kept = np.vstack([kept, candidate])
        if len(kept) == count:
            break
    return kept
