"""`make bench`: the project's solves beside the same programs in CasADi + IPOPT with exact Hessians, interleaved.

Prints medians and ratios. Nothing is asserted here: timings of a shared machine are no tests.
"""

from __future__ import annotations

import sys
import time
from collections.abc import Callable
from typing import Any

import numpy as np
from scipy.interpolate import CubicSpline

from pipeline.build.problem import prepare
from pipeline.config.methods import GlobalOptions, PmkeOptions
from pipeline.config.run import check
from pipeline.methods.global_planner.grids import refinement
from pipeline.methods.global_planner.planner import STEPS, global_planner
from pipeline.methods.pmke.predictive import pmke
from pipeline.methods.pmke.window import Window
from pipeline.problem.lagrangian import Lagrangian
from pipeline.program.transcription import transcribe
from tests.benchmarks import bound, peer, planner

REPEATS = 7


def timed(call: Callable[[], Any]) -> tuple[float, Any]:
    begin = time.perf_counter()
    answer = call()
    return 1e3 * (time.perf_counter() - begin), answer


def report(name: str, ours: list[float], theirs: list[float], note: str) -> None:
    ratio = np.median(np.array(ours) / np.array(theirs))
    print(f"{name:<34} {np.median(ours):9.2f} {np.median(theirs):9.2f} {ratio:7.2f}   {note}")


def predictions(repeats: int = REPEATS) -> None:
    """Every prediction of PMKE on trajectory 3, with the guesses of a real run."""
    problem = prepare(check({}))
    calls: list[tuple[Any, ...]] = []
    solve = Window.solve

    def record(self: Window, *arguments: Any, **options: Any) -> Any:
        calls.append(tuple(np.copy(argument) for argument in arguments))
        return solve(self, *arguments, **options)

    options = PmkeOptions()
    Window.solve = record  # type: ignore[method-assign]
    pmke(problem, options)
    Window.solve = solve  # type: ignore[method-assign]

    window = Window(Lagrangian(problem.task, problem.objective), options.horizon, options.prediction_step)
    arm = peer.PlanarArm.from_urdf(peer.ROBOT)
    program = peer.kinetic_energy_program(arm, options.horizon, options.prediction_step, options.tolerance)
    ours, theirs, gap = [], [], 0.0
    for _ in range(repeats):
        for call in calls:
            milliseconds, answer = timed(lambda call=call: window.solve(*call, tolerance=options.tolerance))
            ours.append(milliseconds)
            milliseconds, other = timed(lambda call=call: peer.solve(program, *call))
            theirs.append(milliseconds)
            gap = max(gap, abs(answer[1] / other[1] - 1))
    report("PMKE prediction (trajectory 3)", ours, theirs, f"{len(calls)} solves of one run; costs agree to {gap:.0e}")


def fine_solve(repeats: int = REPEATS) -> None:
    """The last stage of the global planner on trajectory 3: 101 points, 303 parameters, from the stage before."""
    problem = prepare(check({}))
    options = GlobalOptions()
    coarse = refinement(problem.times, STEPS)[-2]
    rough = global_planner(prepare(check({"timing": {"steps": len(coarse) - 1}})), options)[0]
    guess = CubicSpline(coarse, rough.trajectory.q)(problem.times)
    arm = peer.PlanarArm.from_urdf(peer.ROBOT)
    step = float(problem.times[1])
    program = peer.kinetic_energy_program(arm, len(problem.times) - 1, step, options.tolerance)
    path = problem.reference.position(problem.times[1:])
    ours, theirs = [], []
    for _ in range(repeats):
        milliseconds, (q, _, iterations) = timed(
            lambda: transcribe(problem, problem.times, guess).solve(tolerance=options.tolerance)
        )
        ours.append(milliseconds)
        milliseconds, (other, _, statistics) = timed(lambda: peer.solve(program, problem.q_init, path, guess[1:]))
        theirs.append(milliseconds)
    gap = np.abs(q[1:] - other).max()
    note = f"{iterations} and {statistics['iter_count']} iterations; motions agree to {gap:.0e} rad"
    report("fine global solve (303 parameters)", ours, theirs, note)


def main(words: list[str]) -> None:
    """Small programs and whole plans, or only `small` or `planner`, of that only the simulations named; or `bound`."""
    if words and words[0] not in ("small", "planner", "bound"):
        sys.exit(f"{words[0]}: not one of small, planner, bound")
    if words[:1] == ["bound"]:
        bound.main(words[1:])
        return
    if words[:1] != ["planner"]:
        print(f"{'medians':<34} {'ours [ms]':>9} {'peer [ms]':>9} {'ratio':>7}")
        predictions()
        fine_solve()
    if words[:1] != ["small"]:
        planner.main(words[1:])


if __name__ == "__main__":
    main(sys.argv[1:])
