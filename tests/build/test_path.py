"""From the words of a command line to a path: its ends, its stops and its time stamps."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from pipeline.build.problem import prepare
from pipeline.common.errors import ConfigError, PathError
from pipeline.problem.problem import Problem
from tests.support import composed

POSE = ("robot=panda", "robot.orientation=full", "timing.duration=4", "timing.steps=20")
CIRCLE = ("path=circle", "path.radius=0.05", "path.center_direction=[0,1,0]", "boundary=cyclic")


def along(folder: Path, text: str, *words: str) -> Problem:
    (folder / "points.csv").write_text(text, encoding="utf-8")
    return prepare(composed("path=waypoints", f"path.file={folder / 'points.csv'}", "path.relative=true", *words))


def test_a_closed_path_with_the_tool_down_closes(tmp_path: Path) -> None:
    """First and last quaternion are a half turn and differ by rounding: their rotation vectors have opposite signs."""
    text = "x,y,z,qx,qy,qz,qw\n0,0,0,1,0,0,1e-10\n0.05,0.02,0,0.995,0.0998,0,0\n0.08,0.08,0,0.985,0.174,0,0\n"
    problem = along(tmp_path, f"{text}0,0,0,1,0,0,-1e-10\n", *POSE, "boundary=cyclic")
    start, end = problem.reference.position(np.array([0.0, 4.0]))
    assert np.linalg.norm(end - start) > 6.0
    assert problem.gap == (pytest.approx(0.0, abs=1e-12), pytest.approx(4e-10, rel=1e-4))


@pytest.mark.slow
def test_the_gap_of_an_open_turn_is_its_angle() -> None:
    with pytest.raises(PathError, match=r"boundary = cyclic: the path ends 0\.3 rad from where it starts"):
        prepare(composed(*POSE, *CIRCLE, "path.turn=[0.3,0,0]"))
    with pytest.raises(PathError, match=r"the path ends 0\.1 m and 0\.3 rad from"):
        prepare(composed(*POSE, *CIRCLE, "path.turn=[0.3,0,0]", "path.angle=180"))
    full = f"path.turn=[0,0,{2 * np.pi!r}]"
    assert prepare(composed(*POSE, *CIRCLE, full)).closed_path


def test_out_and_back(tmp_path: Path) -> None:
    words = ("robot=panda", "robot.task=[x,y,z]", "timing.duration=2", "timing.steps=16")
    text = "x,y,z\n0,0,0\n0.1,0,0\n0,0,0\n"
    reference = along(tmp_path, text, *words).reference
    x = reference.position(np.array([0.0, 1.0, 2.0]))
    np.testing.assert_allclose(x[1] - x[0], [0.1, 0, 0], atol=1e-12)
    np.testing.assert_allclose(x[2], x[0], atol=1e-12)
    assert reference.notes == ("the path comes to rest at way-point 2, where it turns back or on the spot",)
    with pytest.raises(PathError, match=r"turns back, or on the spot, at way-point 2 while moving at 0\.1 m/s"):
        along(tmp_path, text, *words, "timing=constant_speed")


def test_a_square_says_how_far_it_is_from_its_polygon(tmp_path: Path) -> None:
    words = ("robot=panda", "robot.task=[x,y,z]")
    text = "x,y,z\n0,0,0\n0.1,0,0\n0.1,0.1,0\n0,0.1,0\n0,0,0\n"
    (note,) = along(tmp_path, text, *words).reference.notes
    assert "leaves the polygon of its way-points by up to 0.0284 m" in note
    straight = along(tmp_path, text, *words, "path.corners=stop").reference
    assert straight.geometry.length == pytest.approx(0.4)
    assert straight.notes[0] == "the path keeps to the polygon of its way-points"
    assert straight.notes[1] == "the path comes to rest at way-points 2, 3, 4"


def test_a_square_with_rounded_corners(tmp_path: Path) -> None:
    """5 mm off its corners is 5 / sqrt 2 mm off its sides; in mm it is the same path."""
    words = ("robot=panda", "robot.task=[x,y,z]", "path.corners=blend")
    text = "x,y,z\n0,0,0\n0.1,0,0\n0.1,0.1,0\n0,0.1,0\n0,0,0\n"
    one = along(tmp_path, text, *words).reference
    (note,) = one.notes
    assert re.search(r"by up to 0\.00354 m, between way-points \d and \d$", note)
    assert (
        "way-points 2, 3, 4 lie too close to the next for path.blend"
        in along(tmp_path, text, *words, "path.blend=0.03").reference.notes[1]
    )
    other = along(tmp_path, text.replace("0.1", "100"), *words, "path.units=mm").reference
    t = np.linspace(0.0, one.duration, 41)
    np.testing.assert_allclose(other.position(t), one.position(t), atol=1e-12)


GCODE = "G21 G90\nG0 X50 Y10\nG1 X150 F600\nG3 X150 Y50 J20\nG1 X50 F1200\nM30\n"


def milled(folder: Path, *words: str) -> Problem:
    """100 mm at 10 mm/s, half a circle of 20 mm and 100 mm back at 20 mm/s, by a Panda."""
    (folder / "part.nc").write_text(GCODE, encoding="utf-8")
    arm = ("robot=panda", "robot.task=[x,y,z]", "path=waypoints", "path.relative=true")
    return prepare(composed(*arm, f"path.file={folder / 'part.nc'}", *words))


def test_gcode_at_its_feeds_with_stops(tmp_path: Path) -> None:
    """Each move takes its time at its feed and, with ramp 0.2, a quarter of that more."""
    reference = milled(tmp_path, "path.corners=stop", "timing=from_file", "timing.ramp=0.2").reference
    half = np.pi * 0.02
    assert reference.geometry.length == pytest.approx(0.2 + half)
    assert reference.duration == pytest.approx((10 + half / 0.01 + 5) / 0.8)
    assert reference.notes == ("the path comes to rest after lines 3, 4",)
    x, xd, _ = reference.sample(np.array([0.0, 6.25, 12.5, 12.5 + half / 0.016, reference.duration]))
    np.testing.assert_allclose(
        x - x[0], [[0, 0, 0], [0.05, 0, 0], [0.1, 0, 0], [0.12, 0.02, 0], [0, 0.04, 0]], atol=1e-12
    )
    np.testing.assert_allclose(xd[[0, 2, 4]], 0.0, atol=1e-12)
    np.testing.assert_allclose(xd[[1, 3]], [[0.01, 0, 0], [0, 0.01, 0]], atol=1e-12)


def test_gcode_with_another_law_and_round_corners(tmp_path: Path) -> None:
    reference = milled(tmp_path, "path.corners=blend", "path.blend=0.002", "timing.duration=9").reference
    assert reference.duration == 9.0
    assert reference.notes[-1] == "its feeds are not used, since timing.law = raised_cosine"
    assert re.match(r"it leaves the moves of the file by up to [\d.]+e-05 m, after line [34]$", reference.notes[0])
    for words, said in (
        (("path.corners=spline",), "line 4: an arc, which path.corners = spline"),
        (("path.corners=blend", "timing=optimal", "path.file=robots/none.nc"), "robots/none.nc"),
    ):
        with pytest.raises((ConfigError, PathError), match=said):
            milled(tmp_path, *words)
    (tmp_path / "part.nc").write_text("G1 X9\n", encoding="utf-8")
    arm = ("robot=panda", "robot.task=[x,y,z]", "path=waypoints", "path.relative=true", "timing=from_file")
    with pytest.raises(PathError, match=r"line 1: no feed F so far, and timing\.law = from_file asks for it$"):
        prepare(composed(*arm, f"path.file={tmp_path / 'part.nc'}"))


def test_a_turn_on_the_spot(tmp_path: Path) -> None:
    problem = prepare(composed(*POSE, "path=line", "path.length=0", "path.turn=[0,0,0.8]"))
    x, xd, _ = problem.reference.sample(np.linspace(0.0, 4.0, 9))
    np.testing.assert_allclose(x[:, :3], np.tile(x[0, :3], (9, 1)), atol=1e-15)
    turned = (Rotation.from_rotvec(x[0, 3:]).inv() * Rotation.from_rotvec(x[:, 3:])).magnitude()
    np.testing.assert_allclose(turned[[0, 4, 8]], [0.0, 0.4, 0.8], atol=1e-9)
    assert xd[4, 5] == pytest.approx(2 * 0.8 / 4)  # twice the mean: the peak of the raised cosine
    with pytest.raises(ConfigError, match=r"path\.length = 0: the path has no length, in space or in orientation"):
        prepare(composed(*POSE, "path=line", "path.length=0"))
    text = "x,y,z,roll,pitch,yaw\n0,0,0,3.14,0,0\n0,0,0,3.14,0,0.5\n"
    assert along(tmp_path, text, *POSE).reference.geometry.length == pytest.approx(0.05)


def test_time_stamps_give_the_law(tmp_path: Path) -> None:
    words, text = ("robot=panda", "robot.task=[x,y,z]"), "time,x,y,z\n5,0,0,0\n6,0.05,0,0\n8,0.05,0,0\n8.5,0.1,0.02,0\n"
    problem = along(tmp_path, text, *words, "timing=from_file", "timing.steps=7")
    assert (problem.reference.duration, problem.times[-1], len(problem.times)) == (3.5, 3.5, 8)
    x = problem.reference.position(np.array([0.0, 1.0, 2.0, 3.0, 3.5]))
    expected = [[0, 0, 0], [0.05, 0, 0], [0.05, 0, 0], [0.05, 0, 0], [0.1, 0.02, 0]]
    np.testing.assert_allclose(x - x[0], expected, atol=1e-9)
    with pytest.raises(ConfigError, match=r"has a column time, and timing\.law = raised_cosine does not take it"):
        along(tmp_path, text, *words)
    with pytest.raises(ConfigError, match=r"timing\.law = from_file: .* has no column time"):
        along(tmp_path, "x,y,z\n0,0,0\n0.1,0,0\n", *words, "timing=from_file")
    with pytest.raises(ConfigError, match=r"path\.kind = line has none"):
        prepare(composed("timing.law=from_file"))
    with pytest.raises(PathError, match=r"way-points 1 and 2 are the same point; to wait there takes a column time"):
        along(tmp_path, "x,y,z\n0,0,0\n0,0,0\n0.1,0,0\n", *words)
