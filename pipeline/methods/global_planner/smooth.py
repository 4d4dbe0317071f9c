"""From optima by differences to splines that can be sent: each optimum's, within all limits between its knots too.

Where none keeps them, the shortest motion time that would do is sought and said.
"""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
from scipy.interpolate import CubicSpline

from pipeline.common.arrays import Array
from pipeline.config.methods import GlobalOptions
from pipeline.methods.global_planner.apart import keeps_own, short, without_own
from pipeline.methods.global_planner.grids import finer, off_path, served
from pipeline.methods.global_planner.optimum import confirmed
from pipeline.methods.global_planner.reasons import counted, unmet
from pipeline.methods.method import Context
from pipeline.problem.limits import FREE, LIMIT_KINDS
from pipeline.problem.problem import Boundary, Problem
from pipeline.problem.solution import Solution, Status, Trajectory
from pipeline.program.scaling import Prices
from pipeline.program.spline.curve import Curve, objective
from pipeline.program.spline.program import Solved, why_not
from pipeline.program.spline.tighten import excesses, keeps_forces, tighten, without_forces, worst
from pipeline.program.spline.transcription import transcribe
from pipeline.program.terms.tracking import prices
from pipeline.search.selection import distinct

STEPS = 25  # intervals of the first grid where torques count


ATTEMPTS = 4  # motions from which the shortest time is sought


TRACKING = 1e-8  # [m] at every knot; where two are left out, the path's own tolerance


ENOUGH = 1e-6  # relative: how well limits must be kept


SHOWN = 1.5  # steps in a start from rest that show it


LEAST = 1e-4  # of the motion time: a start from rest that takes less is not shown


@dataclass(frozen=True)
class Smooth:
    """A spline, whether it is an optimum, its objective; and the solves that led to it."""

    curve: Curve
    converged: bool
    status: str
    cost: float = np.inf
    solves: list[dict[str, Any]] = field(default_factory=list)


@dataclass
class Searches:
    """Solves with their statistics."""

    options: GlobalOptions
    solves: list[dict[str, Any]] = field(default_factory=list)
    last: Curve | None = None  # that a solve has converged to
    prices: Prices | None = None  # of a path that need not be kept exactly

    @property
    def given(self) -> dict[str, Any]:
        own = self.options
        return {"tolerance": own.tolerance, "max_iterations": own.max_iterations, "max_time": own.max_time}

    def note(self, solved: Solved) -> Solved:
        entry = {"solver": "ipopt, spline", "intervals": len(solved.curve.times) - 1, "iterations": solved.iterations}
        self.solves.append(entry | {"wall_time_s": solved.outcome.wall_time, "status": solved.outcome.status})
        self.last = solved.curve if solved.outcome.converged else self.last
        return solved

    def confirm(self, solved: Solved) -> None:
        """Note what IPOPT has left of the last solve."""
        self.solves[-1]["violation"], self.solves[-1]["optimality"] = solved.residuals()

    def lazily(self, problem: Problem, guess: Curve) -> Solved:
        """Torque and power limits come in only where the optimum without them breaks them."""
        loose = without_forces(problem)
        solved = self.note(transcribe(loose, guess, prices=self.prices).solve(**self.given))
        if not solved.outcome.converged or keeps_forces(problem, solved.curve):
            return solved
        return self.whole(problem, solved.curve)

    def whole(self, problem: Problem, guess: Curve) -> Solved:
        return self.note(transcribe(problem, guess, prices=self.prices).solve(**self.given))

    def value(self, problem: Problem, guess: Curve) -> None:
        """Learn from the motion on the path what leaving it is worth, if it may be left."""
        if problem.reference.exact:
            return
        solved = self.lazily(exactly(problem), guess)
        self.prices = prices(solved.program, solved.outcome) if solved.outcome.converged else None


