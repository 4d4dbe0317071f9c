"""Robots that the command line refuses: one line that names the file, the link or the joint, and nothing left."""

from __future__ import annotations

from pathlib import Path

import pytest

from tests.commands import Run, assert_refused, command

URDF = """<robot name="bad">
  <link name="base"/>
  {links}
</robot>"""
JOINT = """<joint name="j{i}" type="revolute"><parent link="{parent}"/><child link="l{i}"/><origin xyz="0.2 0 0"/>
  <axis xyz="0 0 1"/><limit lower="-2" upper="2" velocity="3" effort="1"/></joint>"""


def robot(joints: int, inertia: str) -> str:
    parents = ["base", *[f"l{i}" for i in range(joints)]]
    links = [f'<link name="l{i}">{inertia}</link>' + JOINT.format(i=i, parent=parents[i]) for i in range(joints)]
    return URDF.format(links="\n  ".join(links))


SOLID = '<inertial><mass value="1"/><inertia ixx="0.1" iyy="0.1" izz="0.1" ixy="0" ixz="0" iyz="0"/></inertial>'
ROBOTS = {
    "no inertia": (robot(3, ""), 3, ["inertia"]),
    "unphysical inertia": (robot(3, SOLID.replace('izz="0.1"', 'izz="0.5"')), 3, ["l0", "inertia that no body has"]),
    "a floating joint": (robot(3, SOLID).replace("revolute", "floating", 1), 3, ["j0", "floating", "revolute"]),
    "a mimicking joint": (
        robot(3, SOLID).replace("</joint>", '<mimic joint="j1"/></joint>', 1),
        3,
        ["j0", "mimics", "robot.locked.j0"],
    ),
    "two joints for two coordinates": (robot(2, SOLID), 2, ["robot.task", "2 joints", "redundancy"]),
    "not xml": ("<robot", 3, ["arm.urdf"]),
    "another document": ("<sdf/>", 3, ["arm.urdf"]),
}


@pytest.mark.parametrize("name", ROBOTS)
def test_bad_robots(name: str, run: Run, tmp_path: Path) -> None:
    text, joints, named = ROBOTS[name]
    file = tmp_path / "arm.urdf"
    file.write_text(text, encoding="utf-8")
    q_init = ",".join(["0.3"] * joints)
    answer = run(
        f"robot.urdf={file}", f"robot.end_effector=l{joints - 1}", f"robot.q_init=[{q_init}]", "path.length=0.05"
    )
    assert_refused(answer, *named)
    assert [file.name for file in tmp_path.iterdir()] == ["arm.urdf"]


def test_a_robot_without_any_fault_is_taken(run: Run, tmp_path: Path) -> None:
    """So that the test above fails for the reason it names."""
    file = tmp_path / "arm.urdf"
    file.write_text(robot(3, SOLID), encoding="utf-8")
    words = [f"robot.urdf={file}", "robot.end_effector=l2", "robot.q_init=[0.3,0.4,0.3]", "path.length=0.05"]
    assert_refused(run(*words, "boundary=cyclic"), "boundary")  # got as far as the last check


@pytest.mark.slow
def test_a_bad_robot_as_a_process(tmp_path: Path) -> None:
    """Neither Drake nor Hydra adds a line of its own."""
    file = tmp_path / "arm.sdf"
    links = [f'<link name="l{i}"><pose>0.{2 * i} 0 0 0 0 0</pose>{{}}</link>' for i in range(4)]
    bad = "<inertial><mass>1</mass><inertia><ixx>0.1</ixx><iyy>0.1</iyy><izz>0.5</izz></inertia></inertial>"
    joint = (
        '<joint name="j{0}" type="revolute"><parent>l{0}</parent><child>l{1}</child>'
        "<axis><xyz>0 0 1</xyz></axis></joint>"
    )
    joints = [joint.format(i, i + 1) for i in range(3)]
    model = "".join([*(link.format(bad) for link in links), *joints])
    file.write_text(f'<sdf version="1.9"><model name="arm">{model}</model></sdf>', encoding="utf-8")
    answer = command(f"robot.urdf={file}", "robot.end_effector=l3", "robot.q_init=[0.1,0.2,0.3]", folder=tmp_path)
    assert_refused(answer, "robot.urdf", "link 'l1'", "inertia that no body has")
    note, begins = answer.out.splitlines()
    assert note.endswith("so robot.task=[x,y] (it moves in a plane)")
    assert begins == "run: preparing"
    assert [file.name for file in tmp_path.iterdir()] == ["arm.sdf"]
