"""How the planner's time grows with knots and starts, and how its success grows with starts.

Knots: the best motion of an experiment, from the spline of the grid before, by Newton's method and IPOPT's
confirmation, and by the peer. Plans: whole ones of eight starts, on grids each twice as fine. Starts: one batch on the
first grid, random paths of the roadmap. Success: of the suite's problems, how many starts find the best and which share
of all known optima. Timed is processor time.
"""

from __future__ import annotations

import sys
import time
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np
import pandas as pd
from scipy.interpolate import CubicSpline

from pipeline.build.problem import prepare
from pipeline.common.arrays import Array
from pipeline.config.methods import GlobalOptions
from pipeline.methods.global_planner.optimum import first_order
from pipeline.methods.global_planner.planner import STEPS, global_planner
from pipeline.problem.costs import objective_values
from pipeline.problem.problem import Problem
from pipeline.program.confirm import Confirm
from pipeline.program.newton.newton import WARM
from pipeline.program.newton.serve import Solver
from pipeline.search.roadmap import Roadmap
from tests.benchmarks.planner import Peer
from tests.suite.planar import FILE
from tests.support import composed

PARTS = ("knots", "plans", "starts", "success")
KNOTS, STARTS, LOTS = (25, 50, 100, 200, 400, 1000), (1, 4, 16, 48, 96, 192), (1, 2, 4, 8, 16, 32, 64)
SPIRAL = Path(__file__).parents[1] / "suite" / "problems" / "spiral300.csv"
PLANS = {
    "planar3r, line": (250, "path.length=0.25", "path.direction=170", "timing.duration=4"),
    "panda, line": (250, "+experiment=panda"),
    "xarm7, spiral of 300 way-points": (
        *(1000, "robot=xarm7", "robot.q_init=null", "path=waypoints", f"path.file={SPIRAL}"),
        *("limits=joint", "timing.duration=60", "boundary.rest=[]"),
    ),
}
SAME = 1e-4  # relative: costs of one optimum
REPEATS = 5


def milliseconds(call: object, repeats: int) -> float:
    spent = []
    for _ in range(repeats):
        begin = time.process_time()
        call()  # type: ignore[operator]
        spent.append(1e3 * (time.process_time() - begin))
    return float(np.median(spent))


def problem_of(name: str) -> Problem:
    """An experiment without what counts to second order."""
    return first_order(prepare(composed(f"+experiment={name}")))


def grid(problem: Problem, intervals: int) -> Array:
    return np.linspace(problem.times[0], problem.times[-1], intervals + 1)


def best(problem: Problem, intervals: int) -> Array:
    """The cheapest motion (N + 1, n) of a few starts on so many intervals."""
    times = grid(problem, intervals)
    starts = Roadmap(problem, times, np.random.default_rng(1)).cheapest(16)
    answer = Solver(problem).on(times).solve(starts)
    found: Array = answer.q[np.argmin(np.where(answer.converged, answer.cost, np.inf))]
    return found


def knots(name: str, sizes: tuple[int, ...] = KNOTS, repeats: int = REPEATS) -> None:
    """One row for each size."""
    problem, options = problem_of(name), GlobalOptions()
    q, on, solver = best(problem, sizes[0]), grid(problem, sizes[0]), Solver(problem)
    print(f"{name}: knots   newton [ms]  with IPOPT  a knot [us]   peer [ms]   ratio")
    for size in sizes:
        times = grid(problem, size)
        fine = replace(problem, times=times)
        guess, newton, confirm = CubicSpline(on, q)(times), solver.on(times), Confirm(fine, times, 1e-8, 200)

        def both(newton=newton, confirm=confirm, guess=guess) -> None:  # type: ignore[no-untyped-def]
            found = newton.solve(guess[None], WARM)
            assert confirm(found.q[0], float(found.cost[0])).converged

        peers = Peer().program(fine, times, options)
        confirm(guess, 1.0)  # the plain program is made
        alone = milliseconds(lambda newton=newton, guess=guess: newton.solve(guess[None], WARM), repeats)
        ours = milliseconds(both, repeats)
        theirs = milliseconds(lambda peers=peers, guess=guess: peers.solve(guess), repeats)
        q, on = newton.solve(guess[None], WARM).q[0], times
        per_knot = 1e3 * ours / size
        print(
            f"{'':<6}{size:8d} {alone:12.1f} {ours:11.1f} {per_knot:12.0f} {theirs:11.1f} {ours / theirs:7.2f}",
            flush=True,
        )


