from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from itertools import pairwise
from types import SimpleNamespace

import numpy as np
import pytest
from scipy.integrate import quad_vec
from scipy.interpolate import CubicSpline

from pipeline.common.arrays import Array
from pipeline.evaluation.evaluation import evaluate
from pipeline.evaluation.sums import differences
from pipeline.model.task import PositionTask
from pipeline.path.timing import ConstantSpeed, RaisedCosine, Timing
from pipeline.problem.limits import Limits
from pipeline.problem.objective import Objective
from pipeline.problem.problem import Boundary, Problem
from pipeline.problem.solution import Solution, Status, Trajectory
from pipeline.program.transcription import transcribe

Make = Callable[[int, int], Problem]
Guess = Callable[[Problem], Array]
TIME = np.array([0.0, 0.5, 0.9, 1.5, 2.0, 2.6, 3.0])


@dataclass(frozen=True)
class Traced:
    """A path that is what the end effector draws along a given joint spline."""

    task: PositionTask
    spline: CubicSpline
    timing: Timing
    tolerance: float = np.inf
    orientation_tolerance: float = np.inf
    duration: float = 3.0
    exact: bool = True
    tolerances: tuple[float, float] = (np.inf, np.inf)

    def position(self, t: Array) -> Array:
        return self.task.value(self.spline(t))


@pytest.fixture
def knots(rng: np.random.Generator, q_init: Array) -> Array:
    return q_init + 0.3 * np.vstack([np.zeros(3), rng.uniform(-1, 1, size=(6, 3))])


def traced(task: PositionTask, knots: Array, at_rest: bool) -> Problem:
    """A torque problem from rest, which ties the first velocity, or an energy problem entered at speed."""
    ends = ((1, np.zeros(3)), "not-a-knot") if at_rest else "not-a-knot"
    timing = RaisedCosine(3.0) if at_rest else ConstantSpeed(3.0)
    objective = Objective({"torque": 1.0}) if at_rest else Objective()
    reference = Traced(task, CubicSpline(TIME, knots, bc_type=ends), timing)
    return Problem(task, reference, knots[0], TIME, objective=objective)  # type: ignore[arg-type]


def solution(knots: Array, tolerance: float = 1e-8, status: Status = Status.SOLVED) -> Solution:
    return Solution("global", Trajectory(TIME, knots), status, "as it was", tracking_tolerance=tolerance)


def test_every_quantity_equals_the_formulas_written_out(
    task: PositionTask, peer: SimpleNamespace, knots: Array
) -> None:
    got = evaluate(traced(task, knots, at_rest=True), solution(knots))
    dt = np.diff(TIME)
    qd = np.vstack([np.zeros(3), np.diff(knots, axis=0) / dt[:, None]])
    qdd = np.vstack([np.zeros(3), np.diff(qd, axis=0) / dt[:, None]])
    energy, torque = peer.energy(knots, qd), peer.torque(knots, qd, qdd)
    torque[0] = 0.0
    np.testing.assert_allclose(got.kinetic_energy, energy, rtol=1e-11)
    np.testing.assert_allclose(got.tau, torque, atol=1e-11)
    np.testing.assert_allclose(got.power, np.abs(torque * qd), atol=1e-11)
    np.testing.assert_allclose(got.energy_integral, [np.dot(energy[1:k], dt[: k - 1]) for k in range(1, 8)], rtol=1e-11)
    squares = (torque**2).sum(axis=1)
    np.testing.assert_allclose(
        got.torque_integral, [np.dot(squares[1:k], dt[: k - 1]) for k in range(1, 8)], rtol=1e-10
    )
    np.testing.assert_allclose(got.position[:, :2], peer.position(knots), atol=1e-13)
    np.testing.assert_allclose(got.spectral_radius, np.abs(np.linalg.eigvals(peer.mass(knots))).max(axis=1), rtol=1e-10)
    smallest = np.sqrt(np.linalg.eigvalsh(peer.jacobian(knots) @ peer.jacobian(knots).mT)[:, 0])
    np.testing.assert_allclose(got.singular_value, smallest, rtol=1e-8)
    np.testing.assert_allclose(np.linalg.norm(np.diff(got.skeleton, axis=1), axis=2), np.tile(peer.arm.length, (7, 1)))
    np.testing.assert_allclose(got.skeleton[:, -1], task.arm.position(knots), atol=1e-13)
    assert got.confirmed
    assert (got.status, got.message, got.label) == (Status.SOLVED, "as it was", "global")


@pytest.mark.parametrize("at_rest", [True, False])
def test_between_the_knots_of_an_exact_motion_there_is_no_error(
    task: PositionTask, peer: SimpleNamespace, knots: Array, at_rest: bool
) -> None:
    asked = traced(task, knots, at_rest)
    got = evaluate(asked, solution(knots))
    assert got.tracking_error.max() < 1e-14
    # The curve that is exported comes to rest at its end too.
    ends = "clamped" if at_rest else "not-a-knot"
    exported = Traced(task, CubicSpline(TIME, knots, bc_type=ends), asked.reference.timing, tolerance=1e-4)
    exact = replace(asked, reference=exported)  # type: ignore[type-var]
    assert evaluate(exact, solution(knots)).tracking_error_between < 1e-13
    spline = asked.reference.spline  # type: ignore[attr-defined]
    pieces = [
        quad_vec(lambda t: peer.energy(spline(t)[None], spline(t, 1)[None]), a, b)[0][0] for a, b in pairwise(TIME)
    ]
    assert got.energy_integral_spline == pytest.approx(sum(pieces), rel=1e-3)
    # Moved along its self-motion at one knot, the motion is exact at every knot and wrong in between.
    jacobian = task.jacobian(knots[3:4])[0]
    moved = knots.copy()
    moved[3] += 0.05 * np.cross(*jacobian) / np.linalg.norm(np.cross(*jacobian))
    for _ in range(8):
        error, jacobian = (value[0] for value in task.error_and_jacobian(moved[3:4], task.value(knots[3:4])))
        moved[3] -= np.linalg.pinv(jacobian) @ error
    other = evaluate(exact, solution(moved))
    assert other.tracking_error.max() < 1e-12
    assert other.tracking_error_between > 1e-4
    assert other.status is Status.UNCONFIRMED
    assert "off its path" in other.message
    assert "path.tolerance = 0.0001 m" in other.message
    assert evaluate(asked, solution(moved)).confirmed  # with a path that allows it


