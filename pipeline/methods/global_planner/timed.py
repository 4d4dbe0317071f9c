"""Motions whose timing is found with them: as short as their limits allow, or at the law of the path that costs least.

Every optimum by differences, without limits, begins a search. The time is shortened under the law as it is, then under
one that is free; in a time that is given the cheapest law is found.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from pipeline.common.arrays import Array
from pipeline.config.methods import GlobalOptions
from pipeline.methods.global_planner.apart import keeps_own, short, without_own
from pipeline.methods.global_planner.optimum import confirmed
from pipeline.methods.global_planner.smooth import ATTEMPTS, ENOUGH, Searches, grids, nothing, promised, room
from pipeline.methods.method import Context
from pipeline.path.reference import Reference
from pipeline.path.timing import Found
from pipeline.problem.limits import LIMIT_KINDS
from pipeline.problem.problem import Problem
from pipeline.problem.solution import Solution, Status, Trajectory
from pipeline.program.spline.curve import Curve, objective
from pipeline.program.spline.program import Solved
from pipeline.program.spline.tighten import excesses, keeps_forces, tighten, without_forces
from pipeline.program.spline.transcription import transcribe

SLOWER = 6  # times at most that a motion is slowed down to keep its limits between its knots too


EXACT = 1e-7  # relative: excess that is none


@dataclass(frozen=True)
class Timed:
    """A motion with its timing: the problem is the one that has this law and this time.

    cost: the motion time [s] where that is what counts, else the objective. duration [s]: the shortest in which the
    limits would be kept, where `converged` is False for lack of time.
    """

    problem: Problem
    curve: Curve
    converged: bool
    status: str
    cost: float
    solves: list[dict[str, object]]
    duration: float = np.inf


@dataclass(frozen=True)
class Record:
    """The same in numbers and words alone, as workers hand back; fractions (N + 1,): the law that was found, at the
    knots of the curve, or None.
    """

    curve: Curve
    fractions: Array | None
    converged: bool
    status: str
    cost: float
    solves: list[dict[str, object]]
    duration: float

    def reference(self, problem: Problem) -> Reference:
        """The problem's path with this timing."""
        times = self.curve.times
        if self.fractions is None:
            return problem.reference.slowed(float(times[-1]) / problem.reference.duration)
        law = Found(tuple(times.tolist()), tuple(self.fractions.tolist()))
        return replace(problem.reference, timing=law)


def settled(context: tuple[Problem, GlobalOptions], motion: Array) -> Record:
    """See `settle`."""
    return recorded(settle(context, motion))


def recorded(one: Timed) -> Record:
    """Its numbers and words."""
    fractions = None
    if one.problem.free_law and one.converged:
        fractions = one.problem.reference.timing.sample(one.curve.times, 1.0)[0]
    return Record(one.curve, fractions, one.converged, one.status, one.cost, one.solves, one.duration)


def timed(problem: Problem, found: list[Solution], options: GlobalOptions, context: Context) -> list[Solution]:
    """The best of the motions to which those `found` lead; or one solution that says why there is none."""
    motions = [solution.trajectory.q for solution in found if solution.found][:ATTEMPTS]
    answers = context.workers.map(settled, (problem, options), motions)
    log, good = found[0].statistics, [answer for answer in answers if answer.converged]
    log = {**log, "spline_solves": [answer.solves for answer in answers]}
    if not good:
        shortest = min(answer.duration for answer in answers)
        words = "; ".join(sorted({answer.status for answer in answers}))
        if np.isfinite(shortest):
            asked = f"timing.duration = {problem.reference.duration:g} s"
            why = f"no law was found that keeps every limit in {asked}; shortest feasible duration {shortest:.4g} s"
            return [nothing(problem, Status.INFEASIBLE, why, log)]
        why = f"no timing was found from {len(answers)} optima ({words}); try more knots (timing.steps)"
        return [nothing(problem, Status.NOT_CONVERGED, why, log)]
    best = min(good, key=lambda answer: answer.cost)
    reference = best.reference(problem)
    duration = reference.duration
    kept = "law of the path kept" if not problem.free_law else "law of the path free"
    message = (
        f"shortest duration found {duration:.4g} s, {kept}" if problem.free_duration else f"{kept}, in {duration:.4g} s"
    )
    return [
        Solution(
            "global",
            Trajectory(best.curve.times, best.curve.q, best.curve.ends),
            Status.SOLVED,
            message,
            tracking_tolerance=promised(problem),
            limits_kept=LIMIT_KINDS,
            evidence=f"the best of {len(good)} that were found from {len(answers)} optima; {confirmed(best.solves)}",
            reference=reference,
            statistics=log,
        )
    ]


def settle(context: tuple[Problem, GlobalOptions], motion: Array) -> Timed:
    """The motion that the optimum by differences `motion` (N + 1, n) leads to, and its timing; of the arm itself it is
    kept off where it comes too near to it without.
    """
    problem, options = context
    free = _settle(without_own(problem), options, motion)
    if not keeps_own(problem) or not free.converged or short(replace(free.problem, own=problem.own), free.curve) <= 0:
        return free
    return _settle(problem, options, motion)


