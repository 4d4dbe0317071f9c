"""The interpolation-based Global Kinematic Planner (Global paper Section 3): many coarse starts, every optimum refined.

Initial configurations and a population of motions are drawn and ranked (`candidates.py`), the best diverse ones are
optimised on a coarse grid, and each distinct optimum is carried to the wanted knots by cubic splines, halving the step.
"""

from __future__ import annotations

from collections import Counter
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
from scipy.interpolate import CubicSpline

from pipeline.common.arrays import Array
from pipeline.common.workers import Workers
from pipeline.config.methods import GlobalOptions
from pipeline.model.clearance import Clearance
from pipeline.model.kinematics import wrap
from pipeline.model.obstacles import Obstacles
from pipeline.problem.costs import objective_values
from pipeline.problem.integrals import of_order
from pipeline.problem.lagrangian import Lagrangian
from pipeline.problem.limits import LIMIT_KINDS
from pipeline.problem.objective import Objective
from pipeline.problem.problem import Problem
from pipeline.problem.solution import Progress, Solution, Status, Trajectory, no_progress
from pipeline.program.feasibility import Relaxed, least_violation, violations
from pipeline.program.transcription import transcribe
from pipeline.search.configurations import starting_points
from pipeline.search.population import population, ranking
from pipeline.search.selection import distinct, diverse

TRACKING = 1e-8  # [m] what an optimum must keep at every knot


# What a coarse grid's optimum needs to be told apart and refined; only the last grid's is reported.
ROUGH_TOLERANCE = 1e-4


ROUGH_ITERATIONS = 120  # starts that succeed take 10 to 100


ROUGH = {"constr_viol_tol": 1e-5, "acceptable_tol": 1e-4, "acceptable_constr_viol_tol": 1e-5}


ELASTIC_STARTS = 3  # from how many motions the least violation is sought when no motion is feasible


FEWER = 12  # starts on a finer grid after none succeeded on the coarse one


ROOM = 1e-3  # relative, to a torque limit that may be left out


BETWEEN = 4  # points per interval where clearances between knots are looked at


CLEARANCE_ROUNDS = 5


STRAYED = 1.5  # times the guess's cost, from where on a solve has left it


HOPELESS = 0.1  # relative violation on a coarse grid from which on finer ones are not tried


@dataclass(frozen=True)
class Optimum:
    """One local optimum on one grid, with the statistics of the solves that led to it."""

    q: Array  # (N + 1, n)
    cost: float
    converged: bool
    status: str
    continuous: bool = True  # False: between its knots the motion leaves the path, it jumps from branch to branch
    solves: list[dict[str, Any]] = field(default_factory=list)


def solve(
    problem: Problem,
    options: GlobalOptions = GlobalOptions(),
    seed: int = 1,
    workers: Workers = Workers(),
    progress: Progress = no_progress,
) -> list[Solution]:
    """All distinct optima found, best first; a single failed Solution if there is none."""
    grids = refinement(problem.times, options.coarse_steps)
    motions, log = _starts(problem, grids[0], options, np.random.default_rng(seed))
    if not len(motions):
        message = "no candidate could follow the path from its start to its end: it leaves the reach of the arm"
        return [_nothing(problem, Status.INFEASIBLE, message, log)]

    while True:
        starts = _optimise_starts(problem, grids[0], options, motions, workers, progress)
        if any(start.converged for start in starts):
            break
        relaxed = _relaxed(problem, grids[0], motions)
        if relaxed is not None and relaxed.feasible:
            starts += workers.map(_optimise_start, (problem, grids[0], options), [relaxed.q])
            if starts[-1].converged:
                break
        elif relaxed is not None and (relaxed.worst.relative > HOPELESS or len(grids) == 1):
            return [_nothing(problem, Status.INFEASIBLE, relaxed.worst.sentence, log)]
        if len(grids) == 1:
            break
        # A coarse grid can be infeasible where a finer one is not: its finite differences are other numbers.
        motions, grids = CubicSpline(grids[0], motions[:FEWER], axis=1)(grids[1]), grids[1:]
    log["grids"] = [len(grid) - 1 for grid in grids]
    log["starts"] = [
        {"converged": start.converged, "cost": start.cost, "status": start.status, "solves": start.solves}
        for start in starts
    ]
    basins = [starts[index] for index in _basins(problem, starts, options)]
    refined = workers.map(_refine, (problem, grids, options), basins)
    found = [(fine, coarse) for fine, coarse in zip(refined, basins, strict=True) if fine.converged and fine.continuous]
    log["jumping_optima"] = sum(fine.converged and not fine.continuous for fine in refined)
    if not found:
        return [_nothing(problem, Status.NOT_CONVERGED, _why(starts, refined), log)]
    ranked = [found[index] for index in _distinct([fine for fine, _ in found], options, problem)]
    solutions = []
    for rank, (fine, coarse) in enumerate(ranked):
        members = {"starts_in_basin": _members(problem, coarse, starts, options), "solves": fine.solves}
        solutions.append(
            Solution(
                "global",
                Trajectory(problem.times, fine.q),
                Status.SOLVED,
                optimum=rank + 1,
                tracking_tolerance=TRACKING,
                limits_kept=LIMIT_KINDS,
                statistics={**(log if rank == 0 else {}), **members},
            )
        )
    return solutions


