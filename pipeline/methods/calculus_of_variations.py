"""Every stationary motion of the kinetic-energy integral, by the calculus of variations (r = 1, no limits).

Or of any other integral of first order, L = 1/2 qd' G qd - k0 w (`lagrangian.py`): G then stands for M, and the gradient
of k0 w joins n.

With a multiplier lambda(t) for the task J qdd = xdd - Jd qd, Lagrange's equations of T = 1/2 qd' M qd are
M qdd + n = J' lambda, hence

    qdd = J_M+ (xdd - Jd qd) - (I - J_M+ J) M^-1 n,   J_M+ = M^-1 J' (J M^-1 J')^-1.

The Global paper (after Nedungadi and Kazerouinian) prints a plus sign and no inverse of M. At a free end the momentum
has no component along the self-motion, t' M qd = 0 with t the unit null vector of J; for a path at rest that is qd = 0.
One unknown remains, the point on the initial self-motion manifold (free) or the initial null-space speed (fixed start):
it is scanned, all starts integrated at once, and every sign change of t' M qd at T is refined to a root.
A stationary motion is a minimum if its Jacobi field, the derivative of the motion by the unknown, has no zero on (0, T]
and carries the residual upwards at T; the number of violations is its Morse index.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray
from scipy.integrate import DOP853
from scipy.optimize import elementwise

from pipeline.common.arrays import Array
from pipeline.common.errors import InputError
from pipeline.config.methods import CalculusOfVariationsOptions
from pipeline.model.kinematics import pseudoinverse, wrap
from pipeline.problem.lagrangian import Lagrangian
from pipeline.problem.problem import Boundary, Problem
from pipeline.problem.solution import Progress, Solution, Status, Trajectory, no_progress
from pipeline.search.self_motion import manifold, on_manifold, tangent

TRACKING = 1e-10  # [m]


ROOT = 1e-6  # of the residual's scale: what a root must reach; a jump through zero does not


NEAR_MISS = 0.05  # of the residual's scale


VARIATION = 1e-5  # [rad or rad/s] of the unknown, for the Jacobi field


MOST_STEPS = 300


MOST_SCAN_STEPS = 80  # a regular motion takes 15 to 30 at the scan's tolerance


PARTS = 4  # into which an interval of the scan is split


JUMP = 0.5  # [rad] between the final configurations of neighbours in the scan: split the interval


@dataclass(frozen=True)
class _Family:
    """Starts by one unknown u in [low, high]: u (P,) -> q (P, n), qd (P, n)."""

    start: Callable[[Array], tuple[Array, Array]]
    low: float
    high: float
    closed: bool


def solve(
    problem: Problem,
    options: CalculusOfVariationsOptions = CalculusOfVariationsOptions(),
    progress: Progress = no_progress,
) -> list[Solution]:
    """All stationary motions on problem.times, cheapest first. Their statistics: `integral`, the objective in continuous
    time, `kind` (minimum or saddle), `index`, `unknown` [rad or rad/s] and `residual` t' M qd at T.
    """
    check(problem)
    found: list[tuple[_Family, float]] = []
    near: list[tuple[float, float]] = []
    families = _families(problem, options)
    for number, family in enumerate(families):
        unknowns, values, ends = _scan(problem, family, options)
        for root in _roots(problem, family, unknowns, values, ends, options):
            found.append((family, root))
        near += _near_misses(unknowns, values)
        progress(number + 1, len(families), float("nan"))
    motions = [motion for family in families for motion in _motions(problem, family, found, options)]
    motions.sort(key=lambda motion: float(motion.statistics["integral"]))
    if not motions:
        standing = np.tile(problem.q_init, (len(problem.times), 1))
        message = "no stationary motion was found: scan more densely, or further for a fixed start"
        return [
            Solution(
                "calculus_of_variations", Trajectory(problem.times, standing), Status.INFEASIBLE, message, found=False
            )
        ]
    return [
        Solution(
            motion.method,
            motion.trajectory,
            motion.status,
            optimum=rank + 1,
            tracking_tolerance=TRACKING,
            statistics={**motion.statistics, **({"near_misses": near} if rank == 0 else {})},
        )
        for rank, motion in enumerate(motions)
    ]


def check(problem: Problem) -> None:
    """Refuse problems that this method does not serve; raises InputError."""
    supported = "supported are r = 1, an objective of first order, boundary free or fixed, and no limits or obstacles"
    if problem.task.redundancy != 1:
        raise InputError(f"calculus_of_variations: the redundancy degree is {problem.task.redundancy}; {supported}")
    if problem.objective.second_order or not Lagrangian(problem.task, problem.objective).is_quadratic:
        raise InputError(f"calculus_of_variations: the objective holds a torque integral; {supported}")
    if problem.boundary is Boundary.CYCLIC:
        raise InputError(f"calculus_of_variations: the boundary is cyclic; {supported}")
    if problem.constrained:
        raise InputError(f"calculus_of_variations: the problem has limits or obstacles; {supported}")


def _families(problem: Problem, options: CalculusOfVariationsOptions) -> list[_Family]:
    task = problem.task
    lagrangian = Lagrangian(task, problem.objective)
    x, xd, _ = problem.reference.sample(np.zeros(1))

    def least_energy(q: Array) -> Array:
        jacobian = task.jacobian(q)
        wanted = task.velocity(q, np.repeat(xd, len(q), axis=0))
        right = np.linalg.solve(lagrangian.metric(q), np.swapaxes(jacobian, 1, 2))
        return (right @ np.linalg.solve(jacobian @ right, wanted[:, :, None]))[:, :, 0]

    loops = manifold(task, x[0], np.random.default_rng(0), spacing=options.spacing, seeds=problem.q_init[None])
    if problem.boundary is Boundary.FREE:

        def along(loop_number: int) -> Callable[[Array], tuple[Array, Array]]:
            def start(u: Array) -> tuple[Array, Array]:
                q = on_manifold(task, loops[loop_number], u, x[0])
                return q, least_energy(q)

            return start

        return [_Family(along(i), 0.0, loop.length, True) for i, loop in enumerate(loops)]

    q_init = problem.q_init[None]
    particular, null = least_energy(q_init), tangent(task.jacobian(q_init))
    most = options.max_speed or max(loop.length for loop in loops) / problem.reference.duration

    def shoot(u: Array) -> tuple[Array, Array]:
        return np.repeat(q_init, len(u), axis=0), particular + u[:, None] * null

    return [_Family(shoot, -most, most, False)]


# --- the scan and its roots -----------------------------------------------------------------------------------------


def _final(problem: Problem, family: _Family, u: Array, tolerance: float, most_steps: int) -> tuple[Array, Array]:
    """Residual t' M qd (P,) [N m s] and configuration (P, n) at T; nan where the motion runs into a singularity."""
    q, qd = family.start(u)
    state = _integrate(problem, _state(q, qd), 0.0, problem.reference.duration, tolerance, most_steps)
    return _residual(problem, state), state[:, : q.shape[1]]


