"""Roadmap starts: the graph beside enumeration, and what its motions keep."""

from __future__ import annotations

import itertools
from collections.abc import Sequence

import numpy as np
import pytest

from pipeline.build.problem import prepare
from pipeline.config.methods import GlobalOptions
from pipeline.evaluation.evaluation import evaluate
from pipeline.methods.global_planner.planner import global_planner
from pipeline.problem.costs import objective_values
from pipeline.search.layers import closed_paths, through_every_node
from pipeline.search.manifold import Manifold
from pipeline.search.roadmap import Roadmap, edge_costs
from pipeline.search.self_motion import manifold
from tests.support import composed


def test_cheapest_paths_beside_enumeration(rng: np.random.Generator) -> None:
    sizes = (3, 4, 2, 3)
    edges = [rng.random((a, b)).astype(np.float32) for a, b in itertools.pairwise(sizes)]
    edges[1][0, 0] = np.inf
    every = {
        path: sum(float(edge[a, b]) for edge, a, b in zip(edges, path[:-1], path[1:], strict=True))
        for path in itertools.product(*map(range, sizes))
    }
    paths, costs = through_every_node(edges)
    found = {tuple(map(int, path)): cost for path, cost in zip(paths, costs, strict=True)}
    for layer, size in enumerate(sizes):
        for node in range(size):
            best = min((path for path in every if path[layer] == node), key=lambda path: every[path])
            assert found[best] == pytest.approx(every[best], rel=1e-6)
    closed, costs = closed_paths(edges)
    for begin, (path, cost) in enumerate(zip(closed, costs, strict=True)):
        best = min((p for p in every if p[0] == p[-1] == begin), key=lambda p: every[p])
        assert (tuple(map(int, path)), cost) == (best, pytest.approx(every[best], rel=1e-6))


@pytest.mark.slow
@pytest.mark.parametrize("name", ["sim2", "traj4", "sim5", "panda_pose"])
def test_starts_keep_path_limits_and_boundary(name: str) -> None:
    problem = prepare(composed(f"+experiment={name}", "timing.steps=12"))
    roadmap = Roadmap(problem, problem.times, np.random.default_rng(3), nodes=100)
    chosen, random = roadmap.cheapest(16), roadmap.random(16)
    assert 2 <= len(chosen) <= 16
    assert 2 <= len(random) <= 16
    motions = np.concatenate([chosen, random])
    q = motions.reshape(-1, problem.task.arm.n)
    error = problem.task.error(q, np.tile(problem.reference.position(problem.times), (len(motions), 1)))
    assert np.abs(error).max() < 1e-6
    assert (q >= problem.bounds.lower - 0.2).all()
    assert (q <= problem.bounds.upper + 0.2).all()
    if problem.boundary.value == "fixed":
        assert (motions[:, 0] == problem.q_init).all()
    if problem.boundary.value == "cyclic":
        assert (motions[:, -1] == motions[:, 0]).all()
    again = Roadmap(problem, problem.times, np.random.default_rng(3), nodes=100)
    np.testing.assert_array_equal(motions, np.concatenate([again.cheapest(16), again.random(16)]))


def test_random_motions_are_others_each_time() -> None:
    problem = prepare(composed("+experiment=sim1", "timing.steps=12"))
    roadmap = Roadmap(problem, problem.times, np.random.default_rng(3), nodes=60)
    one, other = roadmap.random(20), roadmap.random(20)
    assert len(one) == len(other) == 20
    assert np.abs(one[:, None] - other[None]).max(axis=(2, 3)).min() > 1e-3
    cheapest = roadmap.manifold.cost(problem.times, roadmap.cheapest(20)).min()
    assert (roadmap.manifold.cost(problem.times, one) >= cheapest).all()


def test_costs_of_edges_and_motions_are_the_objectives(rng: np.random.Generator) -> None:
    problem = prepare(composed("+experiment=sim1", "timing.steps=6"))
    manifold = Manifold(problem)
    times = problem.times
    nodes = [rng.uniform(-1, 1, size=(2, 3)) for _ in times]
    (first, *_) = edge_costs(manifold, times, nodes, np.full(3, np.inf))
    d = nodes[1][1] - nodes[0][0]
    mean = problem.task.arm.mass_matrix(np.array([nodes[0][0], nodes[1][1]])).mean(axis=0)
    assert first[0, 1] == pytest.approx(0.5 * d @ mean @ d / times[1], rel=1e-5)
    motions = rng.normal(size=(3, len(times), 3))
    np.testing.assert_allclose(manifold.cost(times, motions), objective_values(problem, times, motions), rtol=1e-11)


def test_joints_without_limits_go_the_shorter_way_round() -> None:
    manifold = Manifold(prepare(composed("+experiment=sim1")))
    np.testing.assert_allclose(manifold.wrap(np.array([6.0, -6.0, 1.0])), [6 - 2 * np.pi, 2 * np.pi - 6, 1.0])
    limited = Manifold(prepare(composed("+experiment=sim2")))
    np.testing.assert_allclose(limited.wrap(np.array([6.0, -6.0, 1.0])), [6.0, -6.0, 1.0])


@pytest.mark.slow
def test_a_stretched_start_is_left_on_both_sides() -> None:
    """At q = 0 the planar arm is straight and its Jacobian has lost a rank along the path."""
    words = ("robot=planar3r", "robot.q_init=[0,0,0]", "path=line", "path.length=0.15", "path.direction=180")
    problem = prepare(composed(*words, "timing.duration=2", "timing.steps=16"))
    motions = Roadmap(problem, problem.times, np.random.default_rng(1)).cheapest(64)
    assert (motions[:, 1] @ [0, 0, 1] > 0).any()
    assert (motions[:, 1] @ [0, 0, 1] < 0).any()


AROUND = ("boundary=cyclic", "path=circle", "path.start=[0.15,0]", "path.radius=0.15", "robot.q_init=null")


@pytest.mark.parametrize(("radius", "layers"), [(0.15, range(30, 60)), (0.07, [6])])
def test_a_cycle_round_the_base_has_layers_that_show_its_turns(radius: float, layers: Sequence[int]) -> None:
    """Round the base two layers are at most 20 degrees apart; a circle beside it has as many as ever."""
    problem = prepare(composed(*AROUND, f"path.radius={radius}", "timing.steps=25"))
    times = Roadmap(problem, problem.times, np.random.default_rng(3), nodes=8).times
    assert len(times) - 1 in layers
    x, y = problem.reference.position(times).T
    assert radius == 0.07 or np.abs(np.diff(np.unwrap(np.arctan2(y, x)))).max() < np.deg2rad(20.01)


@pytest.mark.slow
def test_a_cycle_round_the_base_costs_no_more_than_turning_the_whole_arm() -> None:
    """The first joint alone, in the shape whose inertia about it is least: an upper bound that needs no planner."""
    problem = prepare(composed(*AROUND, "timing.steps=25"))
    rng = np.random.default_rng(3)
    shapes = np.concatenate(
        [loop.q for loop in manifold(problem.task, problem.reference.position(np.zeros(1))[0], rng)]
    )
    inertia = problem.task.arm.mass_matrix(shapes)[:, 0, 0].min()
    x, y = problem.reference.position(problem.times).T
    turned = np.diff(np.unwrap(np.arctan2(y, x)))
    assert abs(turned.sum()) == pytest.approx(2 * np.pi)
    found = global_planner(problem, GlobalOptions(nodes=100, optimised=8, budget=8))
    best = min(evaluate(problem, one).objective for one in found if one.found)
    assert best <= 0.5 * inertia * (turned**2 / np.diff(problem.times)).sum() * (1 + 1e-9)
