"""All starts, and the distinct optima found, of one grid in one batch: Newton's method, then IPOPT's confirmation.

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
    STRAYED,
    Optimum,
    clear_between,
    first_order,
    goes_on,
    has_strayed,
    keeps_torque_limits,
    optimise,
    stays_on_path,
    strays,
)
from pipeline.problem.costs import objective_values
from pipeline.problem.problem import Problem
from pipeline.problem.resolution import path_error
from pipeline.program.confirm import Confirm
from pipeline.program.newton.newton import COLD, WARM, Barrier, Newton
from pipeline.program.newton.serve import Solver, why_not

ON_PATH = 1e-8  # [m, rad] at every knot
JUMPS = 0.1  # of the path's length: an optimum that leaves it so far between coarse knots is not refined
NEARER = 0.5  # times as far off its path a motion is on twice as many knots; others are by a tenth
OWN = 2.0  # times as far off the path as the path's own spline on the same knots: the knots are too few, nothing jumps
SMOOTH = 0.003  # of the path's length: an optimum that leaves it farther and is lost on a finer grid has jumped


class Batch:
    """Newton's side of one plan: the problem without its terms of second order first (see `without`), and where these
    matter the whole one, if it serves that too (`alone`: why not).
    """

    def __init__(self, problem: Problem, options: GlobalOptions) -> None:
        self.problem, self.options, self.first = problem, options, first_order(problem)
        self.alone = why_not(problem)
        self.solver = Solver(self.first)
        self.whole = self.solver if self.first is problem or self.alone else Solver(problem)

    @property
    def cheap(self) -> bool:
        """Whether a start costs no more than its part of one batch."""
        return self.first is self.problem and not self.problem.keeps_clear

    @staticmethod
    def without(problem: Problem, options: GlobalOptions) -> str | None:
        """Why IPOPT works alone; None: it does not."""
        return "method.global.solver" if options.solver == "ipopt" else why_not(first_order(problem))

    @property
    def words(self) -> str:
        """Who solves, for the log."""
        return "newton, confirmed by ipopt" + (
            f"; ipopt alone where torques matter ({self.alone})" if self.alone else ""
        )

    def coarse(self, times: Array, guesses: Array, dear: float = np.inf) -> list[Optimum]:
        """Of every guess (S, N + 1, n) the first-order problem's optimum on a coarse grid; not if it costs `dear`."""
        return _solve(self.solver.on(times), guesses, COLD, dear)

    def further(self, times: Array, firsts: list[Optimum]) -> list[Optimum | None]:
        """From the first-order problem's optima to those of the problem itself; None: lost, or not served."""
        where = [k for k, first in enumerate(firsts) if not self._suffices(times, first) and not self.alone]
        found = iter(_solve(self.whole.on(times), np.array([firsts[k].q for k in where]), COLD) if where else [])
        out: list[Optimum | None] = []
        for k, first in enumerate(firsts):
            optimum = next(found) if k in where else first if self._suffices(times, first) else None
            if optimum is not None and optimum is not first:
                optimum = goes_on(self.problem, times, first, optimum) if optimum.converged else None
            out.append(optimum)
        return out

    def refine(self, grids: list[Array], basins: list[Optimum]) -> list[Optimum | None]:
        """The first grid's optima on the last, as IPOPT leaves them; None: lost, or not served."""
        on = grids[0]
        refined: list[Optimum | None] = [self._begun(on, optimum) for optimum in basins]
        for fine in grids[1:]:
            going = [(k, optimum) for k, optimum in enumerate(refined) if optimum is not None and optimum.continuous]
            for first in (True, False):
                part = [pair for pair in going if self._suffices(on, pair[1]) is first]
                if not part:
                    continue
                found = self._finer(first, on, fine, [optimum for _, optimum in part])
                for (k, before), finer in zip(part, found, strict=True):
                    refined[k] = finer and replace(finer, solves=before.solves + finer.solves)
                    if first and self._has_jumped((on, before), (fine, finer)):
                        refined[k] = replace(finer or before, continuous=False)
            on = fine
        given = self.options.tolerance, self.options.max_iterations
        confirms = Confirm(self.first, on, *given), Confirm(self.problem, on, *given)
        return [optimum and self._finish(on, optimum, *confirms) for optimum in refined]

    def finish_near(self, times: Array, optimum: Optimum) -> Optimum | None:
        """The optimum of the problem near one that falls short of its margins; None: lost, or not served."""
        if not self._suffices(times, optimum):
            return None
        given = self.options.tolerance, self.options.max_iterations
        return self._finish(times, optimum, Confirm(self.first, times, *given), Confirm(self.problem, times, *given))

    def _begun(self, times: Array, optimum: Optimum) -> Optimum | None:
        if self._suffices(times, optimum):
            return self._whether_continuous(times, optimum, JUMPS)
        return None if self.alone else optimum

    def _finer(self, first: bool, on: Array, fine: Array, optima: list[Optimum]) -> list[Optimum | None]:
        """Optima on the grid `on` as they are on `fine`, of the first-order problem or of the whole one."""
        newton = (self.solver if first else self.whole).on(fine)
        guesses = CubicSpline(on, np.array([optimum.q for optimum in optima]), axis=1)(fine)
        found = _solve(newton, guesses, WARM)
        lost = [k for k, optimum in enumerate(found) if not optimum.converged and newton.limits]
        for k, again in zip(lost, _solve(newton, guesses[lost], COLD), strict=True):
            found[k] = replace(again, solves=found[k].solves + again.solves)
        if not first:
            pairs = zip(guesses, found, strict=True)
            return [None if not one.converged or has_strayed(self.problem, fine, q, one) else one for q, one in pairs]
        return [one if self._suffices(fine, one) else self._again(fine, one) for one in found]

    def _again(self, times: Array, first: Optimum) -> Optimum | None:
        """Where torque limits matter after all."""
        return self.further(times, [first])[0] if first.converged else None

    def _suffices(self, times: Array, optimum: Optimum) -> bool:
        """Whether an optimum without torques is one of the problem."""
        return (
            optimum.converged
            and not self.problem.objective.second_order
            and keeps_torque_limits(self.problem, times, optimum.q)
        )

    def _has_jumped(self, coarse: tuple[Array, Optimum], fine: tuple[Array, Optimum | None]) -> bool:
        """Whether an optimum was one of its coarse knots alone: finer ones lose it, make it dear, or leave it as far
        off its path between them.
        """
        (times, finer), before = fine, strays(self.problem, coarse[0], coarse[1].q)
        reference = self.problem.reference
        if finer is None:
            return before > max(SMOOTH * reference.geometry.length, OWN * path_error(self.problem, coarse[0])[0])
        follows = max(reference.tolerance, NEARER * before, OWN * path_error(self.problem, times)[0])
        return finer.cost > STRAYED * coarse[1].cost or strays(self.problem, times, finer.q) > follows

    def _whether_continuous(self, times: Array, optimum: Optimum, share: float) -> Optimum:
        return replace(optimum, continuous=stays_on_path(self.problem, times, optimum.q, share))

    def _finish(self, times: Array, optimum: Optimum, loose: Confirm, whole: Confirm) -> Optimum | None:
        """IPOPT's last word on an optimum; one that jumps between its knots is not worth it."""
        optimum = self._whether_continuous(times, optimum, STAYS) if optimum.continuous else optimum
        if not optimum.continuous:
            return optimum
        confirm, keep_off = loose if self._suffices(times, optimum) else whole, 0.0
        if self.first.keeps_clear:
            optimum, keep_off = clear_between(
                self.first,
                times,
                optimum,
                lambda q, keep_off: _solve(self.solver.on(times, keep_off), q[None], WARM)[0],
            )
            if not optimum.converged:
                return None
        told = confirm(optimum.q, optimum.cost, keep_off)
        entry = {"solver": "ipopt", "intervals": len(times) - 1, "iterations": told.iterations, "moved": told.moved}
        entry |= {"wall_time_s": told.wall_time, "status": told.status}
        entry |= {"violation": told.violation, "optimality": told.optimality}
        if told.converged:
            cost = float(objective_values(self.problem, times, told.q[None])[0])
            solves = [*optimum.solves, {**entry, "cost": cost}]
            return replace(optimum, q=told.q, cost=cost, status=told.status, solves=solves)
        final = optimise(confirm.problem, times, optimum.q, self.options, keep_off)
        final = replace(final, solves=[*optimum.solves, {**entry, "cost": optimum.cost}, *final.solves])
        return self._whether_continuous(times, final, STAYS) if final.converged else None


def _solve(newton: Newton, guesses: Array, barrier: Barrier, dear: float = np.inf) -> list[Optimum]:
    """One batch; each start's share of its time is the same."""
    answer = newton.solve(guesses, barrier, dear=dear)
    optima = []
    for q, cost, converged, nearly, iterations, residual, too_dear in zip(
        answer.q,
        answer.cost,
        answer.converged,
        answer.nearly,
        answer.iterations,
        answer.residual,
        answer.dear,
        strict=True,
    ):
        good = bool((converged and residual <= ON_PATH) or nearly)  # IPOPT ends what is nearly there
        entry = {
            "solver": "newton",
            "intervals": q.shape[0] - 1,
            "iterations": int(iterations),
            "wall_time_s": answer.wall_time / len(answer.q),
            "status": "success" if good else "too dear" if too_dear else "lost",
            "cost": float(cost),
        }
        optima.append(Optimum(q, float(cost), good, str(entry["status"]), solves=[entry]))
    return optima