def _residual(problem: Problem, state: Array) -> Array:
    n = problem.task.arm.n
    q, qd = np.nan_to_num(state[:, :n]), state[:, n : 2 * n]
    momentum = np.einsum("kij,kj->ki", Lagrangian(problem.task, problem.objective).metric(q), qd)
    return np.asarray((tangent(problem.task.jacobian(q)) * momentum).sum(axis=1))


def _scan(problem: Problem, family: _Family, options: CalculusOfVariationsOptions) -> tuple[Array, Array, Array]:
    """Unknowns in order (P,), residuals (P,), final configurations (P, n): even, then split where that is not enough."""
    count = max(16, int(np.ceil((family.high - family.low) / options.spacing)))
    u = np.linspace(family.low, family.high, count + 1)
    value, end = _final(problem, family, u, options.scan_tolerance, MOST_SCAN_STEPS)
    revolute = problem.task.arm.description.revolute
    for _ in range(options.refinements):
        jump = np.linalg.norm(wrap(np.diff(end, axis=0), revolute), axis=1)
        coarse = ~(jump < JUMP)
        valley = _valleys(value)
        coarse[valley - 1] = coarse[valley] = True
        inner = np.arange(1, PARTS) / PARTS
        new = (u[:-1][coarse, None] + np.diff(u)[coarse, None] * inner).ravel()
        if not new.size:
            break
        more, more_end = _final(problem, family, new, options.scan_tolerance, MOST_SCAN_STEPS)
        order = np.argsort(np.concatenate([u, new]), kind="stable")
        u, value = np.concatenate([u, new])[order], np.concatenate([value, more])[order]
        end = np.concatenate([end, more_end])[order]
    return u, value, end


