"""What a table of way-points holds is used or refused, in one line."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from pipeline.common.errors import PathError
from pipeline.path.waypoints import read

AXES = ("x", "y", "z")


def table(folder: Path, header: str, rows: int = 3) -> Path:
    columns = header.count(",") + 1
    values = np.arange(rows * columns).reshape(rows, columns) / 10
    text = "\n".join([header, *(",".join(map(str, row)) for row in values.tolist())])
    (folder / "points.csv").write_text(text, encoding="utf-8")
    return folder / "points.csv"


@pytest.mark.parametrize(
    ("header", "named"),
    [
        ("x,y,z,yaw", "needs the columns roll, pitch, yaw; the header has yaw, and no roll, pitch"),
        ("x,y,z,qx,qy,qw", "the header has qx, qy, qw, and no qz"),
        ("x,y,z,Roll,Pitch,Yaw", "columns Roll, Pitch, Yaw not understood; did you mean roll?"),
        ("x,y,z,rx,ry,rz", "columns rx, ry, rz not understood"),
        ("x,y,z,roll,pitch,yaw,qx,qy,qz,qw", "orientations of two kinds"),
        ("x,y,z,roll,pitch,yaw,qw", "orientations of two kinds"),
        ("x,y,z,x", "has the column x twice"),
        ("X,y,z", "no column x"),
        ("x,y,z,speed", "column speed not understood"),
        ("x,y,z,t", "column t not understood"),
        ("x,y,z,", "(no name)"),
    ],
)
def test_columns_that_would_be_left_out(tmp_path: Path, header: str, named: str) -> None:
    with pytest.raises(PathError) as caught:
        read(table(tmp_path, header), AXES)
    assert named in str(caught.value)
    assert "points.csv" in str(caught.value)
    assert "\n" not in str(caught.value)


def test_a_coordinate_that_is_not_prescribed_is_refused(tmp_path: Path) -> None:
    with pytest.raises(PathError, match="column z not understood; needed are x, y"):
        read(table(tmp_path, "x,y,z"), ("x", "y"))


def test_times(tmp_path: Path) -> None:
    rows = read(table(tmp_path, "time, x ,y,z"), AXES)
    assert rows.times is not None
    np.testing.assert_allclose(rows.times, [0.0, 0.4, 0.8])
    np.testing.assert_allclose(rows.points[:, 0], [0.1, 0.5, 0.9])
    for values in ("0 1 1", "0 2 1"):
        lines = [f"{t},{i},0,0" for i, t in enumerate(values.split())]
        (tmp_path / "points.csv").write_text("\n".join(["time,x,y,z", *lines]))
        with pytest.raises(PathError, match=r"time does not increase from row 2 to row 3 of the data"):
            read(tmp_path / "points.csv", AXES)


def test_a_million_rows_are_too_many(tmp_path: Path) -> None:
    (tmp_path / "points.csv").write_text("x,y,z\n" + "0.1,0.2,0.3\n" * 100_001)
    with pytest.raises(PathError, match="more than 100,000 way-points"):
        read(tmp_path / "points.csv", AXES)
