"""Paths that lie in the world need no initial configuration; others take theirs from the middle of the ranges."""

from __future__ import annotations

import numpy as np

from pipeline.build.problem import prepare
from pipeline.problem.problem import Boundary
from tests.support import composed

NOWHERE = ("robot.q_init=null", "limits=joint", "timing.steps=10")


def test_a_path_in_the_world_may_begin_anywhere_within_the_limits_and_says_so() -> None:
    problem = prepare(composed(*NOWHERE, "path.start=[-0.3,0.2]", "path.length=0.1"))
    assert problem.boundary is Boundary.FREE
    assert any("sought in the whole joint space" in note for note in problem.reference.notes)
    np.testing.assert_allclose(problem.task.value(problem.q_init[None])[0], [-0.3, 0.2], atol=1e-9)
    assert ((problem.q_init >= problem.bounds.lower) & (problem.q_init <= problem.bounds.upper)).all()
    cyclic = prepare(composed(*NOWHERE, "path=circle", "path.start=[-0.3,0.2]", "boundary=cyclic"))
    assert cyclic.boundary is Boundary.CYCLIC


def test_what_takes_its_place_from_the_arm_or_has_a_configuration_starts_there() -> None:
    from_the_arm = prepare(composed("robot.q_init=null", "path.length=0.01", "path.direction=180"))
    given = prepare(composed("path.start=[-0.3,0.2]", "path.length=0.1"))
    for problem in (from_the_arm, given):
        assert problem.boundary is Boundary.FIXED
        assert not any("whole joint space" in note for note in problem.reference.notes)
