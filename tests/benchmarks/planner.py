"""The global planner's multi-start on the Global paper's simulations beside the same multi-start in CasADi + IPOPT.

The peer gets the planner's own starts, grids, splines between grids, choice of basins and tolerances; only the solves
differ. Timed are the solves: not imports, not the drawing of the starts, not CasADi's construction of its functions.
"""

from __future__ import annotations

import sys
import time
from collections.abc import Callable
from dataclasses import dataclass, field, replace
from typing import Any
from unittest import mock

import numpy as np
from hydra import compose, initialize_config_dir

from pipeline.build.problem import prepare
from pipeline.common.arrays import Array
from pipeline.config.compose import checked
from pipeline.config.methods import GlobalOptions
from pipeline.methods.global_planner import optimum, planner
from pipeline.methods.global_planner.optimum import Optimum
from pipeline.methods.global_planner.planner import global_planner
from pipeline.methods.method import Context
from pipeline.problem.costs import objective_values
from pipeline.problem.problem import Boundary, Problem
from pipeline.problem.solution import Status
from tests.benchmarks import peer

SIMULATIONS = ("sim1", "sim2", "sim3", "sim4", "sim5")
CONVERGED = ("Solve_Succeeded", "Solved_To_Acceptable_Level")
HEAD = f"{'planner: the same multi-start':<34} {'ours [s]':>9} {'peer [s]':>9} {'ratio':>7}"


@dataclass
class Side:
    """One way to solve a program from a guess, and the time that its solves took."""

    optimise: Callable[[Problem, Array, Array, GlobalOptions], Optimum]
    seconds: float = 0.0
    starts: list[Optimum] = field(default_factory=list)
    optima: list[Optimum] = field(default_factory=list)

    def run(self, step: Callable[[Any, Any], Optimum], context: Any, item: Any) -> Optimum:
        """The planner's own `step`, every solve of it by this side."""

        def timed(*arguments: Any) -> Optimum:
            begin = time.perf_counter()
            answer = self.optimise(*arguments)
            self.seconds += time.perf_counter() - begin
            return answer

        with mock.patch.object(optimum, "_optimise", timed):
            return step(context, item)


class Peer(Side):
    """CasADi's side: one program per grid and kind of problem, made when first needed."""

    def __init__(self) -> None:
        super().__init__(self._solve)
        self.construction = 0.0
        self.programs: dict[tuple[int, bool, bool], peer.Program] = {}
        self.arm = peer.PlanarArm.from_urdf(peer.ROBOT)

    def program(self, problem: Problem, times: Array, options: GlobalOptions) -> peer.Program:
        limits, torque = problem.bounds, problem.objective.second_order
        key = (len(times), torque, bool(np.isfinite(limits.torque).any()))
        if key not in self.programs:
            begin = time.perf_counter()
            self.programs[key] = peer.Program(
                self.arm,
                times,
                problem.reference.position(times),
                torque,
                problem.boundary is Boundary.CYCLIC,
                (limits.lower, limits.upper, limits.velocity, limits.torque, limits.power),
                {
                    "tol": options.tolerance,
                    "max_iter": options.max_iterations,
                    "mu_init": 1e-3,
                    "bound_relax_factor": 0.0,
                    "constr_viol_tol": 1e-8,
                    "acceptable_tol": 1e-6,
                    "acceptable_constr_viol_tol": 1e-8,
                },
            )
            passed = time.perf_counter() - begin
            self.construction += passed
            self.seconds -= passed  # it happens within a timed solve
        return self.programs[key]

    def _solve(
        self, problem: Problem, times: Array, guess: Array, options: GlobalOptions, keep_off: float = 0.0
    ) -> Optimum:
        assert not keep_off, "the peer knows no obstacles"
        q, cost, statistics = self.program(problem, times, options).solve(guess)
        status = statistics["return_status"]
        return Optimum(q, cost, status in CONVERGED, status)


def simulation(name: str, *words: str) -> None:
    """One line for the multi-start, one for `starts=dynamic_programming` where that applies, and the optima of all."""
    with initialize_config_dir(str(peer.PROJECT / "conf"), version_base="1.3"):
        config = checked(compose("config", overrides=[f"+experiment={name}", *words]))
    problem, options = prepare(config), config.method.global_
    grids = planner.refinement(problem.times, options.coarse_steps)
    motions, _ = planner._starts(problem, grids[0], options, np.random.default_rng(config.seed))
    ours, theirs = Side(optimum._optimise), Peer()
    sides = (ours, theirs)
    for number, motion in enumerate(motions):
        for side in sides if number % 2 else sides[::-1]:
            side.starts.append(side.run(optimum.optimise_start, (problem, grids[0], options), motion))
    for side in sides:
        basins = planner._basins(problem, side.starts, options)
        fine = [side.run(optimum.refine, (problem, grids, options), side.starts[basin]) for basin in basins]
        side.optima = keep(problem, options, fine)
    counts = [sum(start.converged for start in side.starts) for side in sides]
    note = f"of {len(motions)} starts {counts[0]} and {counts[1]} converged; CasADi built its functions in"
    line(f"{name}, population", ours.seconds, theirs.seconds, f"{note} {theirs.construction:.2f} s besides")
    found = {"ours": ours.optima, "peer": theirs.optima}
    if not problem.objective.second_order:
        begin = time.perf_counter()
        solutions = global_planner(problem, replace(options, starts="dynamic_programming"), Context(config.seed))
        seconds = time.perf_counter() - begin
        grown = np.array([solution.trajectory.q for solution in solutions if solution.status is Status.SOLVED])
        costs = objective_values(problem, problem.times, grown)
        found["dp"] = [Optimum(q, float(cost), True, "") for q, cost in zip(grown, costs, strict=True)]
        line(f"{name}, dynamic_programming", seconds, theirs.seconds, "the whole planner against the same peer")
    for label, optima in found.items():
        print(f"  {label:<5}{'  '.join(f'{one.cost:.6f}' for one in optima)}")
    agreement(problem, theirs.program(problem, problem.times, options), found)


def keep(problem: Problem, options: GlobalOptions, fine: list[Optimum]) -> list[Optimum]:
    good = [optimum for optimum in fine if optimum.converged and optimum.continuous]
    return [good[index] for index in planner._distinct(good, options, problem)]


def agreement(problem: Problem, program: peer.Program, found: dict[str, list[Optimum]]) -> None:
    """Every optimum recomputed by both sides, by the peer with path and limits, and whether the lists agree."""
    everything = [optimum for optima in found.values() for optimum in optima]
    checks = [program.check(optimum.q) for optimum in everything]
    costs = objective_values(problem, problem.times, np.array([optimum.q for optimum in everything]))
    apart = max(abs(check[0] / cost - 1) for check, cost in zip(checks, costs, strict=True))
    lists = {tuple(f"{optimum.cost:.6f}" for optimum in optima) for optima in found.values()}
    print("  the lists agree" if len(lists) == 1 else "  THE LISTS DIFFER")
    print(f"  recomputed by both: costs within {apart:.0e}, path and limits kept to {max(c[1] for c in checks):.0e}")


def line(name: str, ours: float, theirs: float, note: str) -> None:
    print(f"{name:<34} {ours:9.2f} {theirs:9.2f} {ours / theirs:7.2f}   {note}", flush=True)


def main(names: list[str]) -> None:
    unknown = set(names) - set(SIMULATIONS)
    if unknown:
        sys.exit(f"{', '.join(sorted(unknown))}: not one of {', '.join(SIMULATIONS)}")
    print(HEAD)
    for name in names or SIMULATIONS:
        simulation(name)
