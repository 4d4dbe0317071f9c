"""Worlds as obstacles, against what Drake's own parser and SceneGraph make of the same files."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from pydrake.geometry import Role
from pydrake.multibody.parsing import Parser
from pydrake.multibody.plant import AddMultibodyPlantSceneGraph
from pydrake.systems.framework import DiagramBuilder
from scipy.spatial.transform import Rotation

from pipeline.build.goal import make_obstacles
from pipeline.common.errors import RobotError
from pipeline.robot import world
from pipeline.robot.packages import find
from tests.support import composed, robot

DRAKE = "package://pydrake/share/drake/examples/"
TABLE = """<sdf version="1.9"><model name="table"><link name="top"><pose>0 0 0.7 0 0 0.2</pose>
<collision name="c"><pose>0.1 0 0 0.3 0 0</pose><geometry><box><size>1 0.6 0.04</size></box></geometry></collision>
</link><link name="leg"><pose>0 0 0.3 0 0 0</pose><collision name="c"><geometry><cylinder><radius>0.05</radius>
<length>0.6</length></cylinder></geometry></collision></link>
<joint name="j" type="fixed"><parent>top</parent><child>leg</child></joint></model></sdf>"""
WORLD = """<sdf version="1.9"><world name="w">
<frame name="corner"><pose>2 0 0 0 0 1.5</pose></frame>
<light name="sun" type="point"/>
<include><uri>package://w/table.sdf</uri><name>left</name><pose relative_to="corner">0 1 0 0 0 0</pose></include>
<include><uri>package://w/table.sdf</uri><pose>0 -1 0 0 0 0.4</pose></include>
<model name="loose"><pose>0 0 0.8 0 0.1 0</pose><link name="link">
<collision name="a"><geometry><capsule><radius>0.03</radius><length>0.1</length></capsule></geometry></collision>
<collision name="b"><pose degrees="true">0.1 0 0 0 90 0</pose><geometry>
<sphere><radius>0.02</radius></sphere></geometry>
</collision></link></model>
<model name="part"><static>true</static><pose>1 1 1 0 0 0.5</pose><link name="link"><collision name="m"><geometry><mesh>
<uri>part.obj</uri><scale>0.5 0.5 0.5</scale></mesh></geometry></collision></link></model>
</world></sdf>"""
OBJ = "v 0 0 0\nv 1 0 0\nv 0 1 0\nv 0 0 1\nf 1 3 2\nf 1 2 4\nf 1 4 3\nf 2 3 4\n"
ROOM = """<robot name="r"><link name="room"/><link name="shelf"><collision><origin xyz="0 0 0.1"/><geometry>
<box size="1 0.3 0.02"/></geometry></collision></link><link name="pipe"><collision><origin rpy="0.4 0 0"/><geometry>
<cylinder radius="0.05" length="1"/></geometry></collision></link>
<joint name="a" type="fixed"><parent link="room"/><child link="shelf"/><origin xyz="1 0 0.5" rpy="0 0 0.7"/></joint>
<joint name="b" type="fixed"><parent link="shelf"/><child link="pipe"/><origin xyz="0.2 0 0" rpy="0.1 0.2 0"/></joint>
</robot>"""
FILES = {"table.sdf": TABLE, "world.sdf": WORLD, "part.obj": OBJ, "room.urdf": ROOM}
CELL = "obstacles.file=robots/cell.sdf"


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    made = tmp_path / "w"
    made.mkdir()
    for name, text in FILES.items():
        (made / name).write_text(text, encoding="utf-8")
    return made


def in_drake(file: Path) -> list[list[float]]:
    """Of each collision shape position, rotation vector and sizes, sorted."""
    builder = DiagramBuilder()
    plant, scene = AddMultibodyPlantSceneGraph(builder, 0.0)
    parser = Parser(plant)
    parser.package_map().Add(file.parent.name, str(file.parent))
    models = parser.AddModels(str(file))
    if file.suffix == ".urdf":
        plant.WeldFrames(plant.world_frame(), plant.GetFrameByName("room", models[0]))
    plant.Finalize()
    diagram = builder.Build()
    context, found = diagram.CreateDefaultContext(), []
    query = scene.get_query_output_port().Eval(scene.GetMyContextFromRoot(context))
    for geometry in query.inspector().GetAllGeometryIds(Role.kProximity):
        pose, shape = query.GetPoseInWorld(geometry), query.inspector().GetShape(geometry)
        turn = Rotation.from_matrix(pose.rotation().matrix()).as_rotvec()
        keys = next(k for k in (("size",), ("scale3",), ("radius", "length"), ("radius",)) if hasattr(shape, k[-1]))
        found.append([*pose.translation(), *turn, *np.hstack([getattr(shape, key)() for key in keys])])
    return sorted(found)


@pytest.mark.parametrize("file", ["world.sdf", "room.urdf"])
def test_poses_and_sizes_are_those_of_drake(folder: Path, file: str) -> None:
    """Included models, models in a frame of the world and loose ones, a mesh; and the links of a URDF."""
    theirs = in_drake(folder / file)
    mine = sorted([*shape.position, *shape.rotation, *shape.size] for shape in world.read(folder / file))
    assert len(mine) == len(theirs)
    for one, other in zip(mine, theirs, strict=True):
        np.testing.assert_allclose(one, other, atol=1e-9)


def test_names_are_those_of_models_and_links(folder: Path) -> None:
    named = [shape.name for shape in world.read(folder / "world.sdf")]
    assert named == ["left::top", "left::leg", "table::top", "table::leg", "loose", "loose", "part"]
    assert [shape.name for shape in world.read(folder / "room.urdf")] == ["shelf", "pipe"]


def test_what_drake_ships() -> None:
    """A table of nine boxes, and an office."""
    assert len(world.read(find(DRAKE + "kuka_iiwa_arm/models/table/extra_heavy_duty_table.sdf"))) == 9
    assert len(world.read(find(DRAKE + "quadrotor/office.urdf"))) == 16


def test_planes_are_half_spaces(folder: Path) -> None:
    """Whose z axis is the plane's normal."""
    plane = "<plane><normal>1 0 0</normal></plane>"
    text = WORLD.replace("<sphere><radius>0.02</radius></sphere>", plane)
    (folder / "world.sdf").write_text(text, encoding="utf-8")
    (wall,) = (shape for shape in world.read(folder / "world.sdf") if shape.kind == "half_space")
    normal = Rotation.from_euler("y", 0.1 + np.pi / 2).apply([1.0, 0.0, 0.0])
    np.testing.assert_allclose(Rotation.from_rotvec(wall.rotation).apply([0.0, 0.0, 1.0]), normal, atol=1e-12)


