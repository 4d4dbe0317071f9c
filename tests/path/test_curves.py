from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.integrate import quad

from pipeline.common.arrays import Array
from pipeline.common.errors import PathError
from pipeline.path.curves import Arc, Geometry, Line, circle, direction_vector
from pipeline.path.reference import Reference
from pipeline.path.spline import Spline
from pipeline.path.timing import ConstantSpeed, Quintic, RaisedCosine, Timing
from pipeline.path.waypoints import read_waypoints

durations = st.floats(0.05, 200.0)
lengths = st.floats(1e-3, 5.0)
laws = st.builds(lambda law, T: law(T), st.sampled_from([RaisedCosine, ConstantSpeed, Quintic]), durations)


@given(laws, lengths)
def test_timing_laws_run_from_start_to_end_and_know_their_derivatives(law: Timing, length: float) -> None:
    T = law.duration
    t = np.linspace(0.0, T, 401)
    s, sd, sdd = law.sample(t, length)
    assert abs(s[0]) <= 1e-14 * length
    assert s[-1] == pytest.approx(length, rel=1e-13)
    assert np.all(np.diff(s) >= -1e-14 * length)
    assert np.all(sd >= 0)
    h = 1e-5 * T  # the middle is t[200]: the halves must meet there in s, sd and sdd
    inner = np.concatenate([t[1:-1], T / 2 + np.array([-2, -1, 1, 2]) * h])
    (ahead, ahead_d, _), (behind, behind_d, _) = law.sample(inner + h, length), law.sample(inner - h, length)
    _, rate, acceleration = law.sample(inner, length)
    np.testing.assert_allclose((ahead - behind) / (2 * h), rate, atol=1e-7 * length / T)
    np.testing.assert_allclose((ahead_d - behind_d) / (2 * h), acceleration, atol=1e-3 * length / T**2)
    if law.at_rest:
        assert np.abs(sd[[0, -1]]).max() <= 1e-12 * length / T
        assert np.abs(sdd[[0, -1]]).max() <= 1e-12 * length / T**2
    else:
        assert sd[0] > 0


@given(durations, lengths)
def test_raised_cosine_is_the_papers_law(T: float, length: float) -> None:
    s, sd, sdd = RaisedCosine(T).sample(np.array([0.0, T / 4, T / 2, 3 * T / 4, T]), length)
    assert s[2] == pytest.approx(length / 2, rel=1e-12)
    assert sd[2] == pytest.approx(2 * length / T, rel=1e-12)  # the peak
    assert np.all(RaisedCosine(T).sample(np.linspace(0, T, 101), length)[1] <= 2 * length / T * (1 + 1e-12))
    np.testing.assert_allclose(sdd[[0, 2, 4]], 0.0, atol=1e-12 * length / T**2)
    np.testing.assert_allclose(sdd[[1, 3]], np.array([8.0, -8.0]) * length / T**2, rtol=1e-12)


CURVES: dict[str, Geometry] = {
    "line": Line(np.array([1.0, 2.0]), direction_vector(30.0, 2), 0.7),
    "circle": circle(np.array([1.0, 2.0]), 200.0, 0.3),
    "clockwise": circle(np.array([1.0, 2.0]), 200.0, 0.3, clockwise=True, angle=100.0),
    "circle in space": circle(np.array([1.0, 2.0, 3.0]), [1.0, 1.0, 0.5], 0.3, normal=[0.0, -1.0, 1.0]),
    "spline": Spline(np.array([[0.0, 0.0], [0.3, 0.2], [0.35, 0.6], [-0.2, 0.7], [-0.1, 0.0]])),
    "spline in space": Spline(np.array([[0.0, 0.0, 0.0], [0.3, 0.2, 0.1], [0.4, 0.6, -0.1]])),
    "two points": Spline(np.array([[0.0, 0.0], [0.3, 0.4]])),
}


