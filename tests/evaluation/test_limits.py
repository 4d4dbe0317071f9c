"""By how much limits are exceeded, against numbers by hand: every kind of limit on both of its sides."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from pipeline.evaluation.limits import excesses, limit_excess
from pipeline.model.task import PositionTask
from pipeline.path.curves import Line
from pipeline.path.reference import Reference
from pipeline.path.timing import ConstantSpeed
from pipeline.problem.limits import Limits
from pipeline.problem.problem import Problem

LOWER, UPPER = np.array([-1.0, -2.0, -3.0]), np.array([2.0, 2.0, 1.0])  # half ranges 1.5, 2, 2
SPEED, TORQUE, POWER = np.array([1.0, 2.0, 4.0]), np.array([5.0, 0.5, 1.0]), np.array([3.0, 3.0, 0.5])
REST = np.zeros((2, 3))


@pytest.fixture
def limited(task: PositionTask) -> Problem:
    q = np.zeros(3)
    reference = Reference(Line(task.value(q[None])[0], np.array([-1.0, 0.0]), 0.1), ConstantSpeed(1.0))
    limits = Limits(LOWER, UPPER, SPEED, TORQUE, POWER)
    return Problem(task, reference, q, np.array([0.0, 0.5, 1.0]), limits=limits)


@pytest.mark.parametrize(
    ("joint", "q", "excess"),
    [(0, 2.3, 0.2), (0, -1.3, 0.2), (1, 3.0, 0.5), (1, -3.0, 0.5), (2, 1.2, 0.1), (2, -3.2, 0.1), (2, 0.5, -0.25)],
)
def test_positions_beyond_either_limit(limited: Problem, joint: int, q: float, excess: float) -> None:
    at = REST.copy()
    at[1, joint] = q
    found = excesses(limited, at, REST, REST)["position"]
    assert found.shape == (2, 3)
    assert found[1, joint] == pytest.approx(excess)
    assert limit_excess(limited, at, REST, REST)["position"] == pytest.approx(max(excess, found[0].max()))


@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_speeds_torques_and_powers_in_either_direction(limited: Problem, sign: float) -> None:
    qd, tau = np.array([[0.5, 0.0, 5.0]]), np.array([[0.0, 0.6, 0.5]])
    found = limit_excess(limited, REST[:1], sign * qd, tau)
    assert found == pytest.approx({"position": -0.5, "velocity": 0.25, "torque": 0.2, "power": 4.0})
    assert limit_excess(limited, REST[:1], qd, sign * tau) == pytest.approx(found)


def test_what_is_not_limited_is_not_judged(limited: Problem) -> None:
    free = replace(limited, limits=Limits(*(sign * np.full(3, np.inf) for sign in (-1, 1, 1, 1, 1))))
    assert limit_excess(free, REST + 100, REST + 100, REST + 100) == {}
    below = replace(limited, limits=replace(free.bounds, velocity=SPEED))
    assert limit_excess(below, REST, REST + 2, REST) == pytest.approx({"velocity": 1.0})


@pytest.mark.parametrize("side", ["lower", "upper"])
def test_a_limit_on_one_side_alone_counts(limited: Problem, side: str) -> None:
    limits = replace(Limits.none(3), **{side: {"lower": LOWER, "upper": UPPER}[side]})
    beyond = {"lower": LOWER - 0.1, "upper": UPPER + 0.1}[side][None]
    found = limit_excess(replace(limited, limits=limits), beyond, REST[:1], REST[:1])
    assert found == pytest.approx({"position": 0.1})  # in radians where there is no range


def test_the_pace_of_the_tool(limited: Problem) -> None:
    pace = np.array([[0.5, 1.0], [0.3, 2.0]])
    asked = replace(limited, limits=replace(Limits.none(3), tool_speed=0.4, tool_acceleration=4.0))
    found = limit_excess(asked, REST, REST, REST, pace=pace)
    assert found == pytest.approx({"tool_speed": 0.25, "tool_acceleration": -0.5})
    assert limit_excess(replace(asked, limits=Limits.none(3)), REST, REST, REST, pace=pace) == {}
