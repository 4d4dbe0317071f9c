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
from pipeline.program.confirm import Confirm, Confirmation
from pipeline.program.newton.newton import WARM
from pipeline.program.newton.serve import Solver
from tests.benchmarks import bound, peer, planner, scaling, updates

REPEATS = 7


def timed(call: Callable[[], Any]) -> tuple[float, Any]:
    begin = time.process_time()
    answer = call()
    return 1e3 * (time.process_time() - begin), answer


def report(name: str, ours: list[float], theirs: list[float], note: str) -> None:
    ratio = np.median(np.array(ours) / np.array(theirs))
    print(f"{name:<40} {np.median(ours):9.2f} {np.median(theirs):9.2f} {ratio:7.2f}   {note}")


def predictions(repeats: int = REPEATS) -> None:
    """Every window of PMKE that IPOPT solves on trajectory 3: as it comes from a real run."""
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
    program = peer.kinetic_energy_program(arm, options.horizon, options.prediction_step, options.tolerance, expand=True)
    ours, theirs, gap = [], [], 0.0
    for _ in range(repeats):
        for call in calls:
            milliseconds, answer = timed(lambda call=call: window.solve(*call, tolerance=options.tolerance))
            ours.append(milliseconds)
            milliseconds, other = timed(lambda call=call: peer.solve(program, *call))
            theirs.append(milliseconds)
            gap = max(gap, abs(answer[1] / other[1] - 1))
    report("PMKE prediction (trajectory 3)", ours, theirs, f"{len(calls)} solves of one run; costs agree to {gap:.0e}")


def fine_solve(repeats: int = REPEATS, steps: int = 100) -> None:
    """The last stage of the global planner on trajectory 3 from the spline of the stage before, IPOPT's confirmation
    included; processor time. The peer expanded to SX, and as it is first written, in MX.
    """
    problem = prepare(check({"timing": {"steps": steps}}))
    options = GlobalOptions(refine_to=None, optimised=8, budget=8)
    coarse = refinement(problem.times, STEPS)[-2]
    rough = global_planner(prepare(check({"timing": {"steps": len(coarse) - 1}})), options)[0]
    guess = CubicSpline(coarse, rough.trajectory.q)(problem.times)
    arm = peer.PlanarArm.from_urdf(peer.ROBOT)
    step = float(problem.times[1])
    intervals, path = len(problem.times) - 1, problem.reference.position(problem.times[1:])
    programs = [
        peer.kinetic_energy_program(arm, intervals, step, options.tolerance, expand=expand) for expand in (True, False)
    ]
    newton = Solver(problem).on(problem.times)
    confirm = Confirm(problem, problem.times, options.tolerance, options.max_iterations)

    def fine() -> Confirmation:
        found = newton.solve(guess[None], WARM)
        return confirm(found.q[0], float(found.cost[0]))

    ours, theirs = [], ([], [])
    for _ in range(repeats):
        milliseconds, told = timed(fine)
        ours.append(milliseconds)
        for program, all_times in zip(programs, theirs, strict=True):
            milliseconds, (other, _, statistics) = timed(
                lambda program=program: peer.solve(program, problem.q_init, path, guess[1:])
            )
            all_times.append(milliseconds)
    gap = np.abs(told.q[1:] - other).max()
    note = f"{told.iterations} and {statistics['iter_count']} iterations of IPOPT; motions agree to {gap:.0e} rad"
    for form, milliseconds in zip(("SX", "MX"), theirs, strict=True):
        report(f"fine solve ({problem.times.size} knots), peer in {form}", ours, milliseconds, note)


def small() -> None:
    """Solves of one program."""
    print(f"{'medians':<40} {'ours [ms]':>9} {'peer [ms]':>9} {'ratio':>7}")
    predictions()
    fine_solve()


PARTS: dict[str, Callable[[list[str]], None]] = {
    "small": lambda _: small(),
    "updates": updates.main,
    "planner": planner.main,
    "scaling": scaling.main,
    "bound": bound.main,
}


def main(words: list[str]) -> None:
    """Small programs, whole plans and how they scale; or one part, and of that only what is named behind it."""
    if words and words[0] not in PARTS:
        sys.exit(f"{words[0]}: not one of {', '.join(PARTS)}")
    for part in words[:1] or ["small", "updates", "planner", "scaling"]:
        PARTS[part](words[1:])


if __name__ == "__main__":
    main(sys.argv[1:])