@pytest.mark.parametrize("name", CURVES)
def test_geometry_is_by_arc_length_and_knows_its_derivatives(name: str) -> None:
    curve, h = CURVES[name], 1e-5
    s = np.linspace(2 * h, curve.length - 2 * h, 97)
    x, tangent, curvature = curve.sample(s)
    ahead, behind = curve.sample(s + h), curve.sample(s - h)
    np.testing.assert_allclose(np.linalg.norm(tangent, axis=1), 1.0, atol=1e-12)
    np.testing.assert_allclose((ahead[0] - behind[0]) / (2 * h), tangent, atol=1e-7)
    np.testing.assert_allclose((ahead[1] - behind[1]) / (2 * h), curvature, atol=1e-3 * (1 + np.abs(curvature).max()))
    np.testing.assert_allclose(np.einsum("ij,ij->i", tangent, curvature), 0.0, atol=1e-10)
    assert x.shape == (97, len(x[0]))


def planar_points() -> st.SearchStrategy[Array]:
    """Way-points that move on: no cusps, which no cubic through them could pass at finite curvature."""
    step = st.tuples(st.floats(0.1, 0.4), st.floats(-0.3, 0.3))
    return st.lists(step, min_size=1, max_size=8).map(lambda steps: np.cumsum([(0.0, 0.0), *steps], axis=0))


@pytest.mark.slow
@given(planar_points())
def test_spline_passes_through_its_points_at_the_right_arc_length(points: Array) -> None:
    spline = Spline(points)
    assert spline.length >= np.linalg.norm(np.diff(points, axis=0), axis=1).sum() * (1 - 1e-12)
    step = spline.length / 20000
    fine, _, curvature = spline.sample(np.linspace(0.0, spline.length, 20001))
    pieces = np.linalg.norm(np.diff(fine, axis=0), axis=1)
    assert pieces.max() <= step * (1 + 1e-4)  # where it all but turns on the spot its length is known less well
    # A chord is never longer than its arc, and shorter by (curvature ds)^2 / 24 of it.
    shorter = (np.linalg.norm(curvature, axis=1) ** 2).sum() * step**3 / 24
    assert -1e-6 * spline.length <= spline.length - pieces.sum() <= 2 * shorter + 1e-6 * spline.length
    reached = [np.linalg.norm(fine - point, axis=1).min() for point in points]
    assert max(reached) <= spline.length / 20000
    np.testing.assert_allclose(fine[[0, -1]], points[[0, -1]], atol=1e-12)


def test_spline_length_of_a_parabola_is_the_closed_form() -> None:
    points = np.array([[-1.0, 1.0], [0.0, 0.0], [1.0, 1.0]])  # three points: the parabola y = x^2
    exact = 2 * quad(lambda x: np.sqrt(1 + 4 * x * x), 0, 1)[0]
    assert Spline(points).length == pytest.approx(exact, rel=1e-10)


@given(st.floats(0, 360), st.floats(0.01, 1.0), st.booleans())
def test_planar_circle_closes_around_its_centre(direction: float, radius: float, clockwise: bool) -> None:
    start = np.array([0.3, -0.2])
    curve = circle(start, direction, radius, clockwise=clockwise)
    s = np.linspace(0.0, curve.length, 33)
    x, tangent, _ = curve.sample(s)
    center = start + radius * direction_vector(direction, 2)
    np.testing.assert_allclose(x[[0, -1]], [start, start], atol=1e-12)
    np.testing.assert_allclose(np.linalg.norm(x - center, axis=1), radius, rtol=1e-12)
    radial = x - center
    turn = radial[:, 0] * tangent[:, 1] - radial[:, 1] * tangent[:, 0]
    np.testing.assert_allclose(turn, -radius if clockwise else radius, rtol=1e-9)


def test_clockwise_mirrors_on_the_line_to_the_centre() -> None:
    s = np.linspace(0.0, 0.4, 9)
    left, right = (circle(np.zeros(2), 180.0, 0.05, clockwise=c).sample(s)[0] for c in (False, True))
    np.testing.assert_allclose(left * [1, -1], right, atol=1e-15)
    assert left[1, 1] > 0  # trajectory 2: centre at (-0.05, 0), counter-clockwise starts upwards


