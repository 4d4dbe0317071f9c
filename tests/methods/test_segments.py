"""Paths that must be cut, how often and where; pieces, transits, and several tool paths in one file."""

from __future__ import annotations

from dataclasses import replace
from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest
from scipy.interpolate import CubicSpline

from pipeline.build.problem import prepare
from pipeline.common.arrays import Array
from pipeline.common.errors import InputError
from pipeline.config.methods import GlobalOptions, SegmentsOptions
from pipeline.evaluation.evaluation import evaluate
from pipeline.evaluation.plant import SinglePlant
from pipeline.methods.global_planner.planner import global_planner
from pipeline.methods.segments.segments import segments
from pipeline.methods.segments.transit import Transits
from pipeline.problem.limits import Limits
from pipeline.problem.problem import Problem
from pipeline.problem.solution import Status, Trajectory
from pipeline.search.continuity import components, fewest
from tests.support import composed

OPTIONS = SegmentsOptions(intervals=24, nodes=60, planner=GlobalOptions(optimised=4, nodes=40))
ROUND = (
    "path=circle",
    "path.angle=720",
    "path.radius=0.25",
    "path.start=[0.25,0]",
    "path.center_direction=180",
    "boundary=free",
)


def round_the_base(turn: float, *words: str) -> Problem:
    """Twice round the base, by an arm whose first joint turns by at most `turn` [rad] to each side."""
    problem = prepare(composed(*ROUND, "timing.steps=40", "timing.duration=10", *words))
    free = Limits.none(3)
    wide = np.array([turn, 2.0, 2.0])
    return replace(problem, limits=replace(free, lower=-wide, upper=wide))


@pytest.fixture(scope="module")
def held() -> Problem:
    return round_the_base(3.1)


@pytest.mark.slow
def test_a_path_round_the_base_is_cut_where_the_first_joint_ends(held: Problem) -> None:
    found = components(held, 28, 60, np.random.default_rng(1))
    cuts = fewest(found)
    assert cuts
    # By so much at most can the other joints turn the tool away from the first link.
    ahead = np.arctan2(*held.task.value(reaching(held))[:, ::-1].T)
    most = 2 * (3.1 + np.abs(ahead).max())
    assert len(cuts) >= np.ceil(4 * np.pi / most) - 1
    for first, last in cuts:
        assert 0 < first <= last < 28
        assert found.furthest(last) > last
    free = components(round_the_base(np.inf), 28, 60, np.random.default_rng(1))
    assert fewest(free) == []


def reaching(problem: Problem) -> Array:
    """Configurations of the limits, with the first joint at zero, whose tool is as far from the base as the path."""
    fine = np.stack(np.meshgrid([0.0], *2 * [np.linspace(-2.0, 2.0, 401)]), axis=-1).reshape(-1, 3)
    reach = np.linalg.norm(problem.task.value(fine), axis=1)
    return fine[np.abs(reach - 0.25) < 2e-3]


@pytest.mark.slow
def test_every_piece_has_its_optimum_and_the_transits_rest_at_both_ends(held: Problem) -> None:
    pieces = segments(held, OPTIONS)
    assert len(pieces) > 1
    assert "no continuous motion follows the path" in pieces[0].evidence
    ends = [piece.stretch for piece in pieces]
    assert all(a is not None and b is not None and a[1] == b[0] for a, b in pairwise(ends))
    for before, piece in zip([None, *pieces], pieces, strict=False):
        judged = evaluate(held, piece)
        assert judged.status is Status.SOLVED, judged.message
        assert judged.tracking_error.max() < 1e-8
        assert judged.limit_excess["position"] <= 1e-6
        if before is None:
            assert piece.approach is None
            continue
        assert piece.approach is not None
        np.testing.assert_allclose(piece.approach.q[0], before.trajectory.q[-1], atol=1e-12)
        np.testing.assert_allclose(piece.approach.q[-1], piece.trajectory.q[0], atol=1e-12)
        speed = np.diff(piece.approach.q, axis=0) / np.diff(piece.approach.time)[:, None]
        assert np.abs(speed[[0, -1]]).max() < 0.02 * np.abs(speed).max()
        assert (piece.approach.q <= held.bounds.upper + 1e-9).all()
        assert (piece.approach.q >= held.bounds.lower - 1e-9).all()