def plans(names: Sequence[str] = tuple(PLANS), doublings: int = 2, repeats: int = 3) -> None:
    """One row for each problem: seconds on N, 2 N, 4 N intervals, interleaved, and each over the one before."""
    options = GlobalOptions(optimised=8, budget=8)
    print("plans: intervals   seconds   each over the one before")
    for name in names:
        first, *words = PLANS[name]
        sizes = [int(first) * 2**k for k in range(doublings + 1)]
        problems = [prepare(composed(*map(str, words), f"timing.steps={size}")) for size in sizes]
        spent = np.array(
            [
                [milliseconds(lambda one=one: global_planner(one, options), 1) for one in problems]
                for _ in range(repeats)
            ]
        )
        took = np.median(spent, axis=0) / 1e3
        seconds, ratios = (" ".join(f"{value:.2f}" for value in row) for row in (took, took[1:] / took[:-1]))
        print(f"{name}: {' '.join(map(str, sizes))}   {seconds}   {ratios}", flush=True)


def starts(name: str, sizes: tuple[int, ...] = STARTS, repeats: int = REPEATS) -> None:
    """One row for each number of starts."""
    problem = problem_of(name)
    times = grid(problem, STEPS)
    motions = Roadmap(problem, times, np.random.default_rng(1)).random(max(sizes))
    newton, peers = Solver(problem).on(times), Peer().program(replace(problem, times=times), times, GlobalOptions())
    print(f"{name}: starts   ours [ms]   each [ms]   peer's each   ratio")
    few = motions[:: max(1, len(motions) // 16)]
    theirs = float(np.mean([milliseconds(lambda q=q: peers.solve(q), 1) for q in few]))
    for size in sizes:
        some = motions[:size]
        ours = milliseconds(lambda some=some: newton.solve(some), repeats) / len(some)
        print(
            f"{'':<6}{len(some):9d} {ours * len(some):11.1f} {ours:11.2f} {theirs:13.2f} {ours / theirs:7.2f}",
            flush=True,
        )


def success(names: list[str] | None = None, lots: tuple[int, ...] = LOTS) -> None:
    """One row for each number of starts; the last is the planner as it is by default."""
    known = pd.read_csv(FILE, quotechar='"').set_index("name")
    print("success: starts   the best is found   known optima found   starts spent")
    for lot in (*lots, None):
        options = GlobalOptions(refine_to=None)
        if lot is not None:
            options = replace(options, optimised=lot, budget=lot)
        hits = found = total = spent = 0
        names = names or [str(name) for name in known.index]
        for name in names:
            problem = prepare(composed(*(word.strip("'") for word in known.loc[name, "command"].split("' '"))))
            solutions = global_planner(problem, options)
            spent += len(solutions[0].statistics.get("starts", []))
            ours = [objective_values(problem, problem.times, s.trajectory.q[None])[0] for s in solutions if s.found]
            costs = [float(cost) for cost in str(known.loc[name, "optima"]).split()]
            near = [any(abs(cost / other - 1) < SAME for other in ours) for cost in costs]
            hits, found, total = hits + near[0], found + sum(near), total + len(near)
        label = "default" if lot is None else str(lot)
        print(
            f"{label:>15} {hits:11d} of {len(names):3d} {found:12d} of {total:4d} {spent / len(names):14.0f}",
            flush=True,
        )


def main(words: list[str]) -> None:
    """All parts, or those named."""
    unknown = set(words) - set(PARTS)
    if unknown:
        sys.exit(f"{', '.join(sorted(unknown))}: not one of {', '.join(PARTS)}")
    for word in words or PARTS:
        if word in ("plans", "success"):
            {"plans": plans, "success": success}[word]()
            continue
        for name in ("sim1", "panda"):
            {"knots": knots, "starts": starts}[word](name)