@given(st.tuples(*[st.floats(-1, 1)] * 3), st.tuples(*[st.floats(-1, 1)] * 3))
def test_circle_in_space_keeps_its_plane_and_turns_around_its_normal(
    inward: Sequence[float], normal: Sequence[float]
) -> None:
    if np.linalg.norm(np.cross(inward, normal)) < 1e-3:
        return
    curve = circle(np.array([1.0, 2.0, 3.0]), inward, 0.4, normal=normal)
    x, tangent, curvature = curve.sample(np.linspace(0.0, curve.length, 17))
    axis = direction_vector(normal, 3)
    np.testing.assert_allclose((x - x[0]) @ axis, 0.0, atol=1e-9)
    np.testing.assert_allclose(np.cross(tangent, 0.4 * curvature), np.tile(axis, (17, 1)), atol=1e-9)
    assert (x[8] - x[0]) @ np.asarray(inward) > 0


def test_reference_velocity_and_acceleration_are_the_derivatives_of_its_position() -> None:
    for curve in CURVES.values():
        reference, h = Reference(curve, RaisedCosine(4.0)), 1e-4
        t = np.linspace(0.1, 3.9, 40)
        before, now, after = (reference.sample(t + shift) for shift in (-h, 0.0, h))
        np.testing.assert_allclose((after[0] - before[0]) / (2 * h), now[1], atol=1e-6)
        np.testing.assert_allclose((after[1] - before[1]) / (2 * h), now[2], atol=3e-3)


def test_arc_length_of_a_part_of_a_circle() -> None:
    arc = circle(np.zeros(2), 90.0, 0.5, angle=90.0)
    assert isinstance(arc, Arc)
    assert arc.length == pytest.approx(np.pi / 4)
    np.testing.assert_allclose(arc.sample(np.array([arc.length]))[0], [[0.5, 0.5]], atol=1e-15)


@pytest.mark.parametrize(
    ("make", "named"),
    [
        (lambda: direction_vector(30.0, 3), "path.direction = 30.0"),
        (lambda: direction_vector([0.0, 0.0], 2), "path.direction"),
        (lambda: direction_vector([1.0, 0.0], 3), "expected 3 numbers"),
        (lambda: circle(np.zeros(3), [0.0, 0.0, 1.0], 0.1), "parallel"),
    ],
)
def test_bad_directions_name_their_key(make: object, named: str) -> None:
    with pytest.raises(PathError, match=named):
        make()  # type: ignore[operator]


@pytest.mark.parametrize(
    ("text", "named"),
    [
        ("x,y\n0,0\n0.1,nan\n0.2,0.2\n", "row 2"),
        ("x,y\n0,0\n0.1,0.1\nhere,0.2\n", "row 3"),
        ("x,y\n0,0\n0.1\n", "row 2"),
        ("x,y\n0,0\n0.1,inf\n", "row 2"),
        ("x,z\n0,0\n1,1\n", "no column y"),
        ("x,y\n0,0\n", "1 way-point,"),
        ("x,y\n", "0 way-points"),
        ("x,y\n0,0\n0.1,0.2\n0.1,0.2\n", "way-points 2 and 3"),
        ("", "not a CSV"),
        ("x,y\n0,0,0.1\n0.1,0.1,0.1\n", "row"),  # more values than columns: which ones are meant?
    ],
)
def test_a_fault_in_the_table_is_one_line_that_names_the_place(tmp_path: Path, text: str, named: str) -> None:
    file = tmp_path / "points.csv"
    file.write_text(text)
    with pytest.raises(PathError) as caught:
        read_waypoints(file, ("x", "y"))
    message = str(caught.value)
    assert named in message
    assert "path.file" in message
    assert "points.csv" in message
    assert "\n" not in message


def test_a_table_that_is_not_there(tmp_path: Path) -> None:
    with pytest.raises(PathError, match=r"path.file = .*none.csv: no such file$"):
        read_waypoints(tmp_path / "none.csv", ("x",))


def test_a_table_may_hold_comments_and_columns_in_any_order(tmp_path: Path) -> None:
    (tmp_path / "points.csv").write_text("# metres\ny, x\n0.1, 1\n0.2, 2 # the end\n")
    np.testing.assert_array_equal(read_waypoints(tmp_path / "points.csv", ("x", "y")), [[1, 0.1], [2, 0.2]])
