"""How many knots a path needs, against closed forms and against the paths themselves."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.interpolate import CubicSpline

from pipeline.build.problem import prepare
from pipeline.problem.resolution import divided, graded, on_path, path_error, resolving, roughly, steps_needed
from tests.support import composed

TURNS = ("path=circle", "path.radius=0.05", "path.angle=7200", "timing=constant_speed", "timing.duration=1")


def test_the_error_of_a_circle_at_constant_speed_is_that_of_cubic_interpolation() -> None:
    problem = prepare(composed(*TURNS, "timing.steps=400"))
    coarse, fine = (path_error(problem, divided(problem.times, parts))[0] for parts in (2, 4))
    assert coarse / fine == pytest.approx(16, rel=0.05)
    # h^4 / 384 times the fourth derivative, which is the radius in either coordinate; more where nothing ties an end
    assert coarse == pytest.approx(10 * 0.05 * (40 * np.pi / 800) ** 4 / 384, rel=0.3)
    # whole turns from knot to knot: all of them are one point, which the path leaves by its diameter
    assert path_error(problem, np.linspace(0.0, 1.0, 11))[0] > 0.06


def test_parts_of_the_intervals_keep_the_tolerance_and_fewer_do_not() -> None:
    problem = prepare(composed(*TURNS, "timing.steps=100"))
    knots = resolving(problem, 2000)
    assert knots is not None
    parts, left = divmod(len(knots) - 1, 100)
    assert left == 0
    errors = []
    for count in (parts, parts - 1):
        knots, fine = divided(problem.times, count), np.linspace(0.0, 1.0, 20_001)
        spline = CubicSpline(knots, problem.reference.position(knots))
        errors.append(np.linalg.norm(spline(fine) - problem.reference.position(fine), axis=1).max())
    assert errors[0] <= problem.reference.tolerance < 1.5 * errors[1]
    assert resolving(problem, (parts - 1) * 100) is None
    np.testing.assert_allclose(on_path(problem)[::parts], problem.times)


def test_a_turning_on_the_spot_needs_knots_for_its_orientation() -> None:
    words = ("robot=panda", "robot.orientation=full", "path.length=0", "path.direction=[0,1,0]", "timing.steps=20")
    problem = prepare(composed(*words, "path.turn=[0,0,0.8]", "timing.steps=6"))
    distance, angle = path_error(problem, problem.times)
    fine = np.linspace(0.0, problem.reference.duration, 2001)
    law = 0.8 * problem.reference.timing.sample(fine, 1.0)[0]
    spline = CubicSpline(problem.times, 0.8 * problem.reference.timing.sample(problem.times, 1.0)[0], bc_type="clamped")
    assert distance < 1e-12
    assert angle == pytest.approx(np.abs(spline(fine) - law).max(), rel=0.1)
    assert steps_needed(problem, problem.times, angle, 1) is not None


def test_a_line_at_constant_speed_shows_nothing_and_the_error_falls_by_its_order() -> None:
    problem = prepare(composed("timing=constant_speed", "timing.steps=10"))
    assert steps_needed(problem, problem.times, 16e-4 / 5, 0) == 21  # twice the knots for 16 / 5 x 5, and 4 % of room
    assert steps_needed(problem, problem.times, 0.1, 0) is None  # as far off as that, it does not follow its path


def test_a_coarse_grid_shows_the_shape_of_its_path() -> None:
    assert roughly(prepare(composed()), 25) == 25
    turns = prepare(composed(*TURNS, "timing.steps=500"))
    assert 100 < roughly(turns, 25) < 400
    assert roughly(prepare(composed(*TURNS, "timing.steps=30")), 25) == 30  # no more than there are


def test_no_interval_is_more_than_twice_as_long_as_the_next() -> None:
    given = np.array([0.0, 0.1, 1.0, 1.05])
    knots = graded(given)
    steps = np.diff(knots)
    assert np.isin(given, knots).all()
    assert np.maximum(steps[1:] / steps[:-1], steps[:-1] / steps[1:]).max() < 2 + 1e-9


def test_knots_lie_where_the_path_curves() -> None:
    words = ("path=waypoints", "path.file=robots/square.csv", "path.corners=blend", "path.blend=0.0005", "robot=panda")
    problem = prepare(composed(*words, "path.units=mm", "path.relative=true", "timing.steps=10", "path.tolerance=1e-5"))
    knots = resolving(problem, 2000)
    assert knots is not None
    assert np.isin(problem.times, knots).all()
    fine = np.linspace(0.0, problem.reference.duration, 20_001)
    spline = CubicSpline(knots, problem.reference.position(knots), bc_type="clamped")
    off = np.linalg.norm(spline(fine) - problem.reference.position(fine), axis=1)
    assert off.max() <= problem.reference.tolerance
    even = np.linspace(0.0, problem.reference.duration, 2 * len(knots))
    assert path_error(problem, even)[0] > problem.reference.tolerance  # twice as many would not do


def test_an_orientation_that_turns_by_more_than_half_a_turn_is_one_smooth_curve() -> None:
    words = ("robot=panda", "robot.orientation=full", "path.length=0", "path.direction=[0,1,0]", "timing.steps=40")
    problem = prepare(composed(*words, "path.turn=[0,0,5.0]"))
    assert np.abs(np.diff(problem.reference.position(problem.times)[:, 3:], axis=0)).max() > 3  # from pi to -pi
    assert path_error(problem, problem.times)[1] < 0.01
