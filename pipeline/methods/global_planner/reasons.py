"""What speaks for the planner's motions, or why it has none, in one line: what was tried, how near it came, what else
to try.
"""

from __future__ import annotations

from collections import Counter

import numpy as np

from pipeline.common.arrays import Array
from pipeline.config.methods import GlobalOptions
from pipeline.evaluation.certified import Closest, said
from pipeline.methods.global_planner.grids import finer
from pipeline.methods.global_planner.optimum import Optimum
from pipeline.model.kinematics import ATTEMPTS, reach
from pipeline.problem.problem import Problem
from pipeline.problem.resolution import MOST
from pipeline.program.feasibility import Relaxed, violations
from pipeline.search.barred import barred

OTHERS = "more starts (method.global.optimised) or other ones (method.global.starts)"

REACHED = 1e-6  # [m, rad]

NODES = 1000  # of the longest self-motion manifold


def counted(optima: int, starts: int, barren: int, left: int = 0, lost: int = 0) -> str:
    """How many optima came of how many starts; `left` dearer ones were not carried to the long path's knots, and `lost`
    came too near to the arm itself and were not, or not well, solved again.
    """
    count = f"{optima} distinct {_named(optima)} found from {starts} starts"
    dearer = f"{left} dearer one{'s' if left > 1 else ''} of the coarse grid not refined; " if left else ""
    near = f"{lost} more left out, too near to the arm itself; " if lost else ""
    return f"{count}; the last {barren} starts brought nothing new; {dearer}{near}"


def _named(count: int) -> str:
    return "optimum" if count == 1 else "optima"


def on_how_many(problem: Problem, asked: int, options: GlobalOptions, motions: list[Array]) -> str:
    """That the grid is not the one that was asked for, and not the one that would do."""
    count = len(problem.times) - 1
    said = f"on {count} intervals: the {asked} of timing.steps are too few for path.tolerance" * (count > asked)
    more = options.refine_to is not None and finer(problem, MOST, motions) is not None
    return "; ".join(filter(None, [said, f"method.global.refine_to = {options.refine_to} allows no more" * more]))


def no_start(problem: Problem, drawn: int) -> str:
    """Of `drawn` motions none follows the path to its end, or dynamic programming has none (0). That the arm does not
    reach the path is said only where that is so.
    """
    if not problem.task.arm.base.count:  # a base that moves goes along
        left = reach(problem.task, problem.q_init, problem.reference.position(problem.times), REACHED)[1]
        out = np.flatnonzero(left > REACHED)
        if out.size:
            return (
                f"the path leaves the reach of the arm, first at t = {problem.times[out[0]]:.3g} s: the nearest of "
                f"{ATTEMPTS} attempts misses it by up to {left.max():.3g} {_unit(problem)}"
            )
    if not drawn:
        return f"no path through the grid of dynamic programming keeps the limits; try {OTHERS}"
    return (
        f"none of {drawn} motions that were drawn follows the path to its end; try other ones (method.global.starts), "
        "more of them (method.global.candidates), or another robot.q_init: from a singular one many get stuck"
    )


def no_place(problem: Problem, times: Array) -> str:
    """That at some place of the path no configuration is within the position limits, where r = 1 lets that be seen at
    the knots `times`; else nothing.
    """
    bounds = problem.bounds
    limited = bool(np.isfinite(bounds.lower).any() or np.isfinite(bounds.upper).any())
    if problem.task.redundancy != 1 or problem.task.arm.base.count or not limited:
        return ""
    found = barred(problem, times, NODES)
    return "" if found is None else found.sentence


def no_feasible(starts: int, relaxed: Relaxed) -> str:
    """None of so many starts led to a motion that keeps its limits, nor did the attempts to exceed them least."""
    led = f"none of {starts} starts led to one" if starts > 1 else "the one start did not lead to one"
    return f"no feasible motion found: {led}, and {relaxed.sentence}; ease that limit, or try {OTHERS}"


def no_optimum(problem: Problem, grid: Array, starts: list[Optimum], refined: list[Optimum], jumping: int = 0) -> str:
    """There are starts, on `grid`, but no optimum: why, in the solver's own words. `jumping` were not refined."""
    if any(start.converged for start in starts):
        fates = {_fate(optimum) if not optimum.converged else "jumps between branches" for optimum in refined}
        fates |= {"jumps between branches"} if jumping else set()
        lost = len(refined) + jumping
        return (
            f"{lost} {_named(lost)} of the coarse grid {'was' if lost == 1 else 'were'} lost on a finer one "
            f"({'; '.join(sorted(fates))}); "
            "try more knots (timing.steps, method.global.coarse_steps)"
        )
    words = Counter(start.status for start in starts).most_common(1)[0][0]
    return (
        f"none of {len(starts)} starts converged (most often: {words}){_nearest(problem, grid, starts)}; "
        f"try more iterations (method.global.max_iterations), {OTHERS}"
    )


def too_near(problem: Problem, optima: int, closest: Closest) -> str:
    """Every optimum comes too near to the arm itself, and none does where it has to keep off: which pair, which key."""
    own = problem.own
    assert own is not None
    lost = "the optimum found comes" if optima == 1 else f"all {optima} optima found come"
    return (
        f"{lost} too near to the arm itself ({said(closest)}, collision.margin = {own.margin:.3g} m), and where that "
        "is kept none was found; if their shapes are at fault, say so: "
        f"collision.allow=[[{closest.first},{closest.second}]], a smaller collision.margin or an SRDF "
        "(collision.srdf); if not, move the path"
    )


def unmet(status: str, violation: float, optimality: float) -> str:
    """How a solve ended that did not converge, with what it could not meet and by how much."""
    return f"{status}: its constraints hold to {violation:.0e}, its optimality to {optimality:.0e}"


def _fate(optimum: Optimum) -> str:
    told = optimum.solves[-1] if optimum.solves else {}
    if "optimality" not in told:
        return optimum.status
    words = f"{optimum.status} on {told['intervals']} intervals"
    return unmet(words, told["violation"], told["optimality"])


def _nearest(problem: Problem, grid: Array, starts: list[Optimum]) -> str:
    """How far the attempt that ended nearest to its path is from it, and from its limits."""
    ended = [start.q for start in starts if np.isfinite(start.q).all()]
    if not ended:
        return ""
    wanted = problem.reference.position(grid)
    left = [float(np.abs(problem.task.error(q, wanted)).max()) for q in ended]
    best = int(np.argmin(left))
    worst = max(violations(problem, grid, ended[best]), key=lambda violation: violation.relative, default=None)
    beyond = "" if worst is None or worst.relative <= REACHED else f" and exceeds {worst.bound} by {worst.extent}"
    return f"; the best attempt is {left[best]:.2g} {_unit(problem)} off its path{beyond}"


def _unit(problem: Problem) -> str:
    return "m or rad" if problem.task.m > len(problem.task.axes) else "m"
