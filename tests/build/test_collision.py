"""Which links may touch, what is refused, and what is not known."""

from __future__ import annotations

from pathlib import Path

import pytest

from pipeline.build.collision import in_space, make_own, may_touch
from pipeline.build.problem import prepare
from pipeline.build.robot import load
from pipeline.common.errors import ConfigError, PathError, RobotError
from pipeline.config.robot import CollisionConfig
from pipeline.problem.problem import Problem
from pipeline.robot.touching import groups
from tests.support import composed, robot

FOLDED = "robot.q_init=[-1.297,-0.069,0.136,-2.111,-2.121,0.049,0.345]"  # link 5 in the hand
PANDA = ("robot=panda", "path.direction=[0,1,0]", "path.length=0.01", "timing.steps=8")
ARM = """<robot name="a"><link name="base"/>{links}
<joint name="j1" type="continuous"><parent link="base"/><child link="a"/><axis xyz="0 0 1"/></joint>
<joint name="j2" type="continuous"><parent link="a"/><child link="b"/><origin xyz="0 0 0.4"/><axis xyz="0 1 0"/></joint>
<joint name="j3" type="continuous"><parent link="b"/><child link="c"/><origin xyz="0 0 0.4"/><axis xyz="1 0 0"/></joint>
</robot>"""
LINK = """<link name="{name}"><inertial><mass value="1"/><inertia ixx="1" iyy="1" izz="1" ixy="0" ixz="0" iyz="0"/>
</inertial><collision><geometry>{solid}</geometry></collision></link>"""

TURNING = '<child link="b"/><axis xyz="0 0 1"/>'
SLIDING = '<axis xyz="0 0 1"/><limit lower="-{most}" upper="{most}" effort="1" velocity="1"/>'


def posed(*words: str) -> Problem:
    return prepare(composed(*PANDA, *words))


def own_arm(folder: Path, **solids: str) -> tuple[str, ...]:
    file = folder / "arm.urdf"
    links = "".join(LINK.format(name=name, solid=solid) for name, solid in solids.items())
    file.write_text(ARM.format(links=links), encoding="utf-8")
    return f"robot.urdf={file}", "robot.end_effector=c", "robot.q_init=null", "robot.task=[x,y,z]"


def test_pairs_are_those_of_rigid_groups() -> None:
    description = robot("panda").description
    own = make_own(CollisionConfig(), robot("panda"))
    assert own is not None
    assert own.kept
    number = groups(description)
    assert number["panda_link0"] == 0
    assert number["panda_hand"] == number["panda_link7"] == number["panda_leftfinger"] == 7
    assert all(number[second] - number[first] > 1 for first, second in own.pairs)
    assert {("panda_link0", "panda_link2"), ("panda_link5", "panda_link7")} <= set(own.pairs)
    assert len(own.pairs) == 39


def test_an_srdf_and_pairs_of_ones_own(tmp_path: Path) -> None:
    srdf = tmp_path / "a.srdf"
    srdf.write_text('<robot name="a"><disable_collisions link1="panda_link7" link2="panda_link5"/></robot>')
    allow = CollisionConfig(srdf=str(srdf), allow=(("panda_link2", "panda_link0"),))
    own = make_own(allow, robot("panda"))
    assert own is not None
    assert own.allowed == 2
    assert not {("panda_link0", "panda_link2"), ("panda_link5", "panda_link7")} & set(own.pairs)
    with pytest.raises(RobotError, match=r"collision\.srdf = .*none\.srdf: no such file"):
        make_own(CollisionConfig(srdf=str(tmp_path / "none.srdf")), robot("panda"))
    with pytest.raises(ConfigError, match=r"collision\.allow: no link is called hand; did you mean panda_hand"):
        may_touch(CollisionConfig(allow=(("hand", "panda_link5"),)), robot("panda"), ())


