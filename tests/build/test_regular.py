"""What a run refuses of a robot, before anything is solved: stuck joints, impossible roots, singular mass matrices."""

from __future__ import annotations

import re
from collections.abc import Callable
from pathlib import Path

import pytest

from pipeline.build.problem import prepare
from pipeline.common.errors import InputError
from tests.support import composed

BODY = (
    '<inertial><origin xyz="{com} 0 0"/><mass value="{mass}"/>'
    '<inertia ixx="0.001" iyy="0.008" izz="0.008" ixy="0" ixz="0" iyz="0"/></inertial>'
)
INERTIA = ("ixx", "iyy", "izz", "ixy", "ixz", "iyz")
POINT = '<inertial><origin xyz="0.15 0 0"/><mass value="0.5"/></inertial>'
WORDS = (
    "robot.end_effector=tool",
    "robot.q_init=[0.3,0.8,-1.2]",
    "path.length=0.15",
    "path.direction=120",
    "boundary.rest=[]",
)


def planar(limit: str = 'velocity="5" effort="20"', last: str = BODY.format(com=0.15, mass=0.5)) -> str:
    """Three links of 0.3 m on a root of 2 kg, with the limits `limit`."""
    parts, bodies = [], [BODY.format(com=0, mass=2), *[BODY.format(com=0.15, mass=1)] * 2, last]
    for k, body in enumerate(bodies):
        parts.append(f'<link name="l{k}">{body}</link>')
        if k:
            parts.append(
                f'<joint name="j{k}" type="revolute"><parent link="l{k - 1}"/><child link="l{k}"/>'
                f'<origin xyz="{0.3 * (k > 1)} 0 0"/><axis xyz="0 0 1"/>'
                f'<limit lower="-3.1" upper="3.1" {limit}/></joint>'
            )
    tool = '<joint name="tf" type="fixed"><parent link="l3"/><child link="tool"/><origin xyz="0.3 0 0"/></joint>'
    return f'<robot name="pl">{"".join(parts)}<link name="tool"/>{tool}</robot>'


@pytest.fixture
def refusal(tmp_path: Path) -> Callable[..., str]:
    """The one line that a robot gets, with some words of the command line; empty if it is taken."""

    def answer(text: str, *words: str) -> str:
        (tmp_path / "arm.urdf").write_text(text)
        try:
            prepare(composed(f"robot.urdf={tmp_path / 'arm.urdf'}", *WORDS, *words))
        except InputError as error:
            return str(error)
        return ""

    return answer


@pytest.mark.parametrize(
    ("limit", "kind", "named", "mended"),
    [
        ('velocity="0" effort="20"', "joint", "the velocity limit of j1, j2, j3 is 0", "limits.velocity=2"),
        ('velocity="0" effort="20"', "joint", "robot.unlimited=[velocity]", "robot.unlimited=[velocity]"),
        ('velocity="-1" effort="20"', "joint", "the velocity limit of j1, j2, j3 is -1", "limits=none"),
        ('velocity="5" effort="0"', "joint_torque_power", "the effort limit of j1, j2, j3 is 0", "limits.torque=9"),
        ('velocity="5" effort="0"', "joint_torque_power", "robot.unlimited=[effort]", "robot.unlimited=[effort]"),
    ],
)
def test_limits_of_zero_where_they_count(
    refusal: Callable[..., str], limit: str, kind: str, named: str, mended: str
) -> None:
    assert named in refusal(planar(limit), f"limits={kind}")
    assert refusal(planar(limit)) == ""
    kept = () if mended.startswith("limits=") else (f"limits={kind}",)
    assert refusal(planar(limit), *kept, mended) == ""


def test_a_lock_outside_its_limits(refusal: Callable[..., str]) -> None:
    words = ("robot.locked={j3: 9.0}", "robot.q_init=[0.3,0.8]", "path.length=0.01")
    assert "robot.locked.j3 = 9: outside the limits of the joint, -3.1 to 3.1" in refusal(
        planar(), *words, "limits=joint"
    )


def test_a_wrist_that_is_light_is_no_fault(refusal: Callable[..., str]) -> None:
    """A link of 0.1 mg on its own axis, the tool beyond it without mass: 1e-8 of the largest entry of M."""
    inertia = "".join(f' {name}="{2e-8 if name[1] == name[2] else 0}"' for name in INERTIA)
    light = f'<inertial><mass value="1e-7"/><inertia{inertia}/></inertial>'
    assert refusal(planar(last=light)) == ""


def test_two_joints_about_one_axis_are_regular_if_anything_lies_between(refusal: Callable[..., str]) -> None:
    """1e-6 of what both move: the mass matrix's least eigenvalue is as small, and it is no rounding."""
    bodies = BODY.format(com=0.15, mass=1)
    apart, _, wrist = planar().rpartition('xyz="0.3 0 0"/><axis')
    first, between, last = f'{apart}xyz="0 0 0"/><axis{wrist}'.split(bodies)
    for size, taken in ((1e-8, True), (0.0, False)):
        inertia = "".join(f' {name}="{size if name[1] == name[2] else 0}"' for name in INERTIA)
        light = f'<inertial><mass value="{size}"/><inertia{inertia}/></inertial>'
        answer = refusal(f"{first}{bodies}{between}{light}{last}", "path.length=0.001")
        assert (answer == "") is taken, answer


def test_a_root_that_no_body_is(refusal: Callable[..., str]) -> None:
    bad = planar().replace('izz="0.008"', 'izz="0.5"', 1)
    assert re.search("link 'l0' has an inertia that no body has", refusal(bad, "base=free"))
    assert refusal(bad) == ""  # it stands still
    assert refusal(bad, "base=free", "robot.repair_inertia=true") == ""


def test_a_spacecraft_by_its_mass_alone(refusal: Callable[..., str]) -> None:
    """The first joint at its centre: base and first link can turn against each other without moving any mass."""
    bare = planar().replace(BODY.format(com=0, mass=2), "", 1)
    line = refusal(bare, "base=free", "base.mass=20")
    assert line.startswith("base.inertia = 0, and the root link has none")
    assert refusal(bare, "base=free", "base.mass=20", "base.inertia=0.5") == ""
    assert refusal(planar(), "base=free", "base.mass=20") == ""  # the root link's own inertia is enough
    assert refusal(bare, "base=free", "base.mass=20", "base.com=[0.2,0,0]") == ""  # a lever is one, too


def test_a_point_mass_on_the_last_axis(refusal: Callable[..., str]) -> None:
    point = planar(last=POINT.replace("0.15 0 0", "0 0 0.1"))
    line = refusal(point)
    assert "link l3: moving joint j3 moves no mass" in line
    assert line.endswith("give the link an inertia, or robot.armature")
    assert refusal(point, "robot.armature=0.001") == ""
    assert refusal(planar(last=POINT)) == ""  # off the axis