def _valleys(value: Array) -> NDArray[np.intp]:
    """Places in the scan where the residual comes closest to zero without changing its sign: a double root may hide."""
    size = np.abs(value)
    lowest = (size[1:-1] < size[:-2]) & (size[1:-1] < size[2:])
    return 1 + np.flatnonzero(lowest & (value[:-2] * value[1:-1] > 0) & (value[1:-1] * value[2:] > 0))


def _near_misses(u: Array, value: Array) -> list[tuple[float, float]]:
    """(unknown, residual) where it nearly vanishes: a grid of finite step can have an optimum there that time has not."""
    low = _valleys(value)
    low = low[np.abs(value[low]) < NEAR_MISS * np.nanmedian(np.abs(value))]
    return [(float(u[i]), float(value[i])) for i in low]


def _roots(
    problem: Problem, family: _Family, u: Array, value: Array, end: Array, options: CalculusOfVariationsOptions
) -> list[float]:
    """The roots of the residual: sign changes refined by Chandrupatla's method, all at once.

    Where the final configuration still jumps, the motions on either side part at a singularity: no root lies between.
    """
    jump = np.linalg.norm(wrap(np.diff(end, axis=0), problem.task.arm.description.revolute), axis=1)
    at = np.flatnonzero((value[:-1] * value[1:] < 0) & (jump < JUMP))
    if not at.size:
        return []

    def residual(x: Array) -> Array:
        shape = np.shape(x)
        return _final(problem, family, np.ravel(x), options.tolerance, MOST_STEPS)[0].reshape(shape)

    result = elementwise.find_root(
        residual, (u[at], u[at + 1]), tolerances={"fatol": 1e-11, "xatol": 1e-14, "xrtol": 1e-15}, maxiter=40
    )
    scale = float(np.nanmedian(np.abs(value)))
    good = np.abs(result.f_x) < ROOT * max(scale, 1e-12)
    return [float(x) for x in result.x[good]]


def _motions(
    problem: Problem, family: _Family, found: list[tuple[_Family, float]], options: CalculusOfVariationsOptions
) -> list[Solution]:
    """The motions of this family's roots, each with two neighbours for the Jacobi field, sampled at problem.times."""
    roots = np.array([root for of, root in found if of is family])
    if not roots.size:
        return []
    count, n, times = len(roots), problem.task.arm.n, problem.times
    state = _state(*family.start(np.concatenate([roots, roots + VARIATION, roots - VARIATION])))
    states = [state]
    for begin, end in pairwise(times):
        states.append(_integrate(problem, states[-1], float(begin), float(end), options.tolerance))
    residual = _residual(problem, states[-1])
    slope = (residual[count : 2 * count] - residual[2 * count :]) / (2 * VARIATION)
    history = np.stack(states, axis=1)[:, :, :n]  # (3 roots, N + 1, n)
    q = history[:count]
    null = tangent(problem.task.jacobian(q.reshape(-1, n))).reshape(q.shape)
    field = ((history[count : 2 * count] - history[2 * count :]) * null).sum(axis=2) / (2 * VARIATION)
    conjugate = (field[:, 1:-1] * field[:, 2:] < 0).sum(axis=1)
    index = conjugate + (slope * field[:, -1] <= 0)
    return [
        Solution(
            "calculus_of_variations",
            Trajectory(times, q[i]),
            Status.SOLVED,
            statistics={
                "integral": float(states[-1][i, 2 * n]),
                "kind": "minimum" if index[i] == 0 else "saddle",
                "index": int(index[i]),
                "unknown": float(roots[i]),
                "residual": float(residual[i]),
                "slope": float(slope[i]),
            },
        )
        for i in range(count)
    ]


# --- integration ----------------------------------------------------------------------------------------------------


