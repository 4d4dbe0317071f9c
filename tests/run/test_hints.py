"""Numbers that look wrong are said, and those that cannot be meant are refused with what would be."""

from __future__ import annotations

from pathlib import Path

import pytest

from pipeline.build.problem import prepare
from pipeline.common.errors import ConfigError, PathError
from pipeline.run.hints import hints
from tests.run.test_own_robot import urdf
from tests.support import composed

POINTS = "x,y\n{0},{1}\n{0},{2}\n"
ARM = ("robot.q_init=[0,0.5,-0.9]", "path=waypoints")


def points(folder: Path, *values: float) -> str:
    (folder / "path.csv").write_text(POINTS.format(*values))
    return f"path.file={folder / 'path.csv'}"


def said(*words: str) -> list[str]:
    config = composed(*words)
    return hints(config, prepare(config))


def test_a_start_that_is_moved(tmp_path: Path) -> None:
    where = points(tmp_path, 0.35, 0.1, 0.2)
    (line,) = said(*ARM, where)
    assert line.startswith(f"robot.q_init is moved to the first point of {tmp_path / 'path.csv'}, joint")
    assert " rad; path.relative=true" in line
    assert said(*ARM, where, "path.relative=true") == []
    assert said("robot.q_init=[0,0.5,-0.9]") == []


def test_degrees_where_radians_are_asked_for() -> None:
    (line,) = said("robot.q_init=[90,0.5,-0.9]", "path.length=0.01")
    assert line == "robot.q_init holds 90, more than a full turn; it is in rad, and 90 deg are 1.571"
    (line,) = said("robot.base_rpy=[0,0,-45]")
    assert line.startswith("robot.base_rpy holds -45, ")
    with pytest.raises(ConfigError, match=r"joint1 is 90, outside .* rad, .*; in degrees\? 90 deg are 1.571 rad"):
        prepare(composed("robot.q_init=[90,0.5,-0.9]", "path.length=0.01", "limits=joint"))


def test_millimetres_where_metres_are_asked_for(tmp_path: Path) -> None:
    where = points(tmp_path, 350, 100, 200)
    with pytest.raises(PathError, match=r"up to 100 m apart, .* m; are they in mm\? path.units=mm"):
        prepare(composed(*ARM, where))
    assert prepare(composed(*ARM, where, "path.units=mm")).reference.geometry.length == pytest.approx(0.1)


def test_a_rail_is_in_metres(tmp_path: Path) -> None:
    file = urdf(tmp_path / "rail.urdf", ("prismatic", "base", "cart", "1 0 0"), ("revolute", "cart", "tip", "0 0 1"))
    own = (f"robot.urdf={file}", "robot.end_effector=tip", "robot.offset=[0.5,0,0]", "path.length=0.1")
    assert said(*own, "robot.q_init=[7.5,0.5]", "robot.task=[y]", "path.direction=[1]") == []
    with pytest.raises(ConfigError, match=r"robot.q_init of to_cart is 7.5, outside its limits -1 to 1 m, and"):
        prepare(composed(*own, "robot.q_init=[7.5,0.5]", "robot.task=[y]", "path.direction=[1]", "limits=joint"))
