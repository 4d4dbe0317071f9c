"""The planner's knots: refined until its motions keep the path between them, up to a bound, or kept."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from pipeline.build.problem import prepare
from pipeline.config.methods import GlobalOptions
from pipeline.evaluation.evaluation import evaluate
from pipeline.methods.global_planner.grids import coarsest, finer, off_path, on_knots
from pipeline.methods.global_planner.planner import global_planner
from pipeline.problem.problem import Problem
from pipeline.problem.resolution import path_error, roughly
from pipeline.problem.solution import Status
from tests.support import composed

FEW = GlobalOptions(optimised=4, nodes=60)
THREE_TURNS = ("path=circle", "path.radius=0.05", "path.angle=1080", "timing.steps=16")


@pytest.fixture(scope="module")
def turns() -> Problem:
    return prepare(composed(*THREE_TURNS))


def test_a_grid_too_coarse_for_the_path_is_refined(turns: Problem) -> None:
    first, *_ = global_planner(turns, FEW)
    judged = evaluate(turns, first)
    assert judged.status is Status.SOLVED
    assert judged.on_path
    assert judged.tracking_error_between <= 1e-4
    parts, left = divmod(len(first.trajectory.time) - 1, 16)
    assert parts > 1
    assert left == 0
    np.testing.assert_allclose(first.trajectory.time[::parts], turns.times, atol=1e-12)
    assert f"on {16 * parts} intervals: the 16 of timing.steps are too few" in first.message


@pytest.mark.slow
def test_a_wave_that_its_knots_hardly_show_is_no_jump(tmp_path: Path) -> None:
    """Six periods on 25 and on 38 intervals: the path's own spline is nearly as far off on these as on those."""
    along, across = np.array([np.cos(np.deg2rad(170)), np.sin(np.deg2rad(170))]), np.deg2rad(80)
    y = np.linspace(0.0, 0.25, 241)
    aside = 0.008 * np.sin(2 * np.pi * 6 * y / 0.25)
    points = y[:, None] * along + aside[:, None] * [np.cos(across), np.sin(across)]
    np.savetxt(tmp_path / "wave.csv", points, delimiter=",", header="x,y", comments="")
    words = ("path=waypoints", f"path.file={tmp_path / 'wave.csv'}", "path.relative=true", "timing.duration=4")
    problem = prepare(composed(*words, "timing.steps=38"))
    judged = evaluate(problem, global_planner(problem, FEW)[0])
    assert judged.status is Status.SOLVED
    assert judged.tracking_error_between <= 1e-4


def test_a_motion_that_curves_more_than_its_path_is_measured_or_said() -> None:
    problem = prepare(composed("timing=constant_speed", "path.length=0.3", "timing.steps=10", "path.tolerance=1e-5"))
    coarse = global_planner(problem, replace(FEW, refine_to=None))[0]
    judged = evaluate(problem, coarse)
    assert len(coarse.trajectory.time) == 11
    assert judged.status is Status.SOLVED
    assert not judged.on_path
    assert "off its path, which promises its knots alone" in judged.message
    assert off_path(problem, coarse.trajectory.q)[0].max() == pytest.approx(judged.tracking_error_between, rel=1e-6)
    assert path_error(problem, problem.times)[0] < 1e-12  # the path alone would not show it
    refined = global_planner(problem, FEW)[0]
    assert evaluate(problem, refined).status is Status.SOLVED
    assert evaluate(problem, refined).on_path
    assert len(refined.trajectory.time) > 11


def test_beyond_the_bound_the_number_that_would_do_is_said(turns: Problem) -> None:
    (nothing,) = global_planner(turns, replace(FEW, refine_to=40))
    assert nothing.status is Status.NOT_CONVERGED
    assert not nothing.found
    assert "method.global.refine_to = 40" in nothing.message
    needed = int(nothing.message.split("the path needs ")[1].split()[0])
    times, why = on_knots(turns, needed)
    assert len(times) == needed + 1
    assert not why


def test_finer_knots_stay_within_the_bound(turns: Problem) -> None:
    still = np.tile(turns.q_init, (len(turns.times), 1))
    assert finer(turns, None, [still]) is None
    assert finer(turns, 31, [still]) is None
    knots = finer(turns, 40, [still])
    assert knots is not None
    assert len(knots) == 2 * 16 + 1


def test_the_coarsest_grid_shows_the_shape_of_the_path_unless_it_is_given(turns: Problem) -> None:
    assert coarsest(turns, 5, 4) == 5
    assert coarsest(turns, None, 4) == roughly(turns, 4) > 4


def test_a_motion_that_does_not_turn_with_its_path_is_off_by_the_angle() -> None:
    words = ("robot=panda", "robot.orientation=full", "path.length=0", "path.direction=[0,1,0]", "timing.steps=6")
    problem = prepare(composed(*words, "path.turn=[0,0,0.8]"))
    distance, angle = off_path(problem, np.tile(problem.q_init, (7, 1))).max(axis=1)
    assert distance < 1e-9
    assert angle == pytest.approx(0.8)
