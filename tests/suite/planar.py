"""Thirty random problems of the planar arm with what a brute-force search knows of them: `planar.csv`, written by

    python -m tests.suite.planar

which draws the problems from fixed seeds and searches each from 600 random motions: random configurations at one to
three random knots, joined by straight lines of the joints and put back onto the path. None of that is the planner's way
to start.
"""

from __future__ import annotations

from itertools import pairwise
from pathlib import Path

import numpy as np
import pandas as pd
from scipy.interpolate import CubicSpline

from pipeline.build.problem import prepare
from pipeline.common.arrays import Array
from pipeline.common.errors import InputError
from pipeline.methods.global_planner.grids import refinement
from pipeline.methods.global_planner.optimum import stays_on_path
from pipeline.problem.problem import Boundary, Problem
from pipeline.program.newton.newton import WARM
from pipeline.program.newton.serve import Solver
from pipeline.search.manifold import Manifold
from pipeline.search.selection import distinct
from tests.support import composed

FILE = Path(__file__).with_suffix(".csv")
KINDS = ("fixed", "free", "cyclic", "long")
COUNTS = {"fixed": 10, "free": 10, "cyclic": 5, "long": 5}
STARTS = 600
BELOW = 3.0  # times the best: optima up to there are listed


def draw(kind: str, rng: np.random.Generator) -> tuple[str, ...]:
    """The command line of one random problem."""
    q = ", ".join(f"{angle:.3f}" for angle in rng.uniform(-2.5, 2.5, 3))
    words = ["robot=planar3r", f"robot.q_init=[{q}]", f"timing.duration={rng.choice([1, 2, 4])}", "timing.steps=100"]
    if kind == "cyclic":
        return (*words, "boundary=cyclic", "path=circle", f"path.radius={rng.uniform(0.03, 0.12):.3f}")
    length = rng.uniform(0.6, 0.85) if kind == "long" else rng.uniform(0.1, 0.6)
    words += ["path=line", f"path.length={length:.3f}", f"path.direction={rng.uniform(0, 360):.1f}"]
    return (*words, f"boundary={'fixed' if kind == 'fixed' else 'free'}")


def problems() -> dict[str, tuple[str, ...]]:
    """Names and command lines; those that the arm cannot reach are drawn again."""
    found: dict[str, tuple[str, ...]] = {}
    for number, kind in enumerate(KINDS):
        rng = np.random.default_rng(number)
        while sum(name.startswith(kind) for name in found) < COUNTS[kind]:
            words = draw(kind, rng)
            try:
                problem = prepare(composed(*words))
            except InputError:
                continue
            reach = 0.985 * 0.4895  # of the arm's three links
            if np.linalg.norm(problem.reference.position(problem.times), axis=1).max() < reach:
                found[f"{kind}{sum(name.startswith(kind) for name in found)}"] = words
    return found


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
        if not closed or np.abs(joints[-1] - joints[0]).max() < 1e-9:
            lines.append(np.stack([np.interp(np.arange(last + 1), knots, joint) for joint in joints.T], axis=1))
    q = np.array(lines)
    flat, on = manifold.project(q.reshape(-1, manifold.n), np.tile(x, (len(q), 1)))
    q, on = flat.reshape(q.shape), on.reshape(q.shape[:2])
    if problem.boundary is Boundary.FIXED:
        q[:, 0], on[:, 0] = problem.q_init, True
    if closed:
        q[:, -1] = q[:, 0]
    return q[on.all(axis=1)]


def optima(problem: Problem, count: int, seed: int) -> list[float]:
    """Costs of all distinct optima that the search finds, best first."""
    grids = refinement(problem.times, 25)
    solver, revolute = Solver(problem), problem.task.arm.description.revolute
    q = random_motions(problem, grids[0], count, np.random.default_rng(seed))
    answer = solver.on(grids[0]).solve(q)
    for before, grid in pairwise(grids):
        good = answer.converged & (answer.residual < 1e-8)
        q, cost = answer.q[good], answer.cost[good]
        kept = distinct(q, cost, len(q), 0.05, revolute)
        answer = solver.on(grid).solve(CubicSpline(before, q[kept], axis=1)(grid), WARM)
    good = answer.converged & (answer.residual < 1e-8)
    good &= np.array([stays_on_path(problem, problem.times, motion) for motion in answer.q])
    kept = distinct(answer.q[good], answer.cost[good], len(q), 0.05, revolute)
    return [float(cost) for cost in answer.cost[good][kept]]


def main() -> None:
    """Write the file."""
    rows = []
    for name, words in problems().items():
        costs = optima(prepare(composed(*words)), STARTS, seed=len(rows))
        near = [f"{cost:.8g}" for cost in costs if cost < BELOW * costs[0]]
        rows.append({"name": name, "command": " ".join(f"'{word}'" for word in words), "optima": " ".join(near)})
        print(name, *near, flush=True)
    pd.DataFrame(rows).to_csv(FILE, index=False)


if __name__ == "__main__":
    main()
