"""Numbers beyond all counting, and input that stands there twice or alone: one line that names it."""

from __future__ import annotations

from pathlib import Path

import pytest

from pipeline.build.problem import prepare
from pipeline.common.errors import InputError
from pipeline.config.path import LineConfig
from pipeline.path.waypoints import read
from pipeline.robot import urdf
from tests.support import ROOT, composed

PLANAR = (ROOT / "robots" / "planar3r.urdf").read_text()


@pytest.mark.parametrize(
    ("words", "line"),
    [
        ("path.length=1e200", r"path\.length = 1e\+200: must be 0 or of a size from 1e-30 to 1e\+20"),
        ("path.direction=[1e200,1e200]", r"path\.direction\[0\] = 1e\+200: must be 0 or of a size"),
        ("gravity=[0,0,1e300]", r"gravity\[2\] = 1e\+300"),
        ("robot.locked={joint1:1e300}", r"robot\.locked\.joint1 = 1e\+300"),
        ("robot.q_init=[1e9,0,0]", r"robot\.q_init\[0\] = .*: must be a number >= -10000 and <= 10000"),
        ("timing.duration=1e-9", r"timing\.duration = 1e-09 s: a motion takes 1e-06 to 1e\+09 s"),
        ("timing.duration=1e10", r"timing\.duration = 1e\+10 s: a motion takes"),
        ("base=free base.inertia=[1,2,2]", r"base\.inertia = .*: that of a spacecraft; give its base\.mass too"),
        ("base=free base.com=[0,0,1]", r"base\.com = .*: that of a spacecraft"),
    ],
)
def test_the_key_is_named(words: str, line: str) -> None:
    with pytest.raises(InputError, match=line):
        prepare(composed(*words.split()))


def test_from_python_too() -> None:
    with pytest.raises(InputError, match=r"LineConfig\.length = 1e\+200: must be 0 or of a size"):
        LineConfig(length=1e200)


@pytest.mark.parametrize(
    ("old", "new", "line"),
    [
        ("<mass", '<mass value="7"/><mass', "2 different <mass>; one is enough"),
        ("<axis", '<axis xyz="1 0 0"/><axis', "2 different <axis>"),
        ('<parent link="', '<parent link="link3"/><parent link="', "2 different <parent>"),
        ('<axis xyz="0 0 1"', '<axis xyz="0 0 1e300"', "in its axis the xyz '1e300', expected a number of at most"),
        ('mass value="', 'mass value="1e300" was="', "has the mass '1e300', expected a number of at most"),
    ],
)
def test_what_a_robot_file_says_is_said_once_and_can_be_counted(old: str, new: str, line: str, tmp_path: Path) -> None:
    assert old in PLANAR
    file = tmp_path / "arm.urdf"
    file.write_text(PLANAR.replace(old, new, 1))
    with pytest.raises(InputError, match=line):
        urdf.read(file, "tip")


def test_the_same_twice_is_once(tmp_path: Path) -> None:
    file = tmp_path / "arm.urdf"
    axis = '<axis xyz="0 0 1"/>'
    file.write_text(PLANAR.replace(axis, axis + axis, 1))
    assert urdf.read(file, "tip").joints == ("joint1", "joint2", "joint3")


@pytest.mark.parametrize(
    ("text", "line"),
    [
        ("0,0\n0.1,0\n", "the first row is 0, 0; expected a header"),
        ("x,y\n0,0\n1e200,0\n", "row 2 of the data holds a value that is not a finite number of at most"),
    ],
)
def test_way_points_have_a_header_and_places(text: str, line: str, tmp_path: Path) -> None:
    file = tmp_path / "points.csv"
    file.write_text(text)
    with pytest.raises(InputError, match=line):
        read(file, ("x", "y"))


def test_time_stamps_bound_the_steps_as_a_duration_does(tmp_path: Path) -> None:
    file = tmp_path / "points.csv"
    file.write_text("time,x,y\n0,0,0\n1e7,0.02,0.01\n")
    words = ("path=waypoints", f"path.file={file}", "path.relative=true", "timing=from_file")
    with pytest.raises(InputError, match=r"steps in path\.file, which takes 1e\+07 s; at most 100000"):
        prepare(composed(*words))