def _state(q: Array, qd: Array) -> Array:
    """(P, 2 n + 1): q, qd and the objective so far."""
    return np.hstack([q, qd, np.zeros((len(q), 1))])


def rate(problem: Problem, t: Array, state: Array) -> Array:
    """d/dt of the states (P, 2 n + 1) at times t (P,): the stationarity condition (see the module)."""
    task, n = problem.task, problem.task.arm.n
    q, qd = state[:, :n], state[:, n : 2 * n]
    lagrangian = Lagrangian(task, problem.objective)
    jacobian, metric = task.jacobian(q), lagrangian.metric(q)
    _, xd_ref, xdd_ref = problem.reference.sample(t)
    wanted = task.acceleration(q, qd, xd_ref, xdd_ref) - task.jacobian_rate_term(q, qd)
    bias, inverse = lagrangian.bias(q, qd), np.linalg.inv(metric)
    right = inverse @ np.swapaxes(jacobian, 1, 2)
    free = -(inverse @ bias[:, :, None])
    multiplier = np.linalg.solve(jacobian @ right, wanted[:, :, None] - jacobian @ free)
    qdd = (free + right @ multiplier)[:, :, 0]
    value = 0.5 * np.einsum("ki,kij,kj->k", qd, metric, qd) - lagrangian.gain(q)[0]
    return np.hstack([qd, qdd, value[:, None]])


def _integrate(
    problem: Problem, state: Array, begin: float, end: float, tolerance: float, most_steps: int = MOST_STEPS
) -> Array:
    """The states (P, 2 n + 1) at `end`: Dormand-Prince 8(5,3) with a step of its own for every row, all rows in step.

    After each step q and qd are moved the least distance back onto the path. Rows that take too many steps become nan.
    """
    a, b, c = DOP853.A[:12, :12], DOP853.B, DOP853.C[:12]
    e3, e5 = DOP853.E3[:12], DOP853.E5[:12]
    y, t = state.copy(), np.full(len(state), begin)
    h = np.full(len(state), min(end - begin, 0.05 * problem.reference.duration))
    live = np.flatnonzero(np.isfinite(y).all(axis=1))
    for _ in range(most_steps):
        if not live.size:
            break
        step = np.minimum(h[live], end - t[live])[:, None]
        slopes = np.empty((12, len(live), y.shape[1]))
        for stage in range(12):
            inner = y[live] + step * np.tensordot(a[stage, :stage], slopes[:stage], axes=1)
            slopes[stage] = rate(problem, t[live] + c[stage] * step[:, 0], inner)
        ahead = y[live] + step * np.tensordot(b, slopes, axes=1)
        scale = tolerance * (1 + np.maximum(np.abs(y[live]), np.abs(ahead)))
        fifth = (np.tensordot(e5, slopes, axes=1) / scale) ** 2
        third = (np.tensordot(e3, slopes, axes=1) / scale) ** 2
        fifth, third = fifth.mean(axis=1), third.mean(axis=1)
        error = step[:, 0] * fifth / np.sqrt(np.maximum(fifth + 0.01 * third, 1e-300))
        good = error <= 1
        moved = live[good]
        y[moved], t[moved] = ahead[good], t[moved] + step[good, 0]
        if moved.size:
            y[moved] = _back_on_path(problem, t[moved], y[moved])
        h[live] = step[:, 0] * np.clip(0.9 * np.maximum(error, 1e-300) ** -0.125, 0.2, 6.0)
        live = live[(t[live] < end - 1e-14) & (h[live] > 1e-10)]
    y[t < end - 1e-12] = np.nan
    return y


def _back_on_path(problem: Problem, t: Array, state: Array) -> Array:
    n = problem.task.arm.n
    x_ref, xd_ref, _ = problem.reference.sample(t)
    error, jacobian = problem.task.error_and_jacobian(state[:, :n], x_ref)
    inverse = pseudoinverse(jacobian)
    xd = problem.task.velocity(state[:, :n], xd_ref)
    state[:, :n] -= (inverse @ error[:, :, None])[:, :, 0]
    state[:, n : 2 * n] += (inverse @ (xd[:, :, None] - jacobian @ state[:, n : 2 * n, None]))[:, :, 0]
    return state
