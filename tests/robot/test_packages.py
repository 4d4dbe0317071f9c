from __future__ import annotations

import os
import sys
from pathlib import Path

import pytest

from pipeline.common.errors import RobotError
from pipeline.robot import packages

ARM = "package://some_arm/urdf/arm.urdf"


@pytest.fixture(autouse=True)
def no_paths(monkeypatch: pytest.MonkeyPatch) -> None:
    for name in ("ROS_PACKAGE_PATH", "AMENT_PREFIX_PATH"):
        monkeypatch.delenv(name, raising=False)


def made(folder: Path) -> Path:
    """The file urdf/arm.urdf of a package in `folder`."""
    (folder / "urdf").mkdir(parents=True)
    file = folder / "urdf" / "arm.urdf"
    file.write_text("<robot/>", encoding="utf-8")
    return file


@pytest.mark.parametrize("named", ["parent", "itself"])
def test_ros_package_path(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, named: str) -> None:
    file = made(tmp_path / "second" / "some_arm")
    root = tmp_path / "second" / ("some_arm" if named == "itself" else "")
    monkeypatch.setenv("ROS_PACKAGE_PATH", os.pathsep.join([str(tmp_path / "first"), "", str(root)]))
    assert packages.locate(ARM, "robot.urdf") == file


def test_ament_prefix_path(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    file = made(tmp_path / "install" / "share" / "some_arm")
    monkeypatch.setenv("AMENT_PREFIX_PATH", os.pathsep.join([str(tmp_path / "other"), str(tmp_path / "install")]))
    assert packages.locate(ARM, "robot.urdf") == file


@pytest.mark.parametrize("imported", [False, True])
def test_an_installed_python_package(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, imported: bool) -> None:
    file = made(tmp_path / "site" / "some_arm")
    (tmp_path / "site" / "some_arm" / "__init__.py").touch()
    monkeypatch.syspath_prepend(tmp_path / "site")
    if imported:
        __import__("some_arm")
    try:
        for name in ("some_arm", "some-arm"):
            assert packages.locate(ARM.replace("some_arm", name), "robot.urdf") == file
    finally:
        sys.modules.pop("some_arm", None)


def test_the_robots_that_come_with_the_extra() -> None:
    uri = "package://example-robot-data/robots/panda_description/urdf/panda_collision.urdf"
    assert packages.locate(uri, "robot.urdf").is_file()


def test_a_package_knows_its_own_folder(tmp_path: Path) -> None:
    """A mesh named by its package, in a package that no path names."""
    file = made(tmp_path / "some_arm")
    assert packages.resolve(ARM, beside=file.parent) == file
    assert packages.resolve(ARM) is None


def test_other_names(tmp_path: Path) -> None:
    assert packages.resolve("file:///a/b.stl") == Path("/a/b.stl")
    assert packages.resolve("meshes/b.stl", beside=tmp_path) == tmp_path / "meshes" / "b.stl"
    assert packages.resolve("/a/b.stl", beside=tmp_path) == Path("/a/b.stl")


def test_an_unknown_package_is_one_line(monkeypatch: pytest.MonkeyPatch) -> None:
    unknown = (
        r"^robot\.urdf = package://some_arm/urdf/arm\.urdf: no package some_arm was found; set ROS_PACKAGE_PATH or .*$"
    )
    with pytest.raises(RobotError, match=unknown):
        packages.locate(ARM, "robot.urdf")
    with pytest.raises(RobotError, match=r"no package __main__ was found"):
        packages.locate("package://__main__/arm.urdf", "robot.urdf")
    monkeypatch.setattr(packages, "_folders", lambda *_: iter(()))
    with pytest.raises(
        RobotError, match=r"no package example-robot-data was found; pip install 'selfmotion\[robots\]'$"
    ):
        packages.locate("package://example-robot-data/arm.urdf", "robot.urdf")


def test_a_package_without_the_file_is_one_line(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    made(tmp_path / "some_arm")
    monkeypatch.setenv("ROS_PACKAGE_PATH", str(tmp_path))
    with pytest.raises(RobotError, match=r"^robot\.urdf = .*: package some_arm is there, but holds no urdf/leg\.urdf$"):
        packages.locate(ARM.replace("arm.urdf", "leg.urdf"), "robot.urdf")


def test_names_of_other_schemes(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    file = made(tmp_path / "my models" / "some_arm")
    assert packages.find(file.as_uri()) == file  # with %20
    monkeypatch.setenv("GZ_SIM_RESOURCE_PATH", str(tmp_path / "my models"))
    assert packages.find("model://some_arm/urdf/arm.urdf") == file
    model = file.parents[1]
    (model / "old.sdf").write_text("<sdf/>", encoding="utf-8")
    (model / "new.sdf").write_text("<sdf/>", encoding="utf-8")
    stated = '<sdf version="1.10">new.sdf</sdf><sdf version="1.9">old.sdf</sdf>'
    (model / "model.config").write_text(f"<model>{stated}</model>", encoding="utf-8")
    assert packages.find("model://some_arm") == model / "new.sdf"
    with pytest.raises(RobotError, match=r"no package other was found; set GZ_SIM_RESOURCE_PATH or GAZEBO_MODEL_PATH$"):
        packages.find("model://other/model.sdf")
