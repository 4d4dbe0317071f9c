"""What a recording opens on: the motion to look at, the others as its ghosts, limits as lines."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from pipeline.artifacts.recording import blueprint, bounds, recording
from pipeline.methods.registry import METHODS
from pipeline.studies import style
from tests.reports import component, three_motions


def test_one_colour_per_motion() -> None:
    colors = [style.color(label) for label in (*METHODS, "global 2", "global 3", "pmke 2")]
    assert len(set(colors)) == len(colors)
    assert style.color("global") == METHODS["global"].color
    assert style.name("global 2") == "Planner's optimum 2"
    assert blueprint.slug("global 2") == "global_2"


def test_it_opens_on_the_motion_to_look_at_and_holds_the_clearance(tmp_path: Path) -> None:
    """The others are its ghosts; limits within reach are lines, what is beyond is said in the title."""
    report = three_motions()
    recording.write(report, tmp_path)
    file = tmp_path / "recording.rrd"
    sent, ghost = (component(file, f"/planar/{one}/stick", "LineStrips2D:colors")[0] for one in ("global", "global_2"))
    assert [sent >> 24, sent >> 16 & 255, sent >> 8 & 255] == list(blueprint.rgba("global")[:3])
    assert all(255 - (ghost >> shift & 255) < 0.4 * (255 - (sent >> shift & 255)) for shift in (24, 16))
    _, lines = recording.read_series(file, "/limits/joint_velocity")
    assert lines.tolist() == [[-0.1, 0.1]] * 2
    assert recording.read_series(file, "/limits/clearance")[1].tolist() == [[0.02]] * 2
    drawn = bounds.levels(report.motions.problem, report.motions.evaluations)
    assert bounds.outside(report.motions.problem, drawn) == {"joint_velocity": "limits from 9 on, outside"}
    for e in report.motions.evaluations:
        time, values = recording.read_series(file, f"/{blueprint.slug(e.label)}/clearance")
        np.testing.assert_array_equal(values[:, 0], e.clearance)
        np.testing.assert_allclose(time, e.time, atol=1e-9)
    plain = {"labels": ["lsv", "global"], "points": np.zeros((1, 3)), "revolute": [True], "planar": False, "ranges": {}}
    far = {"joint_velocity": "limits from 9 on, outside"}
    named = blueprint.build(**plain, among=True, first="global", outside=far).root_container
    joints = named.contents[-1]
    velocities = joints.contents[1].contents[1]
    assert velocities.name == "Joint velocities [rad/s], limits from 9 on, outside"
    assert velocities.contents == ["/global/joint_velocity", "/limits/joint_velocity"]
    assert (joints.name, joints.active_tab) == ("Joints", 1)
    checks = named.contents[1].contents[-1]
    assert checks.contents[0].name == "Clearance [m]"
    many = [f"pareto {number}" for number in range(1, 11)]  # of a front every point is there, most behind their eyes
    front = blueprint.build(many, np.zeros((1, 3)), [True], True, {}, first="pareto 4")
    space = front.root_container.contents[0].contents[0].contents[1]
    assert {f"/{blueprint.slug(one)}/**" for one in many} <= {*space.contents}
    assert set(space.visualizer_overrides) == {f"/pareto_{number}" for number in (2, 3, 5, 6, 7, 8, 9)}