def refinement(times: Array, coarse_steps: int) -> list[Array]:
    """Grids from coarse to fine: at most coarse_steps intervals, doubled until the wanted knots `times` are reached."""
    intervals = len(times) - 1
    sizes = [intervals]
    while sizes[0] > coarse_steps:
        sizes.insert(0, max(2, sizes[0] // 2))
    place = np.arange(intervals + 1)
    return [np.interp(np.linspace(0, intervals, size + 1), place, times) for size in sizes]


def _starts(
    problem: Problem, coarse: Array, options: GlobalOptions, rng: np.random.Generator
) -> tuple[Array, dict[str, Any]]:
    """The motions (K, N + 1, n) to optimise on the coarse grid, and how they came about."""
    parts: list[Array] = []
    log: dict[str, Any] = {}
    revolute = problem.task.arm.description.revolute
    if options.starts != "dynamic_programming":
        configurations = starting_points(problem, options.configurations, rng, options.draw)
        count = options.candidates or (len(coarse) * problem.task.arm.n) ** 2
        motions = population(problem, coarse, configurations, count, rng)
        log |= {"configurations": len(configurations), "candidates": len(motions)}
        if len(motions):
            costs = ranking(problem, coarse, motions, options.limit_weight)
            parts.append(motions[diverse(motions, costs, options.optimised, options.same_path, revolute)])
    if options.starts != "population":
        from pipeline.methods import dynamic_programming

        paths = dynamic_programming.starts(problem, coarse)
        log["dynamic_programming_paths"] = len(paths)
        parts.append(paths)
    empty = np.empty((0, len(coarse), problem.task.arm.n))
    return np.concatenate(parts) if parts else empty, log


def _optimise_starts(
    problem: Problem, grid: Array, options: GlobalOptions, motions: Array, workers: Workers, progress: Progress
) -> list[Optimum]:
    best = np.inf

    def done(count: int, optimum: Optimum) -> None:
        nonlocal best
        best = min(best, optimum.cost) if optimum.converged else best
        progress(count, len(motions), best)

    return workers.map(_optimise_start, (problem, grid, options), list(motions), done)


def _optimise_start(context: tuple[Problem, Array, GlobalOptions], guess: Array) -> Optimum:
    """One start on the coarse grid. Torques are optimised from a motion of little energy within the same limits.

    From a wild motion the torque program fails often; and where even that energy program is infeasible, so is it.
    """
    problem, times, options = context
    solves: list[dict[str, Any]] = []
    first: Optimum | None = None
    if problem.objective.second_order or _limits_torque(problem):
        first_order = Lagrangian(problem.task, problem.objective).is_quadratic
        only = replace(problem.objective, weights=of_order(problem.objective.weights, 1))
        objective = only if first_order else Objective()
        first = _optimise(replace(_without_torque_limits(problem), objective=objective), times, guess, options)
        solves += first.solves
        if not first.converged:
            return replace(first, solves=solves)
        guess = first.q
        if not problem.objective.second_order and _keeps_torque_limits(problem, times, guess):
            return first
    optimum = _optimise(problem, times, guess, options)
    goes_on = len(times) < len(problem.times)
    if first is not None and goes_on and _has_strayed(problem, times, guess, optimum):
        cost = float(objective_values(problem, times, guess[None])[0])
        optimum = replace(first, cost=cost, solves=optimum.solves)
    return replace(optimum, solves=solves + optimum.solves)


def _has_strayed(problem: Problem, times: Array, guess: Array, optimum: Optimum) -> bool:
    """Whether a solve ended far above a guess that keeps every limit: its first steps led into a motion with jumps, which
    coarse differences make an optimum of its own. A finer grid then starts from the guess. Accelerations must count for it.
    """
    if not problem.objective.second_order:
        return False
    if optimum.converged and optimum.cost <= STRAYED * float(objective_values(problem, times, guess[None])[0]):
        return False
    return not problem.constrained or all(v.relative <= ROOM for v in violations(problem, times, guess))


def _limits_torque(problem: Problem) -> bool:
    return bool(np.isfinite(problem.bounds.torque).any() or np.isfinite(problem.bounds.power).any())


def _without_torque_limits(problem: Problem) -> Problem:
    free = np.full(problem.task.arm.n, np.inf)
    return replace(problem, limits=replace(problem.bounds, torque=free, power=free))


def _keeps_torque_limits(problem: Problem, times: Array, q: Array) -> bool:
    """Whether torque and power limits are kept with some room: an optimum without them is then one with them."""
    worst = [v.relative for v in violations(problem, times, q) if v.kind in ("torque", "power")]
    return all(relative < -ROOM for relative in worst)


def _optimise_lazily(
    problem: Problem, times: Array, guess: Array, options: GlobalOptions, keep_off: float = 0.0
) -> Optimum:
    """As `_optimise`; but where torque limits alone bring torques in and the guess keeps them, it is tried without."""
    if (
        problem.objective.second_order
        or of_order(problem.bounds_of_integrals, 2)
        or not _limits_torque(problem)
        or not _keeps_torque_limits(problem, times, guess)
    ):
        return _optimise(problem, times, guess, options, keep_off)
    optimum = _optimise(_without_torque_limits(problem), times, guess, options, keep_off)
    if not optimum.converged or _keeps_torque_limits(problem, times, optimum.q):
        return optimum
    bound = _optimise(problem, times, optimum.q, options, keep_off)
    return replace(bound, solves=optimum.solves + bound.solves)


def _optimise(problem: Problem, times: Array, guess: Array, options: GlobalOptions, keep_off: float = 0.0) -> Optimum:
    program = transcribe(problem, times, guess, keep_off=keep_off)
    last = len(times) == len(problem.times)
    q, outcome, iterations = program.solve(
        tolerance=options.tolerance if last else max(options.tolerance, ROUGH_TOLERANCE),
        max_iterations=options.max_iterations if last else min(options.max_iterations, ROUGH_ITERATIONS),
        extra=None if last else ROUGH,
    )
    cost = float(objective_values(problem, times, q[None])[0])
    entry = {
        "intervals": len(times) - 1,
        "iterations": iterations,
        "wall_time_s": outcome.wall_time,
        "status": outcome.status,
        "cost": cost,
    }
    return Optimum(q, cost, outcome.converged, outcome.status, solves=[entry])


def _refine(context: tuple[Problem, list[Array], GlobalOptions], start: Optimum) -> Optimum:
    problem, grids, options = context
    optimum, solves = start, list(start.solves)
    on, failures = grids[0], 0
    for fine in grids[1:]:
        guess = CubicSpline(on, optimum.q)(fine)
        finer = _optimise_lazily(problem, fine, guess, options)
        solves += finer.solves
        lost = not finer.converged or _has_strayed(problem, fine, guess, finer)
        if not lost or fine is grids[-1]:
            optimum, on, failures = finer, fine, 0
            continue
        failures += 1  # one grid may be unlucky; the next starts from the last that was not
        if failures > 1:
            return replace(finer, converged=False, solves=solves)
    optimum = replace(optimum, solves=solves)
    if problem.obstacles is not None and optimum.converged:
        optimum = _clear_between(problem, problem.obstacles, grids[-1], optimum, options)
    return replace(optimum, continuous=stays_on_path(problem, grids[-1], optimum.q))


def _clear_between(
    problem: Problem, obstacles: Obstacles, times: Array, optimum: Optimum, options: GlobalOptions
) -> Optimum:
    """The optimum that keeps its clearance between the knots too: solved again, a little farther off at the knots."""
    clearance = Clearance(problem.task.arm, obstacles)
    fine = np.interp(np.arange(BETWEEN * (len(times) - 1) + 1) / BETWEEN, np.arange(len(times)), times)
    keep_off, solves = 0.0, list(optimum.solves)
    for _ in range(CLEARANCE_ROUNDS):
        lacking = obstacles.margin - float(clearance.smallest(CubicSpline(times, optimum.q)(fine)).min())
        if lacking <= 0 or not optimum.converged:
            break
        keep_off += 1.2 * lacking + 1e-7
        optimum = _optimise_lazily(problem, times, optimum.q, options, keep_off)
        solves += optimum.solves
    return replace(optimum, solves=solves)


def stays_on_path(problem: Problem, times: Array, q: Array) -> bool:
    """Whether the cubic spline through the knots follows the path between them, to 1 % of its length.

    A finite-difference program also has optima that jump to another branch of the manifold within one interval.
    """
    middle = (times[1:] + times[:-1]) / 2
    gap = problem.task.error(CubicSpline(times, q)(middle), problem.reference.position(middle))
    return bool(
        np.linalg.norm(gap[:, : len(problem.task.axes)], axis=1).max() <= 0.01 * problem.reference.geometry.length
    )


def _basins(problem: Problem, starts: list[Optimum], options: GlobalOptions) -> list[int]:
    """Indices of the starts that stand for the distinct optima of the coarse grid, best first."""
    solved = [index for index, start in enumerate(starts) if start.converged]
    return [solved[index] for index in _distinct([starts[index] for index in solved], options, problem)]


def _distinct(optima: list[Optimum], options: GlobalOptions, problem: Problem) -> list[int]:
    if not optima:
        return []
    motions, costs = np.array([o.q for o in optima]), np.array([o.cost for o in optima])
    return distinct(motions, costs, len(optima), options.same_path, problem.task.arm.description.revolute)


def _members(problem: Problem, optimum: Optimum, starts: list[Optimum], options: GlobalOptions) -> int:
    """How many starts fell into the basin of one coarse optimum."""
    solved = [start.q - optimum.q for start in starts if start.converged]
    revolute = problem.task.arm.description.revolute
    return int((np.abs(wrap(np.array(solved), revolute)).max(axis=(1, 2)) <= options.same_path).sum())


def _nothing(problem: Problem, status: Status, message: str, log: dict[str, Any]) -> Solution:
    standing = np.tile(problem.q_init, (len(problem.times), 1))
    return Solution("global", Trajectory(problem.times, standing), status, message, statistics=log, found=False)


def _relaxed(problem: Problem, times: Array, motions: Array) -> Relaxed | None:
    if not problem.constrained:
        return None
    return least_violation(problem, times, list(motions[:ELASTIC_STARTS]))


def _why(starts: list[Optimum], refined: list[Optimum]) -> str:
    """Why there is no optimum although there are starts, in the solver's own words."""
    if any(start.converged for start in starts):
        words = "; ".join(
            sorted({optimum.status if not optimum.converged else "jumps between branches" for optimum in refined})
        )
        return f"{len(refined)} optima of the coarse grid were lost on a finer one ({words})"
    words = Counter(start.status for start in starts).most_common(1)[0][0]
    return f"none of {len(starts)} starts converged (most often: {words})"