def test_a_motion_off_its_path_is_unconfirmed_and_says_where(task: PositionTask, knots: Array) -> None:
    off = knots.copy()
    off[4, 0] += 1e-3
    distance = np.linalg.norm(task.value(off[4:5]) - task.value(knots[4:5]))
    asked = traced(task, knots, at_rest=True)
    got = evaluate(asked, solution(off))
    assert got.status is Status.UNCONFIRMED
    assert not got.confirmed
    assert f"{distance:.2e} m off its path at t = 2.00 s" in got.message
    assert "global promises 1e-08 m" in got.message
    assert evaluate(asked, solution(off, tolerance=1.01 * distance)).status is Status.SOLVED
    assert evaluate(asked, solution(off, tolerance=0.99 * distance)).status is Status.UNCONFIRMED


@pytest.mark.parametrize("status", [Status.SINGULAR, Status.INFEASIBLE, Status.NOT_CONVERGED])
def test_a_failure_stays_what_it_is(task: PositionTask, knots: Array, status: Status) -> None:
    off = 0.0 if status is Status.SINGULAR else 0.01  # a singular motion is held to its path
    got = evaluate(traced(task, knots, at_rest=True), solution(knots + off, status=status))
    assert (got.status, got.message) == (status, "as it was")
    assert got.confirmed == (status is Status.SINGULAR)


@pytest.mark.parametrize("value", [np.nan, np.inf])
def test_a_motion_that_is_not_finite_is_unconfirmed(task: PositionTask, knots: Array, value: float) -> None:
    broken = knots.copy()
    broken[3, 1] = value
    got = evaluate(traced(task, knots, at_rest=True), solution(broken))
    assert got.status is Status.UNCONFIRMED
    assert "finite" in got.message


def test_differences_by_boundary() -> None:
    trajectory = Trajectory(np.array([0.0, 1.0, 3.0]), np.array([[0.0], [2.0], [8.0]]))  # speeds 2 and 3
    for boundary, at_rest, qd, qdd in (
        (Boundary.FIXED, True, [0, 2, 3], [0, 2, 0.5]),
        (Boundary.FREE, True, [0, 2, 3], [0, 2, 0.5]),
        (Boundary.FIXED, False, [2, 2, 3], [0, 0, 0.5]),
        (Boundary.CYCLIC, True, [3, 2, 3], [0.5, -1, 0.5]),
        (Boundary.CYCLIC, False, [3, 2, 3], [0.5, -1, 0.5]),
    ):
        got = differences(trajectory, boundary, at_rest)
        np.testing.assert_array_equal(got[0].ravel(), qd, err_msg=f"{boundary} {at_rest}")
        np.testing.assert_array_equal(got[1].ravel(), qdd, err_msg=f"{boundary} {at_rest}")


@pytest.mark.parametrize(("number", "published"), [(1, 5.969e-4), (2, 3.870e-3), (3, 6.093e-3)])
def test_the_published_optima(problem: Make, guess: Guess, number: int, published: float) -> None:
    """PMKE paper, Table 5, 101 points, in the digits that independent software gives."""
    asked = problem(number, 100)
    q, _, _ = transcribe(asked, asked.times, guess(asked)).solve()
    got = evaluate(asked, Solution("global", Trajectory(asked.times, q), Status.SOLVED, tracking_tolerance=1e-8))
    assert got.confirmed
    assert got.energy_integral[-1] == pytest.approx(published, rel=2e-4)
    # The backward sum on the grid and Simpson's rule along the spline are two roads to one integral.
    assert got.energy_integral_spline == pytest.approx(got.energy_integral[-1], rel=1e-2)


def test_a_promised_limit_that_is_exceeded_is_said(task: PositionTask, knots: Array) -> None:
    asked = traced(task, knots, at_rest=True)
    free = evaluate(asked, solution(knots))
    assert free.limit_excess == {}
    peak, torque = np.abs(free.qd).max(axis=0), np.abs(free.tau).max(axis=0)
    limits = replace(
        Limits.none(3), velocity=peak / 1.1, torque=2 * torque, upper=knots.max(axis=0), lower=knots.min(axis=0)
    )
    promising = replace(solution(knots), limits_kept=("velocity",))
    got = evaluate(replace(asked, limits=limits), promising)
    assert got.limit_excess["velocity"] == pytest.approx(0.1)
    assert got.limit_excess["torque"] == pytest.approx(-0.5)
    assert got.limit_excess["position"] == pytest.approx(0.0, abs=1e-12)
    assert got.limit_excess_between["position"] > 0.0
    assert (got.status, got.message) == (Status.UNCONFIRMED, "a velocity limit is exceeded by 10 %")
    assert evaluate(replace(asked, limits=limits), solution(knots)).status is Status.SOLVED
