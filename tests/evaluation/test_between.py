"""What a motion does between its knots, against cubics by hand, another code's torques, and distances of segments."""

from __future__ import annotations

from dataclasses import replace
from itertools import pairwise
from types import SimpleNamespace

import numpy as np
import pytest
from scipy.integrate import quad_vec
from scipy.interpolate import CubicSpline

from pipeline.common.arrays import Array
from pipeline.evaluation.between import Between, audit, between_knots
from pipeline.evaluation.certified import Near, near
from pipeline.evaluation.clearance import Clearance
from pipeline.evaluation.plant import SinglePlant
from pipeline.model.arm import Arm
from pipeline.model.coordinates import PLANE
from pipeline.model.floating import Floating
from pipeline.model.obstacles import Obstacles
from pipeline.model.task import PositionTask
from pipeline.path.curves import Line
from pipeline.path.reference import Reference
from pipeline.path.timing import RaisedCosine
from pipeline.problem.curve import whole
from pipeline.problem.limits import Limits
from pipeline.problem.problem import Problem
from pipeline.problem.solution import Trajectory
from pipeline.robot.shapes import Shape
from pipeline.robot.spacecraft import Spacecraft
from tests.support import segment_distances, with_shapes

TIME = np.array([0.0, 0.6, 1.0, 1.7, 2.0])
CUBIC = np.array([[0.02, -0.05, 0.03], [0.1, 0.04, -0.2], [-0.2, 0.3, 0.1]])  # of t^3, t^2, t


def at(moments: Array, order: int = 0) -> Array:
    """The motion (K, 3) that is a cubic in every joint, about which a spline can say nothing else; its derivatives."""
    start = np.array([0.1, 0.4, -0.8])
    powers = np.vstack([CUBIC, start])
    return np.column_stack([np.poly1d(column).deriv(order)(moments) for column in powers.T])


def problem(task: PositionTask, **bounds: float | Array) -> Problem:
    """A line that nothing here follows, from rest, with limits on every joint of a few kinds."""
    n = task.arm.n
    unlimited = {"lower": -np.inf} | dict.fromkeys(("upper", "velocity", "torque", "power"), np.inf)
    filled = {key: np.broadcast_to(value, n).astype(float) for key, value in (unlimited | bounds).items()}
    reference = Reference(Line(np.array([0.5, 0.0]), np.array([-1.0, 0.0]), 0.1), RaisedCosine(2.0))
    return Problem(task, reference, np.zeros(n), TIME, limits=Limits(**filled))  # type: ignore[arg-type]


FREE = Near()


def judged(stated: Problem, q: Array, ends: Array | None = None, clear: Near = FREE) -> Between:
    plant = SinglePlant(stated.task.arm)
    return between_knots(stated, plant, clear, Trajectory(TIME, q, ends=ends), np.zeros(q.shape[1]))


def test_a_cubic_s_jerk_torque_and_integrals(task: PositionTask, peer: SimpleNamespace) -> None:
    """Torques also where nothing is limited: those of a spline are known."""
    jerk = 6 * np.abs(CUBIC[0])
    found = judged(problem(task, jerk=jerk / 1.25), at(TIME), at(TIME[[0, -1]], 1))
    assert found.limit_excess == pytest.approx({"jerk": 0.25})
    unlimited = judged(problem(task), at(TIME), at(TIME[[0, -1]], 1))
    assert unlimited.limit_excess == {}

    def squares(moment: float) -> Array:
        q, qd, qdd = (at(np.array([moment]), order) for order in range(3))
        return (peer.torque(q, qd, qdd) ** 2).sum(axis=1)

    for seen in (found, unlimited):
        assert seen.running["torque"][-1] == pytest.approx(quad_vec(squares, 0.0, 2.0)[0][0], rel=1e-6)


def test_torques_of_knots_alone_count_where_they_are_limited(task: PositionTask, peer: SimpleNamespace) -> None:
    spline = CubicSpline(TIME, at(TIME), bc_type=((1, np.zeros(3)), "not-a-knot"))
    moments = np.concatenate([np.linspace(*span, 11) for span in pairwise(TIME)])
    tau = np.abs(peer.torque(*(spline(moments, order) for order in range(3)))).max(axis=0)
    found = judged(problem(task, torque=tau / np.array([1.5, 1.2, 1.1])), at(TIME))
    assert found.limit_excess == pytest.approx({"torque": 0.5}, rel=1e-9)
    assert "torque" not in found.running


def test_what_is_nearest_between_two_knots() -> None:
    """A ball that the tip passes at 1.35 s, half way between two knots: neither of them is near it."""
    arm = with_shapes("planar3r")
    tip = arm.position(at(np.array([1.35])))[0]
    ball = Shape("ball", "sphere", (0.001,), (*tip[:2], 0.03))
    stated = replace(problem(PositionTask(arm)), obstacles=Obstacles((ball,), 0.02))
    fine = segment_distances(arm, (ball,), at(np.linspace(0.0, 2.0, 401))).min()
    trajectory = Trajectory(TIME, at(TIME), ends=at(TIME[[0, -1]], 1))
    clear = near(stated, Clearance(arm, stated.obstacles), whole(stated, trajectory), TIME)
    found, bound = judged(stated, trajectory.q, trajectory.ends, clear), clear.obstacles.bound
    at_knots = segment_distances(arm, (ball,), at(TIME)).min()
    assert fine < at_knots
    assert fine - 2e-4 <= bound <= fine
    assert found.limit_excess["clearance"] == pytest.approx(1 - bound / 0.02)


@pytest.fixture(scope="module")
def turning() -> Arm:
    """The planar arm on a base that floats."""
    craft = Spacecraft(20.0, ((1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0)))
    fixed = with_shapes("planar3r")
    return Arm(fixed.description, fixed.mounting, Floating(craft, PLANE))


def test_how_much_a_base_turns(turning: Arm) -> None:
    """Yaw t^2 (3 - t) / 4 comes to 1 rad at 2 s; its rate squared integrates to 0.6 rad^2/s."""
    yaw = TIME**2 * (3 - TIME) / 4
    q = np.column_stack([np.zeros((5, 2)), yaw, np.zeros((5, 3))])
    stated = problem(PositionTask(turning))
    stated = replace(stated, limits=replace(stated.bounds, attitude=0.8))
    found = judged(stated, q, np.zeros((2, 6)))
    assert found.running["base_rotation"][-1] == pytest.approx(0.6, rel=1e-5)
    assert found.limit_excess["attitude"] == pytest.approx(0.25)


def test_where_samples_are_at_their_worst(turning: Arm) -> None:
    """The base has turned most at the sample before the last; the ball is nearest at the second."""
    q = np.zeros((4, 6))
    q[:, 2] = [0.0, 0.1, -0.7, 0.2]
    q[:, 3] = [0.9, 0.4, 1.5, 0.8]
    tip = turning.position(q[1:2])[0]
    ball = Shape("ball", "sphere", (0.001,), (*tip[:2], 0.03))
    stated = replace(problem(PositionTask(turning)), obstacles=Obstacles((ball,), 0.02))
    stated = replace(stated, limits=replace(stated.bounds, attitude=0.5))
    found = audit(stated, CubicSpline(TIME[:4], q), TIME[:4], TIME[:4])
    assert (found.worst["attitude"][0], found.worst["clearance"][0]) == (2, 1)
    assert found.limit_excess["attitude"] == pytest.approx(0.4)
