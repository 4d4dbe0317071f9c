"""The bound from below: what its parts promise, and that it never exceeds the cost of a motion that is known."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
import pandas as pd
import pytest

from pipeline.build.problem import prepare
from pipeline.common.arrays import Array
from pipeline.model.kinematics import wrap
from pipeline.problem.problem import Problem
from pipeline.program.newton.serve import Solver
from pipeline.search.cells import Cells, Index
from pipeline.search.cover import Cover
from pipeline.search.pairs import LONGEST_STEP, pairs_of
from pipeline.search.prices import prices
from pipeline.search.quadratics import SQUARE, S, fitted, lowest_on_square
from pipeline.search.roadmap import Roadmap
from pipeline.search.selection import distinct
from tests.suite.planar import FILE
from tests.support import backward_differences, composed

INTERVALS = 12
KNOWN = pd.read_csv(FILE, quotechar='"').set_index("name")["command"]
# Of each boundary, near the edge of the reach, with velocity limits that hold; norm: another metric.
SLOW = ("fixed3", "free2", "cyclic0", "cyclic2", "sim2", "sim5", "norm")
NAMES = ("long1", *(pytest.param(name, marks=pytest.mark.slow) for name in SLOW))


def on_intervals(name: str, intervals: int = INTERVALS) -> Problem:
    if name in KNOWN:
        words = tuple(word.strip("'") for word in KNOWN[name].split("' '"))
    else:
        words = ("+experiment=sim1", "objective=velocity_norm") if name == "norm" else (f"+experiment={name}",)
    problem = prepare(composed(*words))
    return replace(problem, times=np.linspace(0, problem.times[-1], intervals + 1))


@dataclass(frozen=True)
class Case:
    """A problem with its distinct optima (K, N + 1, n), best first, whose steps the bound covers."""

    problem: Problem
    q: Array
    cost: Array


@pytest.fixture(scope="module", params=NAMES)
def case(request: pytest.FixtureRequest) -> Case:
    problem = on_intervals(request.param)
    starts = Roadmap(problem, problem.times, np.random.default_rng(1), nodes=150).cheapest(64)
    answer = Solver(problem).on(problem.times).solve(starts)
    good = answer.converged & (answer.residual < 1e-8)
    good &= np.abs(np.diff(answer.q, axis=1)).max(axis=(1, 2)) < LONGEST_STEP
    q, cost = answer.q[good], answer.cost[good]
    kept = distinct(q, cost, len(q), 0.05, problem.task.arm.description.revolute)
    return Case(problem, q[kept], cost[kept])


def covered(case: Case, incumbent: float, rounds: int) -> list[Cover]:
    """After each round of what a method does, with an incumbent that need not be a motion's cost."""
    found, cover = [], Cover(case.problem, case.problem.times, 60)
    cover.price(prices(case.problem, case.problem.times, case.q[0]))
    for number in range(rounds):
        cover.bound(incumbent)
        found.append(cover)
        if number + 1 < rounds:
            before, cover = cover, Cover.__new__(Cover)
            cover.__dict__.update(before.__dict__)
            if cover.finished or number == 0:
                cover.refine(incumbent)
            else:
                assert cover.close(incumbent, 10**7)
    return found


@pytest.mark.slow
def test_no_known_motion_costs_less_and_the_best_costs_little_more(case: Case) -> None:
    """At every round, whatever the incumbent; the last one is tight, so that a bound a little too high would fail."""
    best = case.cost[0]
    bounds = [cover.least_cost for cover in covered(case, best * (1 + 1e-9), 4)]
    assert max(bounds) <= best * (1 + 1e-9)
    assert bounds[-1] > 0.85 * best or case.problem.times[-1] == 4  # cyclic2's best is not among the roadmap's optima
    assert bounds[-1] > bounds[0]


def test_optima_below_the_incumbent_stay_in_cells_that_are_left(case: Case) -> None:
    """Each known worse optimum, with the incumbent just above it, has its way from cell to cell at every round."""
    last = min(2, len(case.q) - 1)
    for cover in covered(case, float(case.cost[last]) * (1 + 1e-6), 4):
        for q in case.q[: last + 1]:
            assert leads_through(cover, q)


def leads_through(cover: Cover, q: Array) -> bool:
    """Whether the links that are left lead along a motion (N + 1, n), from a cell that holds each knot to the next."""
    graph, cells = cover.graph, cover.cells
    left = cover.through <= np.inf
    holds = [np.flatnonzero((cover.layer == i) & near(cells, graph.cell, knot)) for i, knot in enumerate(q)]
    reached = {int(state) for state in holds[0]}
    for states in holds[1:]:
        on = left & np.isin(graph.begin, list(reached)) & np.isin(graph.end, states)
        reached = {int(state) for state in graph.end[on]}
    return bool(reached)


def near(cells: Cells, chosen: Index, q: Array) -> Array:
    """Whether the polygon through each cell's places comes nearer to q (n,) than the curve may bulge."""
    gap = wrap(cells.q - q, cells.curves.turning)[chosen]
    along = np.diff(cells.q, axis=1)[chosen]
    size = np.maximum((along**2).sum(axis=2), 1e-300)
    share = np.clip(-(gap[:, :-1] * along).sum(axis=2) / size, 0, 1)
    apart = np.linalg.norm(gap[:, :-1] + share[:, :, None] * along, axis=2).min(axis=1)
    return np.asarray(apart <= 1e-6 + 0.1 * np.sqrt(size.max(axis=1)))


