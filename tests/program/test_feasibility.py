"""The least violation against problems whose true one can be computed without a solver."""

from __future__ import annotations

import numpy as np
import pytest

from pipeline.common.arrays import Array
from pipeline.model.kinematics import project
from pipeline.model.task import PositionTask
from pipeline.path.curves import Line
from pipeline.path.reference import Reference
from pipeline.path.timing import RaisedCosine
from pipeline.problem.limits import Limits
from pipeline.problem.problem import Boundary, Problem
from pipeline.program.feasibility import Violation, least_violation, violations
from pipeline.search.self_motion import manifold

FREE = np.full(3, np.inf)


def inward(task: PositionTask, q_init: Array, limits: Limits) -> Problem:
    """Straight towards the base: the arm must fold, and how far it must is known for every distance."""
    start = task.value(q_init[None])[0]
    line = Line(start, -start / np.linalg.norm(start), 0.25)
    times = np.linspace(0.0, 1.0, 9)
    return Problem(task, Reference(line, RaisedCosine(1.0)), q_init, times, limits=limits, boundary=Boundary.FREE)


def motion_along(problem: Problem) -> Array:
    rows = [problem.q_init[None]]
    for point in problem.reference.position(problem.times[1:]):
        rows.append(project(problem.task, rows[-1], point[None])[0])
    return np.concatenate(rows)


def least_fold(task: PositionTask, distance: float) -> float:
    """The smallest b [rad] with a configuration |q_2|, |q_3| <= b whose tip is `distance` from the base.

    On the square's edge, by brute force: joint 1 turns the whole arm and does not matter.
    """
    line = np.linspace(-1.0, 1.0, 401)
    edge = np.concatenate([np.column_stack([np.ones(401), line]), np.column_stack([line, np.ones(401)])])

    def nearest(b: float) -> float:
        q = np.column_stack([np.zeros(len(edge)), b * edge])
        return float(np.linalg.norm(task.value(q), axis=1).min())

    low, high = 0.0, np.pi
    for _ in range(30):
        middle = (low + high) / 2
        low, high = (middle, high) if nearest(middle) > distance else (low, middle)
    return high


@pytest.mark.parametrize("fraction", [0.98, 0.8])
def test_least_violation_of_position_limits_is_the_true_one(task: PositionTask, q_init: Array, fraction: float) -> None:
    plain = inward(task, q_init, Limits.none(3))
    distance = float(np.linalg.norm(plain.reference.position(plain.times), axis=1).min())
    needed = least_fold(task, distance)
    bound = fraction * needed * np.array([np.inf, 1.0, 1.0])
    problem = inward(task, q_init, Limits(-bound, bound, FREE, FREE, FREE))
    relaxed = least_violation(problem, problem.times, [motion_along(problem)])
    assert relaxed is not None
    assert not relaxed.feasible
    found = relaxed.worst
    assert found.kind == "position"
    assert found.joint in ("joint2", "joint3")
    # Relative to half the range, which is the limit itself here.
    assert found.relative == pytest.approx(1 / fraction - 1, abs=1e-4)
    assert abs(found.reached) == pytest.approx(needed, rel=1e-4)
    assert found.time == pytest.approx(1.0)
    assert f"the position limit of {found.joint} ({found.limit:.4g} rad)" in relaxed.sentence
    assert relaxed.sentence.startswith("the one attempt")  # not that it cannot be met: one start shows no such thing


def test_a_limit_just_wide_enough_is_not_violated(task: PositionTask, q_init: Array) -> None:
    plain = inward(task, q_init, Limits.none(3))
    distance = float(np.linalg.norm(plain.reference.position(plain.times), axis=1).min())
    bound = 1.001 * least_fold(task, distance) * np.array([np.inf, 1.0, 1.0])
    problem = inward(task, q_init, Limits(-bound, bound, FREE, FREE, FREE))
    found = least_violation(problem, problem.times, [motion_along(problem)])
    assert found is not None
    assert found.feasible
    assert found.worst.relative <= 1e-6
    assert np.abs(found.q[:, 1:]).max() <= bound[1] * (1 + 1e-6)
    np.testing.assert_allclose(task.value(found.q), problem.reference.position(problem.times), atol=1e-6)