def test_a_start_that_collides_names_the_pair_and_the_key() -> None:
    said = r"robot\.q_init: panda_link5 is -0\.0.* m from panda_(hand|link7), less than collision\.margin = 0\.005 m"
    with pytest.raises(ConfigError, match=rf"{said} \(collision\.allow=\[\[panda_link5,panda_(hand|link7)\]\]"):
        posed(FOLDED, "collision.srdf=none")
    posed(FOLDED)  # the arm's own SRDF allows it


def test_a_path_inside_a_link_is_refused(tmp_path: Path) -> None:
    file = tmp_path / "points.csv"
    file.write_text("x,y,z\n0.4,0.1,0.4\n0,0,0.3\n", encoding="utf-8")
    words = ("robot=panda", "boundary=free", "timing.steps=8", "path=waypoints", f"path.file={file}")
    with pytest.raises(PathError, match=r"path: it runs 0\.\d+ m inside link panda_link1 \(at 0\.\d+ m along it\)"):
        prepare(composed(*words))
    ball = "+obstacles.shapes.ball={kind: sphere, center: [0.4, 0.1, 0.4], radius: 0.05}"
    with pytest.raises(PathError, match="inside obstacle ball"):
        prepare(composed(*words, "collision.self=false", ball))


def test_planar_arms_are_left_alone_unless_asked() -> None:
    assert not in_space(robot("planar4r"))
    assert in_space(robot("panda"))
    assert make_own(CollisionConfig(), robot("planar4r")) is None
    asked = make_own(CollisionConfig(own=True), robot("planar4r"))
    assert asked is not None
    assert asked.kept
    with pytest.raises(ConfigError, match=r"collision\.self = true: planar3r has no collision shapes"):
        make_own(CollisionConfig(own=True), robot("planar3r"))


def test_a_missing_mesh_matters_where_it_is_used(tmp_path: Path) -> None:
    ball = '<sphere radius="0.05"/>'
    words = own_arm(tmp_path, a=ball, b=ball, c='<mesh filename="lost.stl"/>')
    arm = load(composed(*words).robot)
    own = make_own(CollisionConfig(), arm)
    assert own is not None
    assert not own.kept
    assert "link 'c': the mesh" in own.unknown
    with pytest.raises(RobotError, match=r"link 'c': the mesh .*lost\.stl was not found"):
        make_own(CollisionConfig(own=True), arm)


def test_pairs_whose_gap_no_motion_changes_are_left_out(tmp_path: Path) -> None:
    """Balls 8 mm apart that slide by 1 mm are near by their build, where 8 mm are to be kept; by 6 mm they may not."""
    ball = '<sphere radius="0.196"/>'
    words = own_arm(tmp_path, a=ball, b='<box size="0.01 0.01 0.01"/>', c=ball)
    file = Path(words[0].partition("=")[2])
    turning = file.read_text().replace('<child link="b"/><origin xyz="0 0 0.4"/><axis xyz="0 1 0"/>', TURNING)
    turning = turning.replace('name="j3" type="continuous"', 'name="j3" type="prismatic"')
    for slides, margin, left_out in ((0.001, 0.008, True), (0.001, 0.003, False), (0.006, 0.008, False)):
        file.write_text(turning.replace('<axis xyz="1 0 0"/>', SLIDING.format(most=slides)), encoding="utf-8")
        own = make_own(CollisionConfig(margin=margin), load(composed(*words).robot))
        assert own is not None
        assert (own.always, own.pairs) == (((("a", "c"),), ()) if left_out else ((), (("a", "c"),)))


def test_pairs_that_always_touch_are_left_out(tmp_path: Path) -> None:
    """Capsules of links a and c that meet wherever the joints are: Drake would search for ever."""
    words = own_arm(tmp_path, a='<capsule radius="0.3" length="0.4"/>', b='<sphere radius="0.05"/>',
                    c='<capsule radius="0.3" length="0.4"/>')  # fmt: skip
    own = make_own(CollisionConfig(), load(composed(*words).robot))
    assert own is not None
    assert own.always == (("a", "c"),)
    assert not own.kept
