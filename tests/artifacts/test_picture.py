"""What is drawn of an arm: a mesh that is not there is a note, never an error."""

from __future__ import annotations

import xml.etree.ElementTree as ET
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from rerun.chunk import RrdReader

from pipeline.artifacts.recording import inspection as arm_recording
from pipeline.artifacts.recording import picture as pictures
from pipeline.artifacts.recording.picture import picture
from pipeline.model.arm import Arm
from pipeline.robot import urdf
from pipeline.robot.description import Description
from tests.support import robot

BODY = '<inertial><mass value="1"/><inertia ixx="0.1" iyy="0.1" izz="0.1" ixy="0" ixz="0" iyz="0"/></inertial>'
JOINT = (
    '<joint name="j{i}" type="continuous"><parent link="l{i}"/><child link="l{j}"/><origin xyz="0.2 0 0"/>'
    '<axis xyz="0 0 1"/></joint>'
)
TRIANGLE = (
    "solid t\nfacet normal 0 0 1\nouter loop\nvertex 0 0 0\nvertex 1 0 0\nvertex 0 1 0\nendloop\nendfacet\nendsolid t\n"
)
BALL = '<collision><geometry><sphere radius="0.05"/></geometry></collision>'
Made = Callable[..., Description]


def shown(mesh: str) -> str:
    return f'<visual><geometry><mesh filename="{mesh}"/></geometry></visual>'


@pytest.fixture
def made(tmp_path: Path) -> Made:
    """An arm of three links, each with the pictures given."""

    def make(*looks: str) -> Description:
        links = [f'<link name="l{i}">{BODY}{look}</link>' for i, look in enumerate(looks)]
        joints = [JOINT.format(i=i, j=i + 1) for i in range(len(looks) - 1)]
        file = tmp_path / "arm" / "robot.urdf"
        file.parent.mkdir(exist_ok=True)
        file.write_text(f'<robot name="arm">{"".join(links + joints)}</robot>', encoding="utf-8")
        return urdf.read(file, f"l{len(looks) - 1}")

    return make


def visuals(xml: str) -> dict[str, list[str]]:
    """By link: what its visuals are, by file or by the kind of shape."""
    found = {}
    for link in ET.fromstring(xml).findall("link"):
        solids = [element[0] for element in link.iterfind("visual/geometry")]
        found[link.get("name", "")] = [solid.get("filename", solid.tag) for solid in solids]
        assert link.find("collision") is None
    return found


def mesh_file(folder: Path, size: int = 0) -> Path:
    folder.mkdir(parents=True, exist_ok=True)
    file = folder / "part.stl"
    file.write_text(TRIANGLE + " " * size, encoding="utf-8")
    return file


def test_meshes_that_are_there_get_their_absolute_names(
    made: Made, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("ROS_PACKAGE_PATH", str(tmp_path / "ros"))
    beside, packed = mesh_file(tmp_path / "arm" / "meshes"), mesh_file(tmp_path / "ros" / "some_arm")
    xml, notes = picture(
        made(shown("meshes/part.stl"), shown("package://some_arm/part.stl"), shown(f"file://{beside}"))
    )
    assert notes == []
    assert visuals(xml) == {"l0": [str(beside)], "l1": [str(packed)], "l2": [str(beside)]}


@pytest.mark.parametrize("name", ["meshes/absent.stl", "package://nowhere/part.stl", "meshes/part.step"])
def test_a_mesh_that_cannot_be_shown_is_a_note(made: Made, tmp_path: Path, name: str) -> None:
    mesh_file(tmp_path / "arm" / "meshes").with_suffix(".step").touch()
    there = tmp_path / "arm" / "meshes" / "part.stl"
    xml, notes = picture(made(shown("meshes/part.stl"), shown(name), shown(name)))
    assert visuals(xml) == {"l0": [str(there)], "l1": [], "l2": []}
    assert notes == [f"2 meshes of robot.urdf not found, drawn without ({name}, ...)"]


def test_collision_shapes_stand_in(made: Made) -> None:
    xml, notes = picture(made(shown("absent.stl") + BALL, BALL, ""))
    assert visuals(xml) == {"l0": ["sphere"], "l1": ["sphere"], "l2": []}
    assert notes == ["1 mesh of robot.urdf not found, drawn without (absent.stl)"]


def test_large_pictures_give_way_to_simple_ones(made: Made, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(pictures, "LARGE", 1000)
    fine = mesh_file(tmp_path / "arm" / "meshes" / "visual", 2000)
    simple = mesh_file(tmp_path / "arm" / "meshes" / "collision")
    looks = (shown(str(fine)) + BALL, "", "")
    assert visuals(picture(made(*looks))[0])["l0"] == [str(simple)]
    simple.unlink()
    assert visuals(picture(made(*looks))[0])["l0"] == ["sphere"]
    assert visuals(picture(made(looks[0].replace(BALL, ""), "", ""))[0])["l0"] == [str(fine)]


def test_an_sdf_file_is_a_note(made: Made) -> None:
    from dataclasses import replace

    description = replace(made("", "", ""), file=Path("arm.sdf"))
    assert picture(description) == ("", ["an SDF file's pictures are not drawn"])


def test_the_panda_is_drawn() -> None:
    xml, notes = picture(robot("panda").description)
    assert notes == []
    parts = visuals(xml)
    assert all(parts[f"panda_link{i}"] for i in range(8))
    assert all(Path(name).is_file() for names in parts.values() for name in names if "." in name)


def test_a_recording_without_the_meshes(made: Made, tmp_path: Path, caplog: pytest.LogCaptureFixture) -> None:
    arm = Arm(made(shown("package://nowhere/a.stl"), BALL, shown("gone.stl")))
    q = np.linspace(0.0, 1.0, 5)[:, None] * np.ones(2)
    arm_recording.write(tmp_path / "arm.rrd", arm, np.arange(5.0), q, name="arm")
    entities = {chunk.entity_path for chunk in RrdReader(tmp_path / "arm.rrd").stream()}
    assert any("l1" in entity and "visual" in entity for entity in entities)
    assert "2 meshes of robot.urdf not found" in caplog.text