@pytest.mark.slow
def test_a_path_that_needs_no_cut_is_one_piece_and_the_planner_s_optimum() -> None:
    problem = prepare(composed("path.length=0.1", "timing.steps=20", "boundary=free"))
    (piece,) = segments(problem, OPTIONS)
    best = global_planner(problem, OPTIONS.planner)[0]
    assert piece.evidence.startswith("a continuous motion can follow the whole path; ")
    assert evaluate(problem, piece).objective == pytest.approx(evaluate(problem, best).objective, rel=1e-6)


@pytest.mark.slow
def test_tool_paths_of_one_file_are_connected_in_order(tmp_path: Path) -> None:
    file = tmp_path / "two.csv"
    rows = ["0.4,0.0,a", "0.4,0.05,a", "0.35,-0.05,b", "0.35,-0.1,b"]
    file.write_text("x,y,segment\n" + "\n".join(rows) + "\n")
    words = ("path=waypoints", f"path.file={file}", "boundary=free", "timing.steps=20")
    problem = prepare(composed(*words))
    assert problem.reference.breaks == pytest.approx((0.05,))
    with pytest.raises(InputError, match="several tool paths"):
        global_planner(problem)
    first, second = segments(problem, OPTIONS)
    for piece, x in ((first, (0.4, 0.05)), (second, (0.35, -0.1))):
        assert piece.status is Status.SOLVED, piece.message
        np.testing.assert_allclose(problem.task.value(piece.trajectory.q[-1:])[0], x, atol=1e-8)
        assert evaluate(problem, piece).status is Status.SOLVED
    assert second.approach is not None
    file.write_text("x,y,segment\n" + "\n".join([*rows, "0.4,0.1,a", "0.4,0.2,a"]) + "\n")
    with pytest.raises(InputError, match="segment a comes twice"):
        prepare(composed(*words))


def test_a_transit_goes_round_what_stands_in_its_way() -> None:
    post = "+obstacles.shapes={post: {kind: sphere, center: [0.3, 0.0, 0.0], radius: 0.03}}"
    links = "robot.collision={link3: [{kind: sphere, radius: 0.02}]}"
    problem = prepare(
        composed(
            post,
            links,
            "obstacles.margin=0.01",
            "robot.q_init=[1.2,0.3,-0.3]",
            "path.length=0.05",
            "path.direction=250",
        )
    )
    transits = Transits(problem, np.random.default_rng(1))
    start, end = np.array([1.2, 0.0, 0.0]), np.array([-1.2, 0.0, 0.0])
    straight = start + np.linspace(0, 1, 30)[:, None] * (end - start)
    assert not transits.manifold.allowed(straight).all()
    way = transits(start, end)
    assert way is not None
    assert transits.manifold.allowed(way.q).all()
    np.testing.assert_allclose(way.q[[0, -1]], [start, end])


def test_a_transit_takes_the_time_that_its_torques_need() -> None:
    """By the evaluation's own plant on the exported motion, under gravity; and it could not be much faster."""
    words = ("robot=panda", "limits=joint_torque_power", "limits.power=40", "gravity=earth", "collision.self=false")
    problem = prepare(composed(*words, "path.direction=[0,1,0]", "path.length=0.1"))
    bounds, plant = problem.bounds, SinglePlant(problem.task.arm)
    start, end = np.array([0.0, -0.5, 0.0, -2.0, 0.0, 1.5, 0.0]), np.array([0.9, 0.6, 0.2, -1.2, 0.3, 2.0, 0.4])

    def transit(share: float) -> Trajectory | None:
        limits = replace(bounds, torque=share * bounds.torque, power=share * bounds.power)
        return Transits(replace(problem, limits=limits), np.random.default_rng(1))(start, end)

    way, quick = transit(0.6), transit(np.inf)
    assert way is not None
    assert quick is not None
    motion, most = CubicSpline(way.time, way.q, bc_type="clamped"), 0.0
    for t in np.linspace(0.0, way.time[-1], 201):
        q, v, a = (motion(t, order) for order in range(3))
        plant.at(q, v)
        tau = plant.torque(a)
        most = max(most, float((np.abs(tau) / bounds.torque).max()), float((np.abs(tau * v) / bounds.power).max()))
    assert 0.585 < most <= 0.6
    assert way.time[-1] > 2 * quick.time[-1]
    assert transit(0.5) is None  # it could not even stand there