@pytest.mark.parametrize(
    ("file", "old", "new", "said"),
    [
        ("room.urdf", 'type="fixed"', 'type="revolute"', "joint 'a' is of type 'revolute': only what stands still"),
        ("table.sdf", '"fixed"', '"prismatic"', "joint 'left::j' is of type 'prismatic': only what stands still"),
        ("world.sdf", "sphere>", "ellipsoid>", "collision 'b' of loose::link is a <ellipsoid>; allowed: sphere, box"),
        ("world.sdf", "<radius>0.03</radius>", "<radius>0</radius>", "of loose::link is a <capsule> without extent"),
        ("world.sdf", "<radius>0.03</radius>", "<radius>a</radius>", "has the capsule's radius 'a', expected"),
        (
            "world.sdf",
            '<pose degrees="true">',
            '<pose relative_to="w">',
            "placed relative to 'w', allowed: its link",
        ),
        ("world.sdf", "sdf", "mujoco", "the root element is <mujoco>, expected <sdf> or <robot>"),
        ("world.sdf", "table.sdf", "chair.sdf", "the included model package://w/chair.sdf was not found"),
        ("room.urdf", "collision", "visual", "it holds no <collision>"),
    ],
)
def test_what_is_refused_names_file_and_place(folder: Path, file: str, old: str, new: str, said: str) -> None:
    (folder / file).write_text(FILES[file].replace(old, new), encoding="utf-8")
    asked = folder / ("room.urdf" if file == "room.urdf" else "world.sdf")
    with pytest.raises(RobotError) as refused:
        world.read(asked)
    assert str(refused.value).startswith(f"obstacles.file = {asked}: ")
    assert said in str(refused.value)
    assert "\n" not in str(refused.value)


def test_a_mesh_that_is_missing_names_its_model(folder: Path) -> None:
    (folder / "part.obj").unlink()
    (part,) = (shape for shape in world.read(folder / "world.sdf") if shape.name == "part")
    with pytest.raises(RobotError, match=r"obstacle part: the mesh .*part\.obj was not found"):
        _ = part.points


@pytest.mark.slow
def test_a_cell_around_the_arm() -> None:
    """The one that comes with the project, with shapes beside it."""
    ball = "+obstacles.shapes.ball={kind: sphere, center: [0, 0, 1.5]}"
    config = composed("robot=planar4r", ball, CELL)
    obstacles = make_obstacles(config.obstacles, config.collision, robot("planar4r"))
    assert obstacles is not None
    names = [shape.name for shape in obstacles.shapes]
    assert names == ["ball", "ground", "bench", "bench", "bench", "post", "bin::back", "bin::side"]
    with pytest.raises(RobotError, match=r"obstacles\.file = .*nowhere\.sdf: no such file"):
        make_obstacles(replace(config.obstacles, file="nowhere.sdf"), config.collision, robot("planar4r"))
