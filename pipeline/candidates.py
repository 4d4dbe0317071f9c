"""Starts for the global planner: a population of weighted-pseudoinverse motions, ranked, and the sorting of optima.

Global paper Section 3: qd = W^-1 J'(J W^-1 J')^-1 xd with random symmetric positive definite W (eqs (9)-(11)).
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from pipeline.arrays import Array
from pipeline.kinematics import project
from pipeline.problem import Problem


def random_inverse_weights(rng: np.random.Generator, count: int, n: int) -> Array:
    """(count, n, n) inverses of random SPD weights: eigenvalues of W uniform in (0, 1], eigenvectors uniform rotations."""
    basis, triangle = np.linalg.qr(rng.normal(size=(count, n, n)))
    basis = basis * np.sign(np.diagonal(triangle, axis1=1, axis2=2))[:, None, :]
    eigenvalues = 1.0 - rng.random((count, n))
    return np.asarray(np.einsum("kij,kj,klj->kil", basis, 1.0 / np.maximum(eigenvalues, 1e-3), basis))


def population(problem: Problem, times: Array, count: int, rng: np.random.Generator) -> Array:
    """Joint motions (K, N + 1, n) from q_init that stay on the path at every knot; K <= count, failures are left out.

    The first two are the plain and the inertia-weighted pseudoinverse, the others have random constant weights.
    """
    arm = problem.task.arm
    constant = random_inverse_weights(rng, max(0, count - 2), arm.n)
    x_ref = problem.reference.position(times)
    motions = np.empty((count, len(times), arm.n))
    motions[:, 0] = problem.q_init
    alive = np.ones(count, dtype=bool)
    for i in range(1, len(times)):
        inertia = np.linalg.inv(arm.mass_matrix(motions[1:2, i - 1]))
        weights = np.concatenate([np.eye(arm.n)[None], inertia, constant])[:count]
        target = np.tile(x_ref[i], (count, 1))
        motions[:, i], error = project(
            problem.task, motions[:, i - 1], target, weights, tolerance=1e-9, max_iterations=12
        )
        alive &= error < 1e-6
    return motions[alive]


def kinetic_energy_integrals(problem: Problem, times: Array, motions: Array) -> Array:
    """Cost (K,) [J s] of each motion (K, N + 1, n), backward differences."""
    dt = np.diff(times)
    velocity = np.diff(motions, axis=1) / dt[:, None]
    count, intervals, n = velocity.shape
    energy = problem.task.arm.kinetic_energy(motions[:, 1:].reshape(-1, n), velocity.reshape(-1, n))
    return np.asarray(energy.reshape(count, intervals) @ dt)


def path_distance(a: Array, b: Array, revolute: NDArray[np.bool_]) -> float:
    """Largest joint difference [rad] between two motions (N + 1, n) on the same knots, full turns not counted."""
    gap = a - b
    wrapped = np.where(revolute, (gap + np.pi) % (2 * np.pi) - np.pi, gap)
    return float(np.abs(wrapped).max())


def distinct(motions: Array, costs: Array, most: int, same: float, revolute: NDArray[np.bool_]) -> list[int]:
    """Indices of the cheapest motions, best first, no two closer than `same` [rad]; at most `most`."""
    kept: list[int] = []
    for index in np.argsort(costs, kind="stable"):
        if len(kept) == most:
            break
        if all(path_distance(motions[index], motions[other], revolute) > same for other in kept):
            kept.append(int(index))
    return kept
