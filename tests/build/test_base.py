"""What `base=` refuses, in one line each, and what it makes of a problem."""

from __future__ import annotations

import numpy as np
import pytest

from pipeline.build.problem import prepare
from pipeline.common.errors import ConfigError
from pipeline.run.state import state
from tests.support import composed

FREE = ("base=free", "base.mass=10", "base.inertia=0.2")
PANDA = ("robot=panda", "path.direction=[0,1,0]", "path.length=0.1")


@pytest.mark.parametrize(
    ("words", "message"),
    [
        (("objective=base_rotation",), r"base_rotation: the base does not move; set base=free"),
        (
            ("methods=[pareto]", "method.pareto.objectives=[kinetic_energy,base_rotation]"),
            r"base_rotation: the base does not move",
        ),
        ((*FREE, "objective=reaction"), r"reaction: nothing acts on a base that floats; set base=fixed"),
        (("limits.attitude=0.1",), r"limits\.attitude = 0\.1: the base does not move; set base=free"),
        (("base=free",), r"base\.mass: not given, and the root link base of planar3r has no mass"),
        ((*FREE[:2], "base.inertia=[1,1,3]"), r"base\.inertia = .*: no body has the principal moments 1, 1, 3"),
        ((*FREE[:2], "base.inertia=[1,2]"), r"base\.inertia = \[1\.0, 2\.0\]: must be one moment, three or six"),
        ((*FREE, "gravity=earth"), r"gravity: a floating base falls under it"),
        (
            (*FREE, "objective.secondary=manipulability"),
            r"objective\.secondary: secondary criteria are for arms on a fixed",
        ),
        *(
            ((*FREE, f"base.{word}"), r"base: a planar arm has linear momentum in x and y")
            for word in ("linear_momentum=[0,0,1]", "angular_momentum=[1,0,0]", "angular_momentum=[0,1,0]")
        ),
        (
            (*FREE, "methods=[dynamic_programming]"),
            r"dynamic_programming: the base is floating; .* fixed base; .*"
            r"methods that serve this problem: lsv, inertia_weighted, pmke, receding, global, pareto$",
        ),
        (
            (*FREE, "methods=[calculus_of_variations,pontryagin]"),
            r"calculus_of_variations: the base is (held|floating); .* fixed base",
        ),
        (("objective=reaction", "methods=[pontryagin]"), r"pontryagin: the base is (held|floating); .* fixed base"),
        (
            (*FREE, "method.global.starts=[population,dynamic_programming]"),
            r"global: method\.global\.starts = population, dynamic_programming: dynamic_programming: "
            r"the base is floating; .* starts = roadmap",
        ),
        ((*FREE, "closed_loop.run=true"), r"closed_loop\.run: the controller is one for arms on a fixed base"),
        (("objective=reaction", "objective.torque=0"), r"objective = reaction: all its weights are zero"),
        (("objective=weighted", "objective.base_rotation=0.5"), r"= 1\.5: the weights must add up to 1"),
    ],
)
def test_what_does_not_go_together(words: tuple[str, ...], message: str) -> None:
    with pytest.raises(ConfigError, match=message) as caught:
        state(composed(*words))
    assert "\n" not in str(caught.value)


def test_a_planar_arm_has_three_more_coordinates_and_a_spatial_one_six() -> None:
    plane, space = prepare(composed(*FREE)), prepare(composed(*PANDA, *FREE, "limits=joint", "limits.attitude=0.2"))
    assert plane.task.arm.base.count == 3
    assert plane.task.redundancy == 1
    np.testing.assert_array_equal(plane.q_init, [0, 0, 0, 0, 0.327, -0.754])
    assert space.task.arm.base.count == 6
    assert space.task.redundancy == 4
    assert np.isinf(space.bounds.upper[:6]).all()
    assert np.isfinite(space.bounds.upper[6:]).all()
    assert space.bounds.attitude == 0.2


def test_the_root_link_or_a_body_bolted_to_it() -> None:
    own, added = prepare(composed("robot=planar3r_base", "base=free")), prepare(composed("robot=planar3r_base", *FREE))
    q = own.q_init[None]
    both = [problem.task.arm.mass_matrix(q)[0] for problem in (own, added)]
    arm = 0.615 + 0.8156 + 0.5055
    assert both[0][0, 0] == pytest.approx(20 + arm)
    assert both[1][0, 0] == pytest.approx(30 + arm)
    assert both[1][2, 2] - both[0][2, 2] == pytest.approx(0.2)


def test_a_reaction_holds_the_base() -> None:
    problem = prepare(composed("objective=reaction", "gravity=earth"))
    assert problem.task.arm.base.kind == "held"
    assert problem.task.arm.base.count == 3
    assert prepare(composed()).task.arm.base.kind == "fixed"