@pytest.mark.slow
@pytest.mark.parametrize("fraction", [0.95, 0.5])
def test_least_violation_of_velocity_limits_is_the_true_one(
    task: PositionTask, q_init: Array, rng: np.random.Generator, fraction: float
) -> None:
    """One step from a given start: every configuration at its end is on one curve, which can be looked through."""
    start = task.value(q_init[None])[0]
    line = Line(start, np.array([-1.0, 0.0]), 0.08)
    times = np.array([0.0, 1.0])
    loops = manifold(task, line.sample(np.array([0.08]))[0][0], rng, spacing=1e-4)
    nodes = np.concatenate([loop.q for loop in loops])
    gap = nodes - q_init
    gap -= 2 * np.pi * np.rint(gap / (2 * np.pi))
    needed = float(np.abs(gap).max(axis=1).min())
    limits = Limits(-FREE, FREE, np.full(3, fraction * needed), FREE, FREE)
    problem = Problem(task, Reference(line, RaisedCosine(1.0)), q_init, times, limits=limits)
    relaxed = least_violation(problem, times, [motion_along(problem)])
    assert relaxed is not None
    found = relaxed.worst
    assert (found.kind, found.time) == ("velocity", 1.0)
    assert found.relative == pytest.approx(1 / fraction - 1, abs=1e-3)


def test_the_best_of_several_starts_counts(task: PositionTask, q_init: Array) -> None:
    bound = np.array([np.inf, 0.5, 0.5])
    problem = inward(task, q_init, Limits(-bound, bound, FREE, FREE, FREE))
    own = motion_along(problem)
    mirrored = own + np.array([0.0, 0.0, 2 * np.pi])  # a full turn of joint 3: far outside, and hard to bring back
    alone = [least_violation(problem, problem.times, [guess]) for guess in (own, mirrored)]
    both = least_violation(problem, problem.times, [mirrored, own])
    assert both is not None
    assert both.worst.relative == min(found.worst.relative for found in alone if found is not None)


def test_the_limit_to_blame_is_the_one_that_must_give_way(task: PositionTask, q_init: Array) -> None:
    """Joint positions are wide enough alone and velocities are not; then the other way round."""
    plain = inward(task, q_init, Limits.none(3))
    distance = float(np.linalg.norm(plain.reference.position(plain.times), axis=1).min())
    needed = least_fold(task, distance) * np.array([np.inf, 1.0, 1.0])
    for width, speed, blamed in ((1.3, 0.5, "velocity"), (0.7, 20.0, "position")):
        limits = Limits(-width * needed, width * needed, np.full(3, speed), FREE, FREE)
        problem = inward(task, q_init, limits)
        found = least_violation(problem, problem.times, [motion_along(plain)])
        assert found is not None
        assert found.worst.kind == blamed
        kept = [other for other in violations(problem, problem.times, found.q) if other.kind != blamed]
        assert kept
        assert max(other.relative for other in kept) < 1e-6


def test_no_start_no_answer(task: PositionTask, q_init: Array) -> None:
    problem = inward(task, q_init, Limits(-FREE, FREE, np.full(3, 0.1), FREE, FREE))
    assert least_violation(problem, problem.times, []) is None


def test_violations_name_the_worst_knot_and_joint_of_each_kind(task: PositionTask, q_init: Array) -> None:
    times = np.array([0.0, 1.0, 2.0, 3.0])
    q = np.array([[0.0, 0.0, 0.0], [0.2, 0.5, 0.0], [0.2, 0.6, -0.9], [0.3, 0.6, -0.9]])
    limits = Limits(np.array([-1.0, -1.0, -0.5]), np.array([1.0, 0.5, 0.5]), np.array([0.1, 1.0, np.inf]), FREE, FREE)
    start = task.value(q_init[None])[0]
    problem = Problem(task, Reference(Line(start, np.array([1.0, 0.0]), 0.01), RaisedCosine(3.0)), q_init, times)
    found = violations(Problem(**{**vars(problem), "limits": limits}), times, q)
    assert [violation.kind for violation in found] == ["position", "position", "velocity"]
    above, below, speed = found
    assert (above.joint, above.limit, above.reached, above.time) == ("joint2", 0.5, 0.6, 2.0)
    assert above.relative == pytest.approx(0.1 / 0.75)  # of half the range
    assert (below.joint, below.limit, below.reached, below.time) == ("joint3", -0.5, -0.9, 2.0)
    assert below.relative == pytest.approx(0.4 / 0.5)
    assert (speed.joint, speed.limit, speed.time) == ("joint1", 0.1, 1.0)
    assert speed.reached == pytest.approx(0.2)
    assert speed.relative == pytest.approx(1.0)
    assert violations(problem, times, q) == []


def test_the_sentence_of_a_lower_limit_has_its_sign() -> None:
    violation = Violation("position", "elbow", -0.5, -0.9, 2.0, 0.8)
    assert violation.bound == "the position limit of elbow (-0.5 rad)"
    assert violation.extent == "80 % (-0.9 rad at t = 2 s)"


@pytest.mark.parametrize(("relative", "said"), [(1.67, "167 %"), (0.0123, "1.2 %"), (12.0, "1200 %")])
def test_percentages_are_read_by_people(relative: float, said: str) -> None:
    assert said in Violation("velocity", "elbow", 1.0, 1.0 + relative, 0.5, relative).extent
