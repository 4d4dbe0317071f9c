"""All starts, and all distinct optima, of one grid in one batch: Newton's method, and IPOPT's confirmation at the end.

What Newton's method does not serve (`serve.py`) is left to `optimum.py`, IPOPT alone.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from scipy.interpolate import CubicSpline

from pipeline.common.arrays import Array
from pipeline.config.methods import GlobalOptions
from pipeline.methods.global_planner.optimum import (
    STAYS,
    Optimum,
    clear_between,
    first_order,
    keeps_torque_limits,
    optimise,
    stays_on_path,
)
from pipeline.problem.costs import objective_values
from pipeline.problem.problem import Problem
from pipeline.program.confirm import confirm
from pipeline.program.newton.newton import COLD, WARM, Barrier, Newton
from pipeline.program.newton.serve import Solver, why_not

ON_PATH = 1e-8  # [m, rad] at every knot
JUMPS = 0.1  # of the path's length: an optimum that leaves it so far between coarse knots is not refined


class Batch:
    """Newton's side of one plan: the problem without its terms of second order, which it serves (see `without`)."""

    def __init__(self, problem: Problem, options: GlobalOptions) -> None:
        self.problem, self.options, self.first = problem, options, first_order(problem)
        self.solver = Solver(self.first)

    @staticmethod
    def without(problem: Problem, options: GlobalOptions) -> str | None:
        """Why IPOPT works alone; None: it does not."""
        return "method.global.solver" if options.solver == "ipopt" else why_not(first_order(problem))

    def coarse(self, times: Array, guesses: Array) -> list[Optimum]:
        """Of every guess (S, N + 1, n) the first-order problem's optimum on a coarse grid."""
        return _solve(self.solver.on(times), guesses, COLD)

    def refine(self, grids: list[Array], basins: list[Optimum]) -> list[Optimum | None]:
        """The first grid's optima on the last, as IPOPT leaves them; None: lost, or torque limits matter."""
        on = grids[0]
        refined: list[Optimum | None] = [
            self._whether_continuous(on, optimum, JUMPS) if self._keeps(on, optimum) else None for optimum in basins
        ]
        for fine in grids[1:]:
            newton = self.solver.on(fine)
            going = [(k, optimum) for k, optimum in enumerate(refined) if optimum is not None and optimum.continuous]
            if not going:
                break
            guesses = CubicSpline(on, np.array([optimum.q for _, optimum in going]), axis=1)(fine)
            found = _solve(newton, guesses, WARM)
            lost = [k for k, optimum in enumerate(found) if not optimum.converged and newton.limits]
            for k, again in zip(lost, _solve(newton, guesses[lost], COLD), strict=True):
                found[k] = replace(again, solves=found[k].solves + again.solves)
            for (k, before), finer in zip(going, found, strict=True):
                refined[k] = replace(finer, solves=before.solves + finer.solves) if self._keeps(fine, finer) else None
            on = fine
        return [optimum and self._finish(on, optimum) for optimum in refined]

    def _keeps(self, times: Array, optimum: Optimum) -> bool:
        return optimum.converged and keeps_torque_limits(self.problem, times, optimum.q)

    def _whether_continuous(self, times: Array, optimum: Optimum, share: float) -> Optimum:
        return replace(optimum, continuous=stays_on_path(self.problem, times, optimum.q, share))

    def _finish(self, times: Array, optimum: Optimum) -> Optimum | None:
        """IPOPT's last word on an optimum; one that jumps between its knots is not worth it."""
        optimum = self._whether_continuous(times, optimum, STAYS) if optimum.continuous else optimum
        if not optimum.continuous:
            return optimum
        options, keep_off = self.options, 0.0
        if self.first.obstacles is not None:
            optimum, keep_off = clear_between(
                self.first.task.arm,
                self.first.obstacles,
                times,
                optimum,
                lambda q, keep_off: _solve(self.solver.on(times, keep_off), q[None], WARM)[0],
            )
            if not optimum.converged:
                return None
        told = confirm(
            self.first,
            times,
            optimum.q,
            tolerance=options.tolerance,
            max_iterations=options.max_iterations,
            keep_off=keep_off,
        )
        entry = {"solver": "ipopt", "intervals": len(times) - 1, "iterations": told.iterations, "moved": told.moved}
        entry |= {"wall_time_s": told.wall_time, "status": told.status}
        if told.converged:
            cost = float(objective_values(self.problem, times, told.q[None])[0])
            solves = [*optimum.solves, {**entry, "cost": cost}]
            return replace(optimum, q=told.q, cost=cost, status=told.status, solves=solves)
        final = optimise(self.first, times, optimum.q, options, keep_off)
        final = replace(final, solves=[*optimum.solves, {**entry, "cost": optimum.cost}, *final.solves])
        return self._whether_continuous(times, final, STAYS) if self._keeps(times, final) else None


def _solve(newton: Newton, guesses: Array, barrier: Barrier) -> list[Optimum]:
    """One batch; each start's share of its time is the same."""
    answer = newton.solve(guesses, barrier)
    optima = []
    for q, cost, converged, iterations, residual in zip(
        answer.q, answer.cost, answer.converged, answer.iterations, answer.residual, strict=True
    ):
        good = bool(converged and residual <= ON_PATH)
        entry = {
            "solver": "newton",
            "intervals": q.shape[0] - 1,
            "iterations": int(iterations),
            "wall_time_s": answer.wall_time / len(answer.q),
            "status": "success" if good else "lost",
            "cost": float(cost),
        }
        optima.append(Optimum(q, float(cost), good, str(entry["status"]), solves=[entry]))
    return optima
