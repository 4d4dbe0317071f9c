"""Stationary motions of the kinetic-energy integral, by the calculus of variations (r = 1, no limits).

Or of any other integral of first order, L = 1/2 qd' G qd - k0 w (`problem/lagrangian.py`), G then standing for M.
They are extremals (`extremals.py`) that also meet the condition of their ends. At a free end the momentum
has no component along the self-motion, t' M qd = 0 with t the unit null vector of J; for a path at rest that is qd = 0.
One unknown remains, the point on the initial self-motion manifold (free) or the initial null-space speed (fixed start):
it is scanned, all starts integrated at once, and every sign change of t' M qd at T is refined to a root.
A stationary motion is a minimum if its Jacobi field, the derivative of the motion by the unknown, has no zero on (0, T]
and carries the residual upwards at T; the number of violations is its Morse index.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import elementwise

from pipeline.common.arrays import Array
from pipeline.config.methods import CalculusOfVariationsOptions
from pipeline.methods.calculus_of_variations.extremals import MOST_STEPS, initial_state, integrate
from pipeline.methods.method import Context, Method, Serves
from pipeline.model.kinematics import wrap
from pipeline.problem.lagrangian import Lagrangian
from pipeline.problem.problem import Boundary, Problem
from pipeline.problem.resolution import on_path
from pipeline.problem.solution import Solution, Status, Trajectory
from pipeline.search.self_motion import manifold, on_manifold, tangent

TRACKING = 1e-10  # [m]


ROOT = 1e-6  # of the residual's scale: what a root must reach; a jump through zero does not


NEAR_MISS = 0.05  # of the residual's scale


VARIATION = 1e-5  # [rad or rad/s] of the unknown, for the Jacobi field


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


def solve(problem: Problem, options: CalculusOfVariationsOptions, context: Context) -> list[Solution]:
    """The stationary motions that the scan finds, on the knots that their path needs, cheapest first. Their statistics:
    `integral`, the objective in continuous time, `kind` (minimum or saddle), `index`, `unknown` [rad or rad/s] and
    `residual` t' M qd at T.
    """
    problem = replace(problem, times=on_path(problem))
    found: list[tuple[_Family, float]] = []
    near: list[tuple[float, float]] = []
    families = _families(problem, options)
    for number, family in enumerate(families):
        unknowns, values, ends = _scan(problem, family, options)
        for root in _roots(problem, family, unknowns, values, ends, options):
            found.append((family, root))
        near += _near_misses(unknowns, values)
        context.progress(number + 1, len(families), float("nan"))
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


calculus_of_variations = Method(
    "calculus_of_variations",
    "Calculus of variations",
    "#6B46C1",
    CalculusOfVariationsOptions,
    Serves(
        redundancy=1,
        order=1,
        boundaries=frozenset((Boundary.FIXED, Boundary.FREE)),
        constraints=False,
        moving_base=False,
        rest=False,
    ),
    solve,
)


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
    state = integrate(problem, initial_state(q, qd), 0.0, problem.reference.duration, tolerance, most_steps)
    return _residual(problem, state), state[:, : q.shape[1]]


def _residual(problem: Problem, state: Array) -> Array:
    n = problem.task.arm.n
    q, qd = np.nan_to_num(state[:, :n]), state[:, n : 2 * n]
    momentum = np.einsum("kij,kj->ki", Lagrangian(problem.task, problem.objective).metric(q), qd)
    return np.asarray((tangent(problem.task.jacobian(q)) * momentum).sum(axis=1))


def _scan(problem: Problem, family: _Family, options: CalculusOfVariationsOptions) -> tuple[Array, Array, Array]:
    """Unknowns in order (P,), residuals (P,), final configurations (P, n): even, then split where that is too few."""
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
    """(unknown, residual) where it nearly vanishes: a grid of finite step can have an optimum there; time has none."""
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
    state = initial_state(*family.start(np.concatenate([roots, roots + VARIATION, roots - VARIATION])))
    states = [state]
    for begin, end in pairwise(times):
        states.append(integrate(problem, states[-1], float(begin), float(end), options.tolerance))
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