def test_costs_between_the_places_that_are_looked_at(case: Case, rng: np.random.Generator) -> None:
    """At random places of random pairs of cells the true cost is not below the quadratic by more than its error."""
    cover = covered(case, float(case.cost[0]) * 1.5, 2)[1]
    cells, graph = cover.cells, cover.graph
    link = rng.integers(len(graph.begin), size=3000)
    first, second = graph.cell[graph.begin[link]], graph.cell[graph.end[link]]
    steps = replace(cover.steps, price=np.zeros_like(cover.steps.price))
    pairs = pairs_of(cells, first, second, steps)
    s, t = rng.random((2, len(link)))
    a, b = between(cells, first, s), between(cells, second, t)
    middle = cells.q[second, 2] - cells.q[first, 2]
    turns = (middle - wrap(middle, cells.curves.turning)) / (2 * np.pi)
    d = b - a - 2 * np.pi * np.rint(turns)
    dt = steps.dt[cells.layer[first]]
    true = 0.5 * np.einsum("ki,kij,kj->k", d, cells.curves.manifold.metric(b), d) / dt
    k = pairs.cost
    guess = k[0] + k[1] * s + k[2] * t + k[3] * s * s + k[4] * s * t + k[5] * t * t
    below = (guess - true)[pairs.possible]
    assert (below <= pairs.error[pairs.possible] + 1e-12).all()
    assert below.max() > 0.05 * np.median(pairs.error)  # an error that is needed


def between(cells: Cells, chosen: Index, share: Array) -> Array:
    """Configurations (P, n) at a share of each cell, beside its middle."""
    order = np.lexsort((cells.loop[chosen], cells.layer[chosen]))
    s = cells.low[chosen] + share * cells.width[chosen]
    found = np.empty((len(chosen), cells.q.shape[2]))
    found[order] = cells.curves.along(cells.layer[chosen][order], cells.loop[chosen][order], s[order, None])[:, 0]
    middle = cells.q[chosen, 2]
    return np.asarray(middle + wrap(found - middle, cells.curves.period > 0))


def test_halves_cover_what_they_halve(case: Case) -> None:
    """Every place of a cell is in one of its halves, or beyond a limit."""
    cover = Cover(case.problem, case.problem.times, 30)
    keep = np.flatnonzero(cover.cells.allowed)
    halves = cover.cells.halved(keep)
    bounds = case.problem.bounds
    for u in (0.1, 0.4, 0.6, 0.9):
        q = between(cover.cells, keep, np.full(len(keep), u))
        half = 2 * np.arange(len(keep)) + (u > 0.5) * (cover.cells.width[keep] > 0)
        inside = np.all((q >= bounds.lower) & (q <= bounds.upper), axis=1)
        share = (cover.cells.low[keep] + u * cover.cells.width[keep] - halves.low[half]) / np.maximum(
            halves.width[half], 1e-300
        )
        point = cover.cells.width[keep] == 0
        assert (halves.allowed[half] & (point | ((share > -0.01) & (share < 1.01))))[inside].all()


@pytest.mark.slow
def test_prices_of_limits_that_do_not_hold_are_zero_and_the_others_have_the_sign_of_the_step() -> None:
    for name, held in (("free2", False), ("sim5", True)):
        problem = on_intervals(name)
        starts = Roadmap(problem, problem.times, np.random.default_rng(1), nodes=100).cheapest(64)
        answer = Solver(problem).on(problem.times).solve(starts[:8])
        q = answer.q[np.where(answer.converged, answer.cost, np.inf).argmin()]
        price, step = prices(problem, problem.times, q), np.diff(q, axis=0)
        at_limit = np.abs(step) >= np.diff(problem.times)[:, None] * problem.bounds.velocity * (1 - 1e-4)
        assert (price != 0).any() == held
        assert not price[~at_limit].any()
        assert (price * step >= 0).all()


def test_least_values_of_quadratics_on_the_square(rng: np.random.Generator) -> None:
    """Against a fine grid, for bowls, saddles, hills and planes."""
    k = rng.normal(size=(6, 400))
    k[3:, :50] = 0.0
    u = np.linspace(0, 1, 101)
    s, t = (place.ravel() for place in np.meshgrid(u, u))
    values = k.T @ np.stack([np.ones_like(s), s, t, s * s, s * t, t * t])
    least = lowest_on_square(k)
    assert (least <= values.min(axis=1) + 1e-12).all()
    np.testing.assert_allclose(least, values.min(axis=1), atol=2e-3)
    again, missed = fitted(k.T @ SQUARE)
    np.testing.assert_allclose(again, k, atol=1e-12)
    assert missed.max() < 1e-12
    _, missed = fitted((S**3)[None])
    assert 1 / 32 < missed[0] < 1.3 / 32  # no quadratic comes nearer to a cubic than Chebyshev's


def test_the_sum_that_is_bounded_is_that_of_the_documents(case: Case) -> None:
    if case.problem.objective.weight("kinetic_energy"):
        np.testing.assert_allclose(backward_differences(case.problem, case.problem.times, case.q), case.cost, rtol=1e-9)