def splined(problem: Problem, options: GlobalOptions) -> bool:
    """Whether the motion is to be a spline: asked for by name, by rest and limits that differences do not know, by a
    tube, or by an obstacle, which is to be kept off between the knots too.
    """
    off = problem.obstacles is not None and why_not(problem) is None
    asks = any(problem.rest) or problem.bounds.smooth or problem.free_timing or not problem.reference.exact or off
    return options.transcription == "spline" or (options.transcription is None and asks)


def unserved(problem: Problem, options: GlobalOptions) -> str | None:
    """What stands against the transcription that is asked for."""
    if splined(problem, options):
        why = why_not(problem)
        if why and options.transcription is None:
            kept = "boundary.rest and limits of acceleration or jerk"
            return f"{why}, and a spline, which alone keeps {kept}, does not serve that"
        return why and f"{why}, which method.global.transcription = spline does not serve"
    if any(problem.rest) or problem.bounds.smooth:
        return (
            "method.global.transcription = differences keeps neither boundary.rest nor limits.acceleration or "
            "limits.jerk; set it to spline, or boundary.rest=[] and no such limits"
        )
    return None


def exactly(problem: Problem) -> Problem:
    """The problem whose path is to be kept exactly."""
    return replace(problem, reference=replace(problem.reference, exact=True))


def rough(problem: Problem) -> Problem:
    """The problem without what differences do not know."""
    limits = replace(problem.bounds, acceleration=FREE, jerk=FREE)
    given = replace(exactly(problem), rest=(False, False), zero_acceleration=False, limits=limits)
    return replace(given, free_law=False, free_duration=False)


def freer(problem: Problem) -> Problem:
    """The same without limits that a motion keeps if only it takes its time: to start from where none are kept."""
    free = np.full(problem.task.arm.n, np.inf)
    loose = without_forces(rough(problem))
    return replace(loose, limits=replace(loose.bounds, velocity=free))


def resolved(problem: Problem, motion: Array) -> Array:
    """The problem's knots, and as many more at a start from rest as show it.

    Within their limits the joints take some time to the speed at which the optimum by differences, `motion`, jumps off.
    Where a step and a half do not fall into it, two do, two fall behind it, and from there on each is
    twice the one before.
    """
    bounds, times = problem.bounds, problem.times
    if not (problem.rest[0] and problem.boundary is Boundary.FIXED) or problem.objective.second_order:
        return times
    jump = np.abs(motion[1] - motion[0]) / (times[1] - times[0])
    takes = float(np.maximum(jump / bounds.acceleration, 2 * np.sqrt(jump / bounds.jerk)).max())
    first = float(times[1] - times[0])
    if takes >= SHOWN * first or takes <= LEAST * problem.reference.duration:
        return times
    steps = takes / 2 * np.array([1.0, 1.0, 1.0, *2.0 ** np.arange(40)])
    early = times[0] + np.cumsum(steps[steps < first])
    return np.concatenate([times[:1], early, times[times > early[-1] + first / 2]])


