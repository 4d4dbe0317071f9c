"""A brute-force search for the optima of a problem, by none of the planner's ways to start: what the suite calls known.

Random configurations at one to three random knots are joined by straight lines of the joints and put back onto the
path; a cycle may close up to full turns of joints without limits. All are solved on 25 intervals, and what is distinct
there on the problem's own knots.

An optimum that leaves the path by more than path.tolerance between its knots is followed to finer ones, each with
twice as many, until it keeps the tolerance. It is known only if that costs about the same: else it was one of its
coarse knots alone, a jump between branches or through a singularity, where finer knots cost ever more.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from scipy.interpolate import CubicSpline

from pipeline.common.arrays import Array
from pipeline.methods.global_planner.grids import refinement
from pipeline.methods.global_planner.optimum import first_order, keeps_torque_limits, strays
from pipeline.problem.problem import Boundary, Problem
from pipeline.problem.turns import full_turns
from pipeline.program.newton.newton import COLD, WARM
from pipeline.program.newton.serve import Solver
from pipeline.search.manifold import Manifold
from pipeline.search.selection import distinct

ON_PATH = 1e-8  # [m, rad]
SAME = 0.05  # [rad] between motions that are one
COARSE = 25
DOUBLED = 5  # times at most, to follow an optimum that leaves its path
ABOUT = 0.05  # relative: by how much the cost of what survives may change on finer knots


def random_motions(problem: Problem, grid: Array, count: int, rng: np.random.Generator) -> Array:
    """Motions (K, N + 1, n) through random configurations at random knots; those that lose the path are left out."""
    manifold, closed = Manifold(problem), problem.boundary is Boundary.CYCLIC
    x, last = problem.reference.position(grid), len(grid) - 1
    pools = [manifold.draw(point, count // 10, rng) for point in x]
    lines = []
    for via in range(count):
        knots = list(np.sort(rng.choice(np.arange(1, last), 1 + via % 3, replace=False)))
        if any(not len(pools[k]) for k in knots):
            continue
        points = [pools[k][rng.integers(len(pools[k]))] for k in knots]
        if problem.boundary is Boundary.FIXED:
            knots, points = [0, *knots], [problem.q_init, *points]
        if closed and len(pools[0]):
            begin = pools[0][rng.integers(len(pools[0]))]
            knots, points = [0, *knots, last], [begin, *points, begin]
        joints = np.array(points)
        joints[1:] = joints[0] + np.cumsum(manifold.wrap(np.diff(joints, axis=0)), axis=0)
        lines.append(np.stack([np.interp(np.arange(last + 1), knots, joint) for joint in joints.T], axis=1))
    q = np.array(lines)
    turns = full_turns(problem, q[:, 0], q[:, -1])
    flat, on = manifold.project(q.reshape(-1, manifold.n), np.tile(x, (len(q), 1)))
    q, on = flat.reshape(q.shape), on.reshape(q.shape[:2])
    if problem.boundary is Boundary.FIXED:
        q[:, 0], on[:, 0] = problem.q_init, True
    if closed:
        q[:, -1] = q[:, 0] + turns
    return q[on.all(axis=1)]


def optima(problem: Problem, count: int, seed: int, below: float) -> tuple[list[float], int]:
    """Costs of all distinct optima found from `count` motions, best first and none above `below` times the best; and
    how many more were not those of any path.
    """
    whole, problem = problem, first_order(problem)
    grids, solver = refinement(problem.times, COARSE), Solver(problem)
    revolute = problem.task.arm.description.revolute
    q, before, barrier = random_motions(problem, grids[0], count, np.random.default_rng(seed)), grids[0], COLD
    for grid in grids:
        guess = q if grid is before else CubicSpline(before, q, axis=1)(grid)
        answer = solver.on(grid).solve(guess, barrier)
        good = answer.converged & (answer.residual < ON_PATH)
        kept = distinct(answer.q[good], answer.cost[good], len(guess), SAME, revolute)
        q, cost, before, barrier = answer.q[good][kept], answer.cost[good][kept], grid, WARM
    allowed = [keeps_torque_limits(whole, problem.times, motion) for motion in q]
    q, cost = q[allowed], cost[allowed]
    off = np.array([strays(problem, problem.times, motion) for motion in q])
    smooth = off <= problem.reference.tolerance
    near = cost < below * cost[smooth].min()
    lasting = np.array([a or _lasts(problem, solver, motion, c) for a, motion, c in zip(smooth, q, cost, strict=True)])
    return [float(c) for c in cost[near & lasting]], int((near & ~lasting).sum())


def _lasts(problem: Problem, solver: Solver, q: Array, cost: float) -> bool:
    """Whether an optimum that leaves its path stays one on finer knots, where it keeps to it."""
    times = problem.times
    for _ in range(DOUBLED):
        fine = np.interp(np.arange(2 * len(times) - 1) / 2, np.arange(len(times)), times)
        answer = solver.on(fine).solve(CubicSpline(times, q)(fine)[None], WARM)
        if not answer.converged[0] or abs(answer.cost[0] / cost - 1) > ABOUT:
            return False
        q, times = answer.q[0], fine
        if strays(replace(problem, times=times), times, q) <= problem.reference.tolerance:
            return True
    return False
