"""G-code: moves against circles and lines worked out by hand, and every word used or refused with its line."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from pipeline.common.arrays import Array
from pipeline.common.errors import PathError
from pipeline.path.curves import Arc
from pipeline.path.gcode import Move, read


def moves(folder: Path, *lines: str, axes: str = "xyz") -> tuple[Move, ...]:
    file = folder / "part.nc"
    file.write_text("\n".join(lines), encoding="utf-8")
    return read(file, axes)[0]


def ends(move: Move) -> Array:
    return move.piece.sample(np.array([0.0, move.piece.length]))[0]


def test_straight_moves_in_mm_and_inches_from_place_to_place_and_by_steps(tmp_path: Path) -> None:
    found = moves(
        tmp_path,
        "%",
        "O100 (a name)",
        "G0 X5 Y5 ; leads to the start",
        "n20 g1 x10 f600",
        "",
        "G91 G20 Y1. F60",
        "X-.5 Z+1",
        "G90 G21 G0 X0",
        "M30",
        "%",
    )
    assert [move.line for move in found] == [4, 6, 7, 8]
    assert [move.rapid for move in found] == [False, False, False, True]
    assert [move.feed for move in found] == [pytest.approx(feed) for feed in (0.01, 0.0254, 0.0254, 0.0254)]
    places = [[5, 5, 0], [10, 5, 0], [10, 30.4, 0], [-2.7, 30.4, 25.4], [0, 30.4, 25.4]]
    for move, start, end in zip(found, places, places[1:], strict=False):
        np.testing.assert_allclose(ends(move), 1e-3 * np.array([start, end]), atol=1e-12)


@pytest.mark.parametrize(
    ("words", "center", "middle"),
    [
        ("G17 G3 X0 Y10 I-10", (0, 0, 0), (7.0710678, 7.0710678, 0)),
        ("G17 G2 X0 Y10 I-10", (0, 0, 0), (-7.0710678, -7.0710678, 0)),
        ("G17 G3 X0 Y10 R10", (0, 0, 0), (7.0710678, 7.0710678, 0)),
        ("G17 G3 X0 Y10 R-10", (10, 10, 0), (17.0710678, 17.0710678, 0)),
        ("G17 G2 X0 Y10 R10", (10, 10, 0), (2.9289322, 2.9289322, 0)),
        ("G18 G3 X0 Z-10 I-10", (0, 0, 0), (7.0710678, 0, -7.0710678)),
        ("G18 G2 X0 Z10 I-10", (0, 0, 0), (7.0710678, 0, 7.0710678)),
        ("G19 G3 Y10 Z10 K10", (10, 0, 10), (10, 7.0710678, 2.9289322)),
        ("G17 G3 I-10", (0, 0, 0), (-10, 0, 0)),
        ("G17 G3 X0 Y10 Z8 I-10", (0, 0, None), (7.0710678, 7.0710678, 4)),
    ],
)
def test_arcs_in_all_planes(tmp_path: Path, words: str, center: tuple[float, ...], middle: tuple[float, ...]) -> None:
    """From x = 10 mm: where it is halfway, and that every point is 10 mm from the centre; the last one is a helix."""
    (move,) = moves(tmp_path, "G0 X10 Y0 Z0", f"{words} F100")
    assert isinstance(move.piece, Arc)
    s = np.linspace(0.0, move.piece.length, 101)
    x, tangent, curvature = move.piece.sample(s)
    np.testing.assert_allclose(x[50], 1e-3 * np.array(middle), atol=1e-9)
    known = [axis for axis in range(3) if center[axis] is not None]
    radii = np.linalg.norm(x[:, known] - 1e-3 * np.array([center[axis] for axis in known]), axis=1)
    np.testing.assert_allclose(radii, 0.01, rtol=1e-9)
    np.testing.assert_allclose(np.linalg.norm(tangent, axis=1), 1.0, rtol=1e-12)
    np.testing.assert_allclose(np.gradient(x, s, axis=0)[1:-1], tangent[1:-1], atol=1e-3)
    np.testing.assert_allclose(np.gradient(tangent, s, axis=0)[1:-1], curvature[1:-1], atol=0.2)


def test_an_arc_whose_ends_are_rounded_ends_where_it_is_told(tmp_path: Path) -> None:
    """R of sqrt(200) mm, its centre given to three digits: the next move begins at the end to the last one."""
    arc, line = moves(tmp_path, "G0 X0 Y0", "G3 X20 Y20 I10.001 J9.999 F100", "G1 X30")
    np.testing.assert_allclose(ends(arc)[1], ends(line)[0], atol=1e-15)


def test_coordinates_that_the_task_leaves_out_stand_still(tmp_path: Path) -> None:
    (move,) = moves(tmp_path, "G0 X10 Z5", "G18 G1 Z7 F1", axes="xz")
    np.testing.assert_allclose(ends(move), [[0.01, 0.005], [0.01, 0.007]])
    with pytest.raises(PathError, match=r"line 3: moves along y, which robot.task leaves out$"):
        moves(tmp_path, "G0 X10", "G1 X20 F1", "Y3", axes="xz")


@pytest.mark.parametrize(
    ("line", "said"),
    [
        ("G5 X1", "G5 not understood; of G words there may be G0 G1 G2 G3 G17"),
        ("M6", "M6 not understood; of M words there may be M2 M3"),
        ("G1 X1 A90", "A90 not understood; words may begin with X, Y, Z"),
        ("G1 X#1", "'G1 X#1' not understood"),
        ("G1 X1 (aside", "not understood"),
        ("/G1 X1", "not understood"),
        ("G1 X1 X2", "X stands twice"),
        ("G0 G1 X1", "G0 G1 contradict each other"),
        ("G1 X1 F0", "F0: a feed is more than zero"),
        ("G1 X1 I2", "I belongs to G2 and G3, and G1 holds"),
        ("G2 X1", "an arc needs R, or the distance to its centre by I, J, K"),
        ("G2 X1 R1 I1", "an arc needs R"),
        ("G2 X1 K1", "K is across the plane of the arc"),
        ("G2 X5 I1", "the arc begins 1 and ends 4 from its centre"),
        ("G2 X0 Y0 R5", "R leaves open which circle"),
        ("G2 X9 R4", "no arc of radius 4 joins points 9 apart"),
        ("G2 X9 I0 J0", "the centre of the arc is its start"),
        ("G4 P2", "P2 not understood"),
    ],
)
def test_what_it_does_not_use_is_refused_with_its_line(tmp_path: Path, line: str, said: str) -> None:
    with pytest.raises(PathError) as refused:
        moves(tmp_path, "G21", line)
    assert f"line 2: {said}" in str(refused.value) or (said == "not understood" and said in str(refused.value))
    assert "\n" not in str(refused.value)


def test_a_program_ends_once_and_moves(tmp_path: Path) -> None:
    with pytest.raises(PathError, match=r"line 3: comes after the program's end \(M30, line 2\)$"):
        moves(tmp_path, "G1 X1 F1", "M30", "G1 X2")
    with pytest.raises(PathError, match=r"no move by G1, G2 or G3$"):
        moves(tmp_path, "G0 X1", "M2")
    with pytest.raises(PathError, match=r"line 1: a place, and no G0"):
        moves(tmp_path, "X1")
    with pytest.raises(PathError, match="No such file"):
        read(tmp_path / "none.nc", "xyz")
    (tmp_path / "spindle.nc").write_text("M3 S900\nG1 X1 F1\nM8\nM5\n", encoding="utf-8")
    assert read(tmp_path / "spindle.nc", "xyz")[1] == ("M3", "S900", "M8", "M5")