def _settle(problem: Problem, options: GlobalOptions, motion: Array) -> Timed:
    searches = Searches(options)
    given = replace(problem, free_law=False, free_duration=False)
    curve = Curve.through(given, problem.times, motion)
    if not problem.free_duration:
        return cheapest(replace(given, free_law=True), curve, searches)
    pace = room(given, curve)  # else the bounds of the stretch, and its scale, would be any
    given, curve = given.slowed(pace), curve.stretched(pace)
    answer = quickest(given, curve, searches, finish=not problem.free_law)
    if answer.converged and problem.free_law:
        answer = quickest(replace(answer.problem, free_law=True), answer.curve, searches)
    return answer


def quickest(problem: Problem, curve: Curve, searches: Searches, *, finish: bool = True) -> Timed:
    """The shortest motion from `curve`; to `finish` it is on all knots, and keeps its limits between them too, if need
    be by being a little slower.
    """
    for grid in grids(problem) if finish else grids(problem)[:1]:
        solved = _shorter(problem, Curve.through(problem, grid, curve(grid), curve.ends), searches)
        if not solved.outcome.converged:
            return Timed(problem, curve, False, solved.outcome.status, np.inf, searches.solves)
        problem, curve = solved.timed(problem), solved.curve
    if finish:
        first, further = tighten(problem, solved, short, **searches.given)
        for one in further:
            searches.note(one)
        solved = first if first.outcome.converged else solved
        searches.confirm(solved)
    problem, curve = solved.timed(problem).slowed(solved.stretch), solved.curve.stretched(solved.stretch)
    for _ in range(SLOWER):
        more = room(problem, curve)
        if more <= 1 + EXACT:
            break
        problem, curve = problem.slowed(more), curve.stretched(more)
    kept = all(float(excess.max()) <= ENOUGH for excess in excesses(problem, curve).values())
    time = problem.reference.duration
    return Timed(problem, curve, kept, solved.outcome.status, time, searches.solves, time)


def _shorter(problem: Problem, guess: Curve, searches: Searches) -> Solved:
    """On the knots of the guess; torque and power limits come in only where they are broken without them."""
    if np.isfinite(problem.bounds.acceleration).all():
        loose = without_forces(problem)
        solved = searches.note(transcribe(loose, guess, stretch=room(loose, guess)).solve(**searches.given))
        if solved.outcome.converged and keeps_forces(problem, solved.curve.stretched(solved.stretch)):
            return solved
    return searches.note(transcribe(problem, guess, stretch=room(problem, guess)).solve(**searches.given))


def cheapest(problem: Problem, curve: Curve, searches: Searches) -> Timed:
    """The cheapest motion near `curve` under the cheapest law in the given time, or the shortest time that would do."""
    answer = _cheapest(problem, curve, searches)
    if answer.converged:
        return answer
    pace, asked = room(problem, curve), problem.reference.duration
    fastest = quickest(problem.slowed(pace), curve.stretched(pace), searches)
    if not fastest.converged or fastest.cost > asked * (1 + ENOUGH):
        return replace(fastest, converged=False, cost=np.inf)
    by = asked / fastest.cost
    return _cheapest(fastest.problem.slowed(by), fastest.curve.stretched(by), searches)


def _cheapest(problem: Problem, curve: Curve, searches: Searches) -> Timed:
    served = not problem.objective.second_order and keeps_forces(problem, curve)
    for grid in [problem.times] if served else grids(problem):
        solved = _lazily(problem, Curve.through(problem, grid, curve(grid), curve.ends), searches)
        if not solved.outcome.converged:
            return Timed(problem, curve, False, solved.outcome.status, np.inf, searches.solves)
        problem, curve = solved.timed(problem), solved.curve
    solved, further = tighten(problem, solved, short, **searches.given)
    for one in further:
        searches.note(one)
    if not solved.outcome.converged:
        return Timed(problem, curve, False, solved.outcome.status, np.inf, searches.solves)
    searches.confirm(solved)
    problem, curve = solved.timed(problem), solved.curve
    kept = all(float(excess.max()) <= ENOUGH for excess in excesses(problem, curve).values())
    status = solved.outcome.status if kept else "exceeds a limit between its knots"
    return Timed(problem, curve, kept, status, objective(problem, curve), searches.solves)


def _lazily(problem: Problem, guess: Curve, searches: Searches) -> Solved:
    """Torque and power limits come in only where the optimum without them breaks them."""
    solved = searches.note(transcribe(without_forces(problem), guess).solve(**searches.given))
    if not solved.outcome.converged or keeps_forces(problem, solved.curve):
        return solved
    return searches.note(transcribe(solved.timed(problem), solved.curve).solve(**searches.given))