def smooth(problem: Problem, found: list[Solution], options: GlobalOptions, context: Context) -> list[Solution]:
    """The distinct optima among the splines, best first; or one solution that says what stands against any."""
    every_motion = [solution.trajectory.q for solution in found if solution.found]
    motions = every_motion[: served(problem)]
    if not motions:
        return found
    given = found[0].trajectory.time
    knots = resolved(problem, CubicSpline(given, motions[0])(problem.times))
    grown = len(knots) - len(problem.times)
    problem, motions = replace(problem, times=knots), list(CubicSpline(given, motions, axis=1)(knots))
    splines = context.workers.map(refine, (problem, options), motions)
    log = found[0].statistics
    if not any(spline.converged for spline in splines):
        fastest = context.workers.map(shortest, (problem, options), [spline.curve for spline in splines][:ATTEMPTS])
        best = min(fastest, key=lambda one: one.cost)
        if best.cost > 1 + ENOUGH:
            return [_nothing(problem, best, splines, log)]
        splines = [refine((problem, options), best.curve.q)]
    good = [spline for spline in splines if spline.converged]
    if not good:
        return [_nothing(problem, None, splines, log)]
    costs = np.array([spline.cost for spline in good])
    every = np.array([spline.curve.q for spline in good])
    revolute = problem.task.arm.description.revolute
    ranked = distinct(every, costs, len(good), options.same_path, revolute)
    first = good[ranked[0]].curve
    more_knots = finer(problem, options.refine_to, [first.q], first.ends) if problem.reference.exact else None
    if more_knots is not None:
        return smooth(replace(problem, times=more_knots), found, options, context)
    if options.refine_to is not None:  # the knots are those of the best: others may need more
        ranked = [i for i in ranked if i == ranked[0] or follows(problem, good[i].curve)]
    left = len(every_motion) - len(motions) + log.get("optima_left_coarse", 0)
    words = counted(len(ranked), len(log.get("starts", splines)), log.get("barren_starts", 0), left)
    more = f"{grown} more knots show the start from rest" * (grown > 0)
    solutions = []
    for rank, index in enumerate(ranked):
        own = good[index]
        solutions.append(
            Solution(
                "global",
                Trajectory(problem.times, own.curve.q, own.curve.ends),
                Status.SOLVED,
                "; ".join(filter(None, [found[0].message, more])) if rank == 0 else "",
                optimum=rank + 1,
                tracking_tolerance=promised(problem),
                limits_kept=LIMIT_KINDS,
                evidence=(words if rank == 0 else "") + confirmed(own.solves),
                statistics={**(log if rank == 0 else {}), "spline_solves": own.solves, "cost": own.cost},
            )
        )
    return solutions


def follows(problem: Problem, curve: Curve) -> bool:
    """Whether a spline keeps its path between its knots too; that of a tube is another's to judge."""
    off = off_path(problem, curve.q, curve.ends).max(axis=1)
    return not problem.reference.exact or bool(np.all(off <= problem.reference.tolerances))


def promised(problem: Problem) -> float:
    """What a spline keeps of its path at all knots [m, rad]; that of a tube is judged everywhere."""
    reference = problem.reference
    if not reference.exact:
        return float("inf")
    return reference.tolerance if problem.zero_acceleration else TRACKING


def refine(context: tuple[Problem, GlobalOptions], motion: Array) -> Smooth:
    """The spline that is nearest to an optimum by differences. Where it comes too near to the arm itself, and nowhere
    else, the rows that keep it off come in: few do, and they cost what all else costs.
    """
    problem, options = context
    free = _refine(without_own(problem), options, motion)
    if not keeps_own(problem) or not free.converged or short(problem, free.curve) <= 0:
        return free
    return _refine(problem, options, free.curve(problem.times))


def _refine(problem: Problem, options: GlobalOptions, motion: Array) -> Smooth:
    """Coarse to fine where torques count."""
    guess = Curve.through(problem, problem.times, motion)
    served = not problem.objective.second_order and keeps_forces(problem, guess)
    solver, finer = Searches(options), [problem.times] if served else grids(problem)
    if not served:
        guess = Curve.through(problem, finer[0], CubicSpline(problem.times, motion)(finer[0]))
    solver.value(problem, guess)
    solved = solver.lazily(problem, guess)
    if len(finer) > 1 and not solved.outcome.converged:
        guess = Curve.through(problem, finer[-1], motion)
        solved = solver.lazily(problem, guess)
    elif len(finer) > 1:
        loose = keeps_forces(problem, solved.curve)
        for grid in finer[1:]:
            guess = Curve.through(problem, grid, solved.curve(grid), solved.curve.ends)
            solved = solver.lazily(problem, guess) if loose else solver.whole(problem, guess)
    if solved.outcome.converged:
        solved, further = tighten(problem, solved, short, guess, **solver.given)
        for one in further:
            solver.note(one)
    if solved.outcome.converged:
        solver.confirm(solved)
    kept = all(float(excess.max()) <= ENOUGH for excess in excesses(problem, solved.curve).values())
    status = _status(solved, kept)
    good = kept and solved.outcome.converged
    curve = solved.curve if good or solver.last is None else solver.last
    return Smooth(curve, good, status, objective(problem, curve), solver.solves)


