"""Cycles that wind a joint without limits on by full turns."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from pipeline.build.problem import prepare
from pipeline.config.methods import GlobalOptions
from pipeline.evaluation.evaluation import evaluate
from pipeline.methods.global_planner.planner import global_planner
from pipeline.problem.limits import Limits
from pipeline.problem.problem import Problem
from pipeline.problem.solution import Status
from pipeline.problem.turns import endless, full_turns
from tests.support import composed

AROUND = ("path=circle", "path.radius=0.3", "path.start=[0.3,0]", "robot.q_init=[0.2,0.9,0.8]", "boundary=cyclic")


def around_the_base(*words: str) -> Problem:
    """A circle about the first joint, which comes back only turned by 2 pi."""
    return prepare(composed(*AROUND, "timing.steps=24", *words))


def test_the_planner_closes_a_cycle_around_the_base_up_to_a_full_turn() -> None:
    problem = around_the_base()
    (best, *_) = global_planner(
        problem, GlobalOptions(starts="population", configurations=4, candidates=12, optimised=2)
    )
    motion = evaluate(problem, best)
    assert motion.status is Status.SOLVED
    np.testing.assert_allclose(motion.q[-1] - motion.q[0], [2 * np.pi, 0, 0], atol=1e-7)
    assert motion.message.endswith("the cycle closes up to full turns: joint1 +1")


def test_only_joints_that_nothing_limits_may_wind() -> None:
    free, limited = around_the_base(), around_the_base("limits.upper=9", "limits.lower=-9")
    assert endless(free).all()
    assert not endless(limited).any()
    start, end = np.zeros((2, 3)), np.array([[6.2, -6.4, 0.1], [-13.0, 3.0, 0.0]])
    np.testing.assert_allclose(full_turns(free, start, end) / (2 * np.pi), [[1, -1, 0], [-2, 0, 0]])
    np.testing.assert_array_equal(full_turns(limited, start, end), 0.0)


@pytest.mark.parametrize(("side", "limit"), [("lower", -1.0), ("upper", 1.0)])
def test_a_limit_on_one_side_alone_keeps_a_joint_from_winding(side: str, limit: float) -> None:
    limits = replace(Limits.none(3), **{side: np.array([limit, *(2 * [np.copysign(np.inf, limit)])])})
    np.testing.assert_array_equal(endless(replace(around_the_base(), limits=limits)), [False, True, True])


def test_joints_alone_wind_as_they_do_with_their_floating_base() -> None:
    floating = prepare(composed("robot=planar3r_base", "base=free"))
    end = 2 * np.pi * np.array([1.0, -2.0, 0.1])
    np.testing.assert_allclose(full_turns(floating, np.zeros(3), end) / (2 * np.pi), [1, -2, 0])
    whole = np.concatenate([np.full(floating.task.arm.n - 3, 9.0), end])
    np.testing.assert_array_equal(full_turns(floating, 0 * whole, whole)[:-3], 0.0)
