"""Whole plans on the experiments beside those of CasADi + IPOPT with exact Hessians, interleaved.

The peer gets the first lot of the planner's own starts, grids, splines between grids, choice of basins and tolerances;
only the solves differ: ours are batches of Newton's method with IPOPT's confirmation. Timed is processor time, not the
imports, not the drawing of the starts, and not the peer's construction of its functions.
"""

from __future__ import annotations

import sys
import time
from collections.abc import Callable
from dataclasses import replace
from unittest import mock

import numpy as np

from pipeline.build.problem import prepare
from pipeline.common.arrays import Array
from pipeline.config.methods import GlobalOptions
from pipeline.methods.global_planner import optimum, planner
from pipeline.methods.global_planner.basins import basins
from pipeline.methods.global_planner.batch import JUMPS, Batch
from pipeline.methods.global_planner.grids import refinement
from pipeline.methods.global_planner.optimum import Optimum
from pipeline.methods.global_planner.starts import Starts
from pipeline.methods.method import Context
from pipeline.problem.costs import objective_values
from pipeline.problem.problem import Problem
from tests.benchmarks import floating, peer
from tests.benchmarks.spatial import SpatialArm
from tests.support import composed

EXPERIMENTS = (
    *("sim1", "sim2", "sim3", "sim4", "sim5", "traj1", "traj2", "traj3", "traj4"),
    *("planar4r", "panda", "panda_pose", "xarm7", "floating3r"),
)
ROADMAP = ("method.global.starts=roadmap", "method.global.coarse_steps=null")  # not the paper's starts and grid
CONVERGED = ("Solve_Succeeded", "Solved_To_Acceptable_Level")
HEAD = f"{'planner: whole plans':<24} {'ours [ms]':>9} {'peer [ms]':>9} {'ratio':>7} {'starts [ms]':>11}"
REPEATS = 3


def peer_arm(problem: Problem) -> peer.PlanarArm | SpatialArm:
    """A planar arm's own equations are the faster ones."""
    planar = problem.task.m == 2
    return peer.PlanarArm.from_urdf(problem.task.arm.description.file) if planar else SpatialArm(problem.task)


class Peer:
    """CasADi's programs, one per grid and kind of problem, made when first needed; that time is not counted."""

    def __init__(self) -> None:
        self.construction = 0.0
        self.programs: dict[tuple[int, bool, bool], peer.Program | floating.Program] = {}

    def program(self, problem: Problem, times: Array, options: GlobalOptions) -> peer.Program | floating.Program:
        limits, torque = problem.bounds, problem.objective.weight("torque") > 0
        key = (len(times), torque, bool(np.isfinite(limits.torque).any()))
        if key not in self.programs:
            begin = time.process_time()
            path = problem.reference.position(times)
            given = {
                "tol": options.tolerance,
                "max_iter": options.max_iterations,
                "mu_init": 1e-3,
                "bound_relax_factor": 0.0,
                "constr_viol_tol": 1e-8,
                "acceptable_tol": 1e-6,
                "acceptable_constr_viol_tol": 1e-8,
            }
            if problem.task.arm.base.count:
                self.programs[key] = floating.Program(times, path, problem.q_init, given)
            else:
                arm = peer_arm(problem)
                self.programs[key] = peer.Program(
                    arm,
                    times,
                    arm.targets(path) if isinstance(arm, SpatialArm) else path,
                    problem.q_init,
                    torque,
                    problem.boundary.value,
                    (limits.lower, limits.upper, limits.velocity, limits.torque, limits.power),
                    given,
                )
            self.construction += time.process_time() - begin
        return self.programs[key]

    def optimise(
        self, problem: Problem, times: Array, guess: Array, options: GlobalOptions, keep_off: float = 0.0
    ) -> Optimum:
        """What `optimum.optimise` does by Drake's IPOPT."""
        assert not keep_off, "the peer knows no obstacles"
        q, cost, statistics = self.program(problem, times, options).solve(guess)
        status = statistics["return_status"]
        return Optimum(q, cost, status in CONVERGED, status)


