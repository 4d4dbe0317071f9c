"""Is an extremal of the maximum principle a minimum? Jacobi's condition, for any redundancy degree r.

The r-parameter family of extremals through the same start (fixed: other initial costates; free: other points of the
initial self-motion manifold, transversal there) is followed. X(t) (r, r) are its displacements along the null space of
J, P(T) those of t' lambda at the end. The Morse index is the number of conjugate points, zeros of det X on (0, T),
and of negative eigenvalues of P X^-1 at T, where q is free; the extremal is a strict minimum if it is zero
(Gelfand and Fomin, Calculus of Variations, Sections 28 to 30).
"""

from __future__ import annotations

import numpy as np
from scipy.integrate import solve_ivp

from pipeline.common.arrays import Array
from pipeline.methods.pontryagin.conditions import null_space, rates
from pipeline.model.kinematics import project
from pipeline.problem.lagrangian import Lagrangian
from pipeline.problem.problem import Boundary, Problem

STEP = 1e-5  # [rad], or of the costate: far above the integration's error, far below the motion's scale


POINTS = 201


def morse_index(problem: Problem, times: Array, y: Array) -> int:
    """Index of the extremal y = [q; lambda] (2 n, K) on its mesh `times` (K,); 0 for a minimum."""
    task, n, r = problem.task, problem.task.arm.n, problem.task.redundancy
    lagrangian = Lagrangian(task, problem.objective)
    starts = _neighbours(problem, lagrangian, y[:n, 0], y[n:, 0])

    def flow(t: float, flat: Array) -> Array:
        state = flat.reshape(-1, 2 * n)
        xd = np.repeat(problem.reference.sample(np.array([t]))[1], len(state), axis=0)
        return np.hstack(rates(lagrangian, xd, state[:, :n], state[:, n:])).ravel()

    moments = np.linspace(times[0], times[-1], POINTS)
    path = solve_ivp(flow, (times[0], times[-1]), starts.ravel(), "DOP853", moments, rtol=1e-10, atol=1e-12)
    states = path.y.T.reshape(len(path.t), 2 * r, 2 * n)
    middle = states.mean(axis=1)
    bases = null_space(task.jacobian(middle[:, :n]))
    for k in range(1, len(bases)):  # turned to follow each other: det X must change its sign for no other reason
        u, _, vt = np.linalg.svd(bases[k].T @ bases[k - 1])
        bases[k] = bases[k] @ (u @ vt)
    change = (states[:, :r] - states[:, r:]) / (2 * STEP)
    displacement = np.einsum("kni,kjn->kij", bases, change[:, :, :n])
    sign = np.sign(np.linalg.det(displacement[1:]))
    ends = null_space(task.jacobian(states[-1, :, :n]))
    # The null space turns with q: t' lambda of each neighbour is taken with its own basis, turned to the middle one's.
    moment = np.empty((2 * r, r))
    for j in range(2 * r):
        u, _, vt = np.linalg.svd(ends[j].T @ bases[-1])
        moment[j] = (ends[j] @ (u @ vt)).T @ states[-1, j, n:]
    form = ((moment[:r] - moment[r:]).T / (2 * STEP)) @ np.linalg.inv(displacement[-1])
    return int((sign[1:] != sign[:-1]).sum() + (np.linalg.eigvalsh((form + form.T) / 2) < 0).sum())


def _neighbours(problem: Problem, lagrangian: Lagrangian, q: Array, costate: Array) -> Array:
    """Initial states (2 r, 2 n) on either side of the extremal's, the forward ones first."""
    task = problem.task
    basis = null_space(task.jacobian(q[None]))[0].T
    steps = np.vstack([STEP * basis, -STEP * basis])
    if problem.boundary is Boundary.FIXED:
        return np.hstack([np.repeat(q[None], len(steps), axis=0), costate + steps])
    target = np.repeat(task.value(q[None]), len(steps), axis=0)
    moved, _ = project(task, q + steps, target)
    # Transversal at the new point too: what the costate has in the range of J' is of no account.
    return np.hstack([moved, np.zeros_like(moved)])
