"""Pontryagin's maximum principle as a two-point boundary-value problem, by collocation from many guesses.

The conditions of `conditions.py` on [0, T] with lambda(T) = 0 (the multiplier's part may be chosen so) and q(0) given,
or x(q(0)) = x_ref(0) and (I - J+J) lambda(0) = 0 for a free start.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from itertools import pairwise
from typing import Any

import numpy as np
from scipy.integrate import solve_bvp
from scipy.interpolate import CubicSpline

from pipeline.common.arrays import Array
from pipeline.config.methods import PontryaginOptions
from pipeline.methods.method import Context, Method
from pipeline.methods.pontryagin.conditions import SERVES, costates, null_space, rates, transversality
from pipeline.methods.pontryagin.second_variation import morse_index
from pipeline.model.kernel.arm import on_kernel
from pipeline.model.kinematics import project, pseudoinverse
from pipeline.problem.lagrangian import Lagrangian
from pipeline.problem.problem import Boundary, Problem
from pipeline.problem.resolution import on_path
from pipeline.problem.solution import Solution, Status, Trajectory
from pipeline.search.configurations import starting_points
from pipeline.search.population import population, ranking
from pipeline.search.selection import distinct, diverse

ROUGH_TOLERANCE = 1e-4  # enough to tell extremals apart


ROUGH_NODES = 400


TRACKING = 1e-7  # [m]


POPULATION = 200  # motions among which the guesses are chosen


SHOTS = 100


FASTEST = 12.0  # [rad] of self-motion within the motion time


ASTRAY = 0.5  # [rad] between a coarsely integrated shot and the path: the shot met a singularity


ENDS = 100  # times the tolerance, that a solve may leave of the conditions at the ends


LARGEST = 1e8  # a Newton step may go far astray; Drake must not see what is not finite


@dataclass(frozen=True)
class _Extremal:
    """One solution of the boundary-value problem: the collocation's own mesh t (K,), y = [q; lambda] (2 n, K)."""

    t: Array
    y: Array
    converged: bool
    statistics: dict[str, Any]


def solve(problem: Problem, options: PontryaginOptions, context: Context) -> list[Solution]:
    """Every extremal found, least objective first, on the knots that their path needs. Statistics: `integral`, the
    objective in continuous time, `transversality_start` and `_end`, `kind` (minimum or saddle) and `index`.
    """
    problem = replace(problem, times=on_path(problem), task=on_kernel(problem.task))
    guesses = _guesses(problem, options, np.random.default_rng(context.seed))
    best = np.inf

    def done(count: int, found: _Extremal) -> None:
        nonlocal best
        if found.converged:
            best = min(best, found.statistics["integral"])
        context.progress(count, len(guesses), best)

    rough = context.workers.map(_solve, (problem, ROUGH_TOLERANCE, ROUGH_NODES), list(guesses), done)
    basins = _distinct(problem, rough, 5 * options.same_path)
    fine = context.workers.map(_polish, (problem, options.tolerance, options.max_nodes), basins)
    extremals = _distinct(problem, fine, options.same_path)
    if not extremals:
        standing = np.tile(problem.q_init, (len(problem.times), 1))
        worst = min((found.statistics["residual"] for found in rough), default=np.inf)
        message = f"none of {len(rough)} guesses led to an extremal; the least residual was {worst:.1e}"
        failed = Trajectory(problem.times, standing)
        return [Solution("pontryagin", failed, Status.NOT_CONVERGED, message, found=False)]
    return [
        Solution(
            "pontryagin",
            Trajectory(problem.times, CubicSpline(found.t, found.y[: problem.task.arm.n], axis=1)(problem.times).T),
            Status.SOLVED,
            f"an extremal, {found.statistics['kind']}",
            optimum=rank + 1,
            tracking_tolerance=TRACKING,
            statistics=found.statistics,
        )
        for rank, found in enumerate(extremals)
    ]


