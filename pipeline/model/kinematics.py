"""Velocity-level building blocks that several methods share: pseudoinverses, path projection, singularities."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from pipeline.common.arrays import Array
from pipeline.common.errors import PathError
from pipeline.model.arm import Arm
from pipeline.model.task import Task

ATTEMPTS = 12  # configurations that a target is sought from before it counts as out of reach


def pseudoinverse(jacobian: Array) -> Array:
    """J+ (..., n, m) of J (..., m, n): the least-squares right inverse J'(J J')^-1, by singular values."""
    return np.linalg.pinv(jacobian, rcond=1e-12)


def weighted_pseudoinverse(jacobian: Array, inverse_weight: Array) -> Array:
    """W^-1 J'(J W^-1 J')^-1 (..., n, m): least qd'W qd (Global paper eq. (10); Whitney 1969)."""
    right = inverse_weight @ np.swapaxes(jacobian, -1, -2)
    # The pseudoinverse of the inner matrix lets an exactly singular configuration pass.
    return np.asarray(right @ np.linalg.pinv(jacobian @ right, rcond=1e-12, hermitian=True))


def least_velocity(arm: Arm, q: Array, jacobian: Array, *, weighted: bool = False) -> Array:
    """J+ (K, n, m), or the inertia-weighted inverse, for J (K, m, n) at q (K, n); on a floating base of the generalized
    Jacobian: B (J B)+, so that the base follows the joints (`floating.py`).
    """
    if weighted:
        return weighted_pseudoinverse(jacobian, arm.inverse_inertia(q))
    spread = arm.motion_map(q)
    return np.asarray(spread @ pseudoinverse(jacobian @ spread))


def wrap(difference: Array, revolute: NDArray[np.bool_]) -> Array:
    """Joint differences (..., n) with full turns of the turning joints taken off: at most half a turn remains."""
    return difference - np.where(revolute, 2 * np.pi, 0.0) * np.rint(difference / (2 * np.pi))


def wrap_angles(q: Array, revolute: NDArray[np.bool_]) -> Array:
    """Configurations (..., n) with their turning joints in (-pi, pi]."""
    return q - np.where(revolute, 2 * np.pi, 0.0) * np.ceil((q - np.pi) / (2 * np.pi))


def project(
    task: Task,
    q: Array,
    x_ref: Array,
    inverse_weight: Array | None = None,
    *,
    tolerance: float = 1e-12,
    max_iterations: int = 30,
) -> tuple[Array, Array]:
    """Move each q (K, n) onto its target x_ref (K, m) by Newton steps; returns q and the distance left (K,) [m, rad].

    `inverse_weight` (K, n, n) shapes the steps (see weighted_pseudoinverse); None: least joint displacement.
    """
    q = q.copy()
    error = np.full(len(q), np.inf)
    rows = np.arange(len(q))  # those that are not there yet
    for _ in range(max_iterations):
        gap, jacobian = task.error_and_jacobian(q[rows], x_ref[rows])
        error[rows] = np.sqrt((gap * gap).sum(axis=1))
        far = error[rows] > tolerance
        rows, gap, jacobian = rows[far], gap[far], jacobian[far]
        if not rows.size:
            break
        if inverse_weight is None:
            inverse = pseudoinverse(jacobian)
        else:
            inverse = weighted_pseudoinverse(jacobian, inverse_weight[rows])
        step = -(inverse @ gap[:, :, None])[:, :, 0]
        # Near a singular configuration a Newton step can be arbitrarily long; half a radian is far on any arm.
        size = np.sqrt((step * step).sum(axis=1, keepdims=True))
        q[rows] += step * np.minimum(1.0, 0.5 / np.maximum(size, 1e-300))
    else:
        error[rows] = np.linalg.norm(task.error(q[rows], x_ref[rows]), axis=1)
    return q, error


def reach(task: Task, q_init: Array, targets: Array, tolerance: float = 1e-6) -> tuple[Array, Array]:
    """Configurations (K, n) as near to their targets (K, m) as they were found, and the distances left (K,) [m, rad].

    Each is sought from q_init (n,), then from beside it, then from random ones until it arrives within `tolerance`,
    from ATTEMPTS in all: one start alone can get stuck, as a stretched arm does.
    """
    rng = np.random.default_rng(0)
    beside = q_init + rng.normal(scale=0.1, size=(ATTEMPTS // 3, len(q_init)))
    anywhere = rng.uniform(-np.pi, np.pi, (ATTEMPTS - 1 - len(beside), len(q_init)))
    q, left = np.tile(q_init, (len(targets), 1)), np.full(len(targets), np.inf)
    for guess in (q_init, *beside, *anywhere):
        rows = np.flatnonzero(left > tolerance)
        if not rows.size:
            break
        landed, distance = project(task, np.tile(guess, (len(rows), 1)), targets[rows])
        nearer = distance < left[rows]
        q[rows[nearer]], left[rows[nearer]] = landed[nearer], distance[nearer]
    return q, left


def place(task: Task, q_init: Array, start: Array) -> Array:
    """A configuration, near q_init (n,) if it can be, whose end effector is at the target `start`; or PathError."""
    q, error = reach(task, q_init, start[None], 1e-10)
    if error[0] > 1e-10:
        raise PathError(
            f"the path's start ({', '.join(f'{v:.4g}' for v in start[: len(task.axes)])}) m is out of reach: "
            f"the nearest of {ATTEMPTS} attempts, from robot.q_init and elsewhere, ends {error[0]:.3g} m from it"
        )
    return q[0]
