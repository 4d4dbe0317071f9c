"""Retiming against what is known in closed form."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from pipeline.evaluation.evaluation import evaluate
from pipeline.model.kinematics import project
from pipeline.problem.limits import Limits
from pipeline.problem.solution import Solution, Status, Trajectory
from pipeline.studies.retiming import retimed, study
from pipeline.studies.study import Motions
from tests.support import composed, free_line

STRAIGHT = np.linspace(0.0, 1.0, 41)[:, None] * np.array([0.9, 0.3, -0.6])  # in the space of joints


def test_a_straight_joint_path_is_run_through_by_bang_and_bang() -> None:
    """T = 2 sqrt(d / A) of the joint that goes farthest; and with a bound V of its speed d / V + V / A."""
    bounds = replace(Limits.none(3), acceleration=np.full(3, 2.0))
    asked = replace(free_line(8), limits=bounds)
    assert retimed(asked, STRAIGHT) == pytest.approx(2 * np.sqrt(0.9 / 2.0), rel=1e-3)
    slow = replace(asked, limits=replace(bounds, velocity=np.array([0.5, np.inf, np.inf])))
    assert retimed(slow, STRAIGHT) == pytest.approx(0.9 / 0.5 + 0.5 / 2.0, rel=1e-3)


def test_torques_count() -> None:
    """A motion that starts from rest with all of one joint's torque cannot be faster than the whole of it allows."""
    asked = replace(free_line(8), limits=replace(Limits.none(3), torque=np.full(3, 0.5)))
    half = replace(asked, limits=replace(Limits.none(3), torque=np.full(3, 0.125)))
    assert retimed(half, STRAIGHT) == pytest.approx(2 * retimed(asked, STRAIGHT), rel=1e-3)  # of time squared


def test_the_pace_of_the_tool_counts() -> None:
    """On a straight line up to the speed V with the acceleration A and down again: L / V + V / A, or 2 sqrt(L / A)."""
    asked = free_line(4)
    length = asked.reference.geometry.length
    motion = [project(asked.task, np.array([[-0.389, 0.520, 0.190]]), asked.reference.along(np.zeros(1))[0])[0]]
    for point in asked.reference.along(np.linspace(0.0, length, 101)[1:])[0]:
        motion.append(project(asked.task, motion[-1], point[None])[0])
    for speed, least in ((0.4, length / 0.4 + 0.4 / 2.0), (np.inf, 2 * np.sqrt(length / 2.0))):
        bounds = replace(Limits.none(3), tool_speed=speed, tool_acceleration=2.0)
        assert retimed(replace(asked, limits=bounds), np.concatenate(motion)) == pytest.approx(least, rel=1e-2)


def test_it_is_made_where_it_is_asked_for() -> None:
    asked = replace(free_line(40), limits=replace(Limits.none(3), acceleration=np.full(3, 2.0)))
    motion = evaluate(asked, Solution("lsv", Trajectory(asked.times * 1.0, STRAIGHT + asked.q_init), Status.SOLVED))
    assert study(Motions(composed(), asked, [motion])) is None
    made = study(Motions(composed("retiming.run=true"), asked, [motion]))
    assert made is not None
    assert made.seconds == {motion.label: pytest.approx(2 * np.sqrt(0.9 / 2.0), rel=2e-2)}
    assert made.section()[0].startswith(f"Retimed by toppra: {motion.label} 1.3")
    assert made.columns(motion) == {"retimed_duration": made.seconds[motion.label]}