def _status(solved: Solved, kept: bool) -> str:
    """IPOPT's word for how a solve ended; where it has not converged, with what it could not meet and by how much."""
    if solved.outcome.converged:
        return solved.outcome.status if kept else "exceeds a limit between its knots"
    return unmet(f"{solved.outcome.status} on {len(solved.curve.times) - 1} intervals", *solved.residuals())


def shortest(context: tuple[Problem, GlobalOptions], start: Curve) -> Smooth:
    """The motion of least time from `start`, the law of the path kept; `cost`: that time over the one asked for."""
    problem, options = context
    solver, curve = Searches(options), start
    for grid in grids(problem):
        guess = Curve.through(problem, grid, curve(grid), curve.ends)
        program = transcribe(problem, guess, stretch=room(problem, guess))
        solved = solver.note(program.solve(**solver.given))
        if not solved.outcome.converged:
            return Smooth(start, False, solved.outcome.status, np.inf, solver.solves)
        curve = solved.curve
    return Smooth(curve, True, solved.outcome.status, solved.stretch, solver.solves)


def room(problem: Problem, curve: Curve) -> float:
    """By how much a motion must be stretched so that it keeps its limits, if no gravity acts."""
    powers = {"velocity": 1, "acceleration": 2, "jerk": 3, "torque": 2, "power": 3}
    powers |= {"tool_speed": 1, "tool_acceleration": 2}
    found = excesses(problem, curve)
    return max(
        (float(1 + found[kind].max()) ** (1 / power) for kind, power in powers.items() if kind in found), default=1.0
    )


def grids(problem: Problem) -> list[Array]:
    """One grid, but two or three where torques count."""
    intervals = len(problem.times) - 1
    bounds = problem.bounds
    counts = problem.objective.second_order or np.isfinite(bounds.torque).any() or np.isfinite(bounds.power).any()
    sizes = [intervals]
    while counts and sizes[0] > STEPS:
        sizes.insert(0, max(2, sizes[0] // 2))
    place = np.arange(intervals + 1)
    return [np.interp(np.linspace(0, intervals, size + 1), place, problem.times) for size in sizes]


def _nothing(problem: Problem, fastest: Smooth | None, splines: list[Smooth], log: dict[str, Any]) -> Solution:
    """No spline keeps every limit: which one cannot be met, and in what time all could."""
    tried = f"none of {len(splines)} optima" if len(splines) > 1 else "the one optimum found"
    statistics = {**log, "spline_solves": [spline.solves for spline in splines]}
    if fastest is None or not np.isfinite(fastest.cost):
        words = "; ".join(sorted({spline.status for spline in splines}))
        message = f"{tried} leads to a smooth motion within all limits ({words}); try more knots (timing.steps)"
        return nothing(problem, Status.NOT_CONVERGED, message, statistics)
    violation, duration = worst(problem, fastest.curve), problem.reference.duration * fastest.cost
    assert violation is not None
    message = (
        f"{violation.bound} cannot be met between the knots: the least excess found is {violation.extent}; "
        f"shortest feasible duration {duration:.4g} s, as far as was found"
    )
    return nothing(problem, Status.INFEASIBLE, message, statistics)


def nothing(problem: Problem, status: Status, message: str, log: dict[str, Any]) -> Solution:
    """The answer that there is no motion, and why."""
    standing = Trajectory(problem.times, np.tile(problem.q_init, (len(problem.times), 1)))
    return Solution("global", standing, status, message, statistics=log, found=False)