pontryagin = Method("pontryagin", "Pontryagin", "#C53030", PontryaginOptions, SERVES, solve)


def _guesses(problem: Problem, options: PontryaginOptions, rng: np.random.Generator) -> Array:
    """Motions (K, intervals + 1, n) that follow the path in many ways: half of them feasible, half of them extremals of
    the wrong end.
    """
    times = np.linspace(0.0, problem.reference.duration, options.intervals + 1)
    starts = starting_points(problem, options.guesses, rng, "uniform")
    revolute = problem.task.arm.description.revolute
    parts = []
    for motions in (population(problem, times, starts, POPULATION, rng), _shots(problem, times, starts, rng)):
        if len(motions):
            costs = ranking(problem, times, motions, 0.0)
            parts.append(motions[diverse(motions, costs, -(-options.guesses // 2), options.same_path, revolute)])
    return np.concatenate(parts) if parts else np.empty((0, len(times), problem.task.arm.n))


def _shots(problem: Problem, times: Array, starts: Array, rng: np.random.Generator) -> Array:
    """Motions (K, N + 1, n) that keep every condition but that at the end: shot from `starts`, transversal there if
    they are free, with random null-space velocities if there is but one; by Runge and Kutta's fourth-order steps.
    """
    lagrangian, n = Lagrangian(problem.task, problem.objective), problem.task.arm.n
    q = np.resize(starts, (SHOTS, n)) if len(starts) == 1 else starts
    basis = null_space(problem.task.jacobian(q))
    speed = np.zeros((len(q), problem.task.redundancy))
    if problem.boundary is Boundary.FIXED:
        speed = rng.normal(size=speed.shape)
        # Spread evenly in size, up to a few turns of the arm within the motion.
        size = FASTEST * (np.arange(len(q)) + 0.5) / len(q) / problem.reference.duration
        speed *= (size / np.linalg.norm(speed, axis=1))[:, None]
    costate = (lagrangian.metric(q) @ basis @ speed[:, :, None])[:, :, 0]

    def slope(t: float, state: Array) -> Array:
        state = np.clip(np.nan_to_num(state), -LARGEST, LARGEST)
        xd = np.repeat(problem.reference.sample(np.array([t]))[1], len(state), axis=0)
        return np.hstack(rates(lagrangian, xd, state[:, :n], state[:, n:]))

    state = np.hstack([q, costate])
    motion = [q]
    for begin, end in pairwise(times):
        dt = end - begin
        first = slope(begin, state)
        second = slope(begin + dt / 2, state + dt / 2 * first)
        third = slope(begin + dt / 2, state + dt / 2 * second)
        fourth = slope(end, state + dt * third)
        state = state + dt / 6 * (first + 2 * second + 2 * third + fourth)
        motion.append(state[:, :n])
    motions = np.clip(np.nan_to_num(np.stack(motion, axis=1)), -LARGEST, LARGEST)
    on_path, error = project(
        problem.task, motions.reshape(-1, n), np.tile(problem.reference.position(times), (len(q), 1)), tolerance=1e-6
    )
    near = np.abs(on_path.reshape(motions.shape) - motions).max(axis=(1, 2)) < ASTRAY
    good = near & (error.reshape(len(q), -1).max(axis=1) < 1e-4)
    return on_path.reshape(motions.shape)[good]


def _solve(shared: tuple[Problem, float, int], guess: Array) -> _Extremal:
    problem, tolerance, nodes = shared
    times = np.linspace(0.0, problem.reference.duration, len(guess))
    qd = CubicSpline(times, guess)(times, 1)
    costate = costates(Lagrangian(problem.task, problem.objective), times, guess, qd)
    return _collocate(problem, times, np.vstack([guess.T, costate.T]), tolerance, nodes)


def _polish(shared: tuple[Problem, float, int], found: _Extremal) -> _Extremal:
    problem, tolerance, nodes = shared
    fine = _collocate(problem, found.t, found.y, tolerance, nodes)
    if not fine.converged:
        return fine
    index = morse_index(problem, fine.t, fine.y)
    kind = {"kind": "minimum" if index == 0 else "saddle", "index": index}
    return replace(fine, statistics={**fine.statistics, **kind})


def _collocate(problem: Problem, times: Array, guess: Array, tolerance: float, nodes: int) -> _Extremal:
    """solve_bvp on states [q; lambda] (2 n, K)."""
    task, n = problem.task, problem.task.arm.n
    lagrangian = Lagrangian(task, problem.objective)
    start = problem.reference.position(np.zeros(1))

    def across(y: Array) -> Array:  # the null space where states (2 n, K) begin
        return null_space(task.jacobian(np.clip(np.nan_to_num(y[:n, :1].T), -LARGEST, LARGEST)))[0]

    def flow(t: Array, y: Array) -> Array:
        y = np.clip(np.nan_to_num(y), -LARGEST, LARGEST)
        qd, slope = rates(lagrangian, problem.reference.sample(t)[1], y[:n].T, y[n:].T)
        return np.vstack([qd.T, slope.T])

    def ends(first: Array, last: Array, along: Array = across(guess)) -> Array:
        if problem.boundary is Boundary.FIXED:
            return np.concatenate([first[:n] - problem.q_init, last[n:]])
        q = np.clip(np.nan_to_num(first[:n]), -LARGEST, LARGEST)[None]
        x, jacobian = task.error_and_jacobian(q, start)
        free = first[n:] - pseudoinverse(jacobian[0]) @ jacobian[0] @ first[n:]
        return np.concatenate([x[0], along.T @ free, last[n:]])

    with np.errstate(all="ignore"):  # of guesses that lead nowhere
        result = solve_bvp(flow, ends, times, guess, tol=tolerance, max_nodes=nodes)
    # A solve may end where the null space is orthogonal to that of its guess, along which transversality was asked for.
    left = np.abs(ends(result.y[:, 0], result.y[:, -1], across(result.y))).max()
    residual = float(max(result.rms_residuals.max(), left))
    statistics: dict[str, Any] = {"nodes": result.x.size, "iterations": result.niter, "residual": residual}
    good = result.success and np.isfinite(result.y).all() and left < ENDS * tolerance
    if good:
        statistics |= {
            "integral": _integral(lagrangian, problem, result.sol, result.x),
            "transversality_start": transversality(lagrangian, result.y[:n, 0], result.y[n:, 0]),
            "transversality_end": transversality(lagrangian, result.y[:n, -1], result.y[n:, -1]),
        }
    return _Extremal(result.x, result.y, bool(good), statistics)


def _integral(lagrangian: Lagrangian, problem: Problem, solution: Any, mesh: Array) -> float:
    """The objective by five-point Gauss quadrature on the collocation's polynomials."""
    place, weight = np.polynomial.legendre.leggauss(5)
    dt = np.diff(mesh)
    t = (mesh[:-1, None] + dt[:, None] * (place + 1) / 2).ravel()
    y = solution(t)
    n = problem.task.arm.n
    q = y[:n].T
    qd = rates(lagrangian, problem.reference.sample(t)[1], q, y[n:].T)[0]
    value = lagrangian.quadratic(q, qd) - lagrangian.gain(q)[0]
    return float((value.reshape(len(dt), -1) @ weight / 2) @ dt)


def _distinct(problem: Problem, found: list[_Extremal], same: float) -> list[_Extremal]:
    good = [extremal for extremal in found if extremal.converged]
    if not good:
        return []
    n, times = problem.task.arm.n, problem.times
    motions = np.array([CubicSpline(extremal.t, extremal.y[:n], axis=1)(times).T for extremal in good])
    costs = np.array([extremal.statistics["integral"] for extremal in good])
    return [good[i] for i in distinct(motions, costs, len(good), same, problem.task.arm.description.revolute)]