class Plan:
    """One problem, its starts, and both sides' way from them to all optima."""

    def __init__(self, name: str, *words: str) -> None:
        usual = (f"+experiment={name}", *(ROADMAP if name.startswith("traj") else ()))
        config = composed(*usual, "collision.self=false", *words)  # the peer knows no distances
        self.problem, self.options = prepare(config), config.method.of("global")
        self.alone = Batch.without(self.problem, replace(self.options, solver="newton"))
        coarse = planner.STEPS_ALONE if self.alone else planner.STEPS
        self.grids = refinement(self.problem.times, self.options.coarse_steps or coarse)
        begin = time.process_time()
        self.motions = Starts(self.problem, self.grids[0], self.options, np.random.default_rng(config.seed)).first
        self.drawn = time.process_time() - begin
        self.peer = Peer()

    def ours(self) -> list[Optimum]:
        """The planner's own steps."""
        problem, grids, options = self.problem, self.grids, self.options
        batch, context = None if self.alone else Batch(problem, options), Context()
        starts = planner._optimise_starts(problem, grids[0], options, self.motions, batch, context)
        return self._kept(planner._refine_all(problem, grids, options, self._basins(starts), batch, context))

    def theirs(self) -> list[Optimum]:
        """The same steps, every solve by the peer."""
        problem, grids, options = self.problem, self.grids, self.options
        first = optimum.first_order(problem)
        with mock.patch.object(optimum, "optimise", self.peer.optimise):
            starts = [self.peer.optimise(first, grids[0], motion, options) for motion in self.motions]
            chosen = self._basins(starts)
            if first is not problem:
                starts = [optimum.go_on((problem, grids[0], options), start) for start in chosen]
                chosen = self._basins(starts)
            return self._kept([optimum.refine((problem, grids, options), start) for start in chosen])

    def _kept(self, fine: list[Optimum]) -> list[Optimum]:
        good = [one for one in fine if one.converged and one.continuous]
        return basins(self.problem, self.problem.times, good, self.options.same_path).optima

    def _basins(self, starts: list[Optimum]) -> list[Optimum]:
        problem, first = self.problem, optimum.first_order(self.problem)
        filters = {"jumps": JUMPS, "dearest": planner.DEAREST} if first is problem and not self.alone else {}
        return basins(problem, self.grids[0], starts, self.options.same_path, **filters).optima


def experiment(name: str, *words: str, repeats: int = REPEATS) -> None:
    """One line, and the optima of both; `words` change the experiment."""
    plan = Plan(name, *words)
    if repeats > 1:
        plan.theirs()  # the peer's functions are made
    milliseconds: dict[str, list[float]] = {"ours": [], "peer": []}
    found: dict[str, list[Optimum]] = {}
    calls: dict[str, Callable[[], list[Optimum]]] = {"ours": plan.ours, "peer": plan.theirs}
    for repeat in range(repeats):
        for side in list(calls)[:: 1 if repeat % 2 else -1]:
            begin = time.process_time()
            found[side] = calls[side]()
            milliseconds[side].append(1e3 * (time.process_time() - begin))
    ours, theirs = (float(np.median(milliseconds[side])) for side in ("ours", "peer"))
    note = f"{len(plan.motions)} starts; the peer's functions took {plan.peer.construction:.1f} s besides"
    print(f"{name:<24} {ours:9.0f} {theirs:9.0f} {ours / theirs:7.2f} {1e3 * plan.drawn:11.0f}   {note}", flush=True)
    for label, optima in found.items():
        print(f"  {label:<5}{'  '.join(f'{one.cost:.6f}' for one in optima)}")
    agreement(plan, found)


def agreement(plan: Plan, found: dict[str, list[Optimum]]) -> None:
    """Every optimum recomputed by both sides, by the peer with path and limits, and whether the lists agree; torque
    limits that all keep with room are not the peer's to check.
    """
    problem, everything = plan.problem, [one for optima in found.values() for one in optima]
    loose = not problem.objective.second_order and all(
        optimum.keeps_torque_limits(problem, problem.times, one.q) for one in everything
    )
    program = plan.peer.program(optimum.first_order(problem) if loose else problem, problem.times, plan.options)
    checks = [program.check(one.q) for one in everything]
    costs = objective_values(problem, problem.times, np.array([one.q for one in everything]))
    apart = max(abs(check[0] / cost - 1) for check, cost in zip(checks, costs, strict=True))
    lists = {tuple(f"{one.cost:.6f}" for one in optima) for optima in found.values()}
    print("  the lists agree" if len(lists) == 1 else "  THE LISTS DIFFER")
    print(f"  recomputed by both: costs within {apart:.0e}, path and limits kept to {max(c[1] for c in checks):.0e}")


def main(names: list[str]) -> None:
    unknown = set(names) - set(EXPERIMENTS)
    if unknown:
        sys.exit(f"{', '.join(sorted(unknown))}: not one of {', '.join(EXPERIMENTS)}")
    print(HEAD)
    for name in names or EXPERIMENTS:
        experiment(name)
