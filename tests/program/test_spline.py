"""The program whose solution is a C2 spline: its derivatives, what its unknowns mean, its optima and its limits."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from pydrake.autodiffutils import ExtractGradient, InitializeAutoDiff
from scipy.interpolate import CubicSpline
from scipy.spatial.transform import Rotation

from pipeline.common.arrays import Array
from pipeline.model.kinematics import project
from pipeline.model.task import PoseTask
from pipeline.path.orientation import Orientation
from pipeline.path.spline import Spline as Bent
from pipeline.problem.limits import Limits
from pipeline.problem.objective import Objective
from pipeline.problem.problem import Boundary, Problem
from pipeline.program.scaling import POSITION_SCALE
from pipeline.program.spline.curve import Curve, objective
from pipeline.program.spline.program import Spline, why_not
from pipeline.program.spline.transcription import transcribe
from tests.program.test_program import program_jacobian, program_value
from tests.support import free_line, robot

Make = Callable[[int, int], Problem]
Guess = Callable[[Problem], Array]

BOUNDS: dict[str, Any] = {"acceleration": np.full(3, 2.0), "jerk": np.array([5.0, 6.0, np.inf])}
LIMITS = replace(
    Limits(-2 * np.ones(3), 2 * np.ones(3), np.full(3, 3.8), np.full(3, 0.4), np.array([0.7, 0.7, np.inf])), **BOUNDS
)
BOTH = (True, True)
KINDS: dict[str, dict[str, Any]] = {
    "kinetic energy, rest": {"rest": BOTH},
    "kinetic energy, free ends": {"boundary": Boundary.FREE},
    "torque, rest at the start": {"objective": Objective({"torque": 1.0}), "rest": (True, False)},
    "both, limits": {
        "objective": Objective({"kinetic_energy": 1.0, "torque": 0.3}),
        "limits": LIMITS,
        "rest": BOTH,
        "zero_acceleration": True,
    },
    "kinetic energy, free law": {"rest": BOTH, "free_law": True},
    "kinetic energy, tube": {"rest": BOTH, "tube": 1e-3},
    "kinetic energy, tube, free law": {"rest": BOTH, "free_law": True, "tube": 1e-3},
    "kinetic energy, free law, pace of the tool": {
        "rest": BOTH,
        "free_law": True,
        "limits": replace(Limits.none(3), tool_speed=0.07, tool_acceleration=0.03),
    },
    "velocity norm, cyclic": {"objective": Objective({"velocity_norm": 1.0}), "boundary": Boundary.CYCLIC},
}


@pytest.fixture
def make(problem: Make, guess: Guess) -> Callable[..., Spline]:
    """Trajectory 3 with 12 intervals (bindings of 10 and 2 knots) or another number of them, one of KINDS."""

    def build(kind: str, intervals: int = 12, stretch: float = 0.0) -> Spline:
        more = dict(KINDS[kind])
        tolerance, asked = more.pop("tube", None), problem(3, intervals)
        if tolerance:
            asked = replace(asked, reference=replace(asked.reference, exact=False, tolerance=tolerance))
        asked = replace(asked, **more)
        return transcribe(asked, Curve.through(asked, asked.times, guess(asked)), stretch=stretch)

    return build


def assert_derivatives(made: Spline, rng: np.random.Generator) -> None:
    x = made.drake.initial_guess() * (1 + 0.1 * rng.normal(size=made.drake.num_vars()))
    x += 1e-4 * rng.normal(size=len(x))  # where unknowns start at zero, derivatives of squares are zero too
    if made.law is not None:  # a path has no derivatives at its ends
        own = made.drake.FindDecisionVariableIndices(made.law.s.ravel())
        x[own] = np.clip(x[own], 0.01 * POSITION_SCALE, 0.99 * POSITION_SCALE)
    got, h = program_jacobian(made, x), 1e-6
    for way in rng.normal(size=(4, len(x))) * (np.abs(x) + 1e-3):
        expected = (program_value(made, x + h * way) - program_value(made, x - h * way)) / (2 * h)
        scale = np.abs(got) @ np.abs(way) + 1e-12
        assert np.abs((got @ way - expected) / scale).max() < 1e-6
    for binding in made.drake.generic_constraints():
        evaluator = binding.evaluator()
        y = evaluator.Eval(InitializeAutoDiff(rng.normal(size=evaluator.num_vars())).ravel())
        pattern = evaluator.gradient_sparsity_pattern()
        if pattern is not None:
            assert {tuple(entry) for entry in np.argwhere(ExtractGradient(y)).tolist()} <= set(pattern)


@pytest.mark.parametrize("kind", KINDS)
def test_derivatives_of_the_whole_program_equal_central_differences(
    make: Callable[..., Spline], rng: np.random.Generator, kind: str
) -> None:
    assert_derivatives(make(kind, 6), rng)


@pytest.mark.parametrize("kind", ["both, limits", "kinetic energy, free law, pace of the tool"])
def test_derivatives_where_the_motion_time_is_an_unknown(
    make: Callable[..., Spline], rng: np.random.Generator, kind: str
) -> None:
    assert_derivatives(make(kind, 5, stretch=1.3), rng)


def test_derivatives_of_a_curved_path_whose_law_is_free(problem: Make, guess: Guess, rng: np.random.Generator) -> None:
    """One whose curvature changes: across it the tool accelerates by its speed."""
    asked = replace(problem(3, 5), **KINDS["kinetic energy, free law, pace of the tool"])
    start = asked.reference.geometry.sample(np.zeros(1))[0][0]
    bent = Bent(start + np.array([[0.0, 0.0], [0.1, 0.05], [0.15, 0.2], [0.05, 0.3]]))
    asked = replace(asked, reference=replace(asked.reference, geometry=bent))
    assert_derivatives(transcribe(asked, Curve.through(asked, asked.times, guess(problem(3, 5)))), rng)


def test_derivatives_for_a_pose_under_gravity(rng: np.random.Generator) -> None:
    """With an end that need not rest: the row that keeps the tool still there turns with it."""
    arm = robot("panda", gravity=(0.0, 0.0, -9.8))
    task, q = PoseTask(arm), np.array([0.1, -0.7, 0.2, -2.2, 0.1, 1.5, 0.7])
    asked = replace(free_line(4), task=task, q_init=q, objective=Objective({"torque": 1.0}), rest=(True, False))
    pose = task.value(q[None])[0]
    geometry = replace(asked.reference.geometry, start=pose[:3], direction=np.array([0.0, 1.0, 0.0]))
    turning = Orientation(np.array([0.0, 0.4]), Rotation.from_rotvec([pose[3:], pose[3:] + 0.1]))
    asked = replace(asked, reference=replace(asked.reference, geometry=geometry, orientation=turning))
    motion = q + 0.02 * np.arange(5)[:, None] * np.ones(7)
    assert_derivatives(transcribe(asked, Curve.through(asked, asked.times, motion)), rng)


@pytest.mark.parametrize("kind", KINDS)
def test_every_unknown_starts_at_the_guess(make: Callable[..., Spline], kind: str) -> None:
    """Every row that ties unknowns to each other holds there, and the objective is 1."""
    made = make(kind)
    x, program = made.drake.initial_guess(), made.drake
    for binding in program.linear_equality_constraints():
        if "cyclic" not in kind and "law" not in kind:
            np.testing.assert_allclose(program.EvalBinding(binding, x), 0.0, atol=1e-9)
    np.testing.assert_allclose(x[: made.y.size].reshape(13, 3) / POSITION_SCALE, made.guess.q, rtol=1e-12)
    assert program_value(made, x)[0] == pytest.approx(1.0, rel=1e-9)


BEST = np.array([-0.389, 0.520, 0.190])  # near where the optimum of simulation 1 starts


def weighted(problem: Problem) -> Array:
    """The inertia-weighted pseudoinverse motion (N + 1, 3) of simulation 1 from there."""
    targets = problem.reference.position(problem.times)
    rows = [project(problem.task, BEST[None], targets[:1])[0]]
    for point in targets[1:]:
        inverse = np.linalg.inv(problem.task.arm.mass_matrix(rows[-1]))
        rows.append(project(problem.task, rows[-1], point[None], inverse)[0])
    return np.concatenate(rows)


# --- optima ---------------------------------------------------------------------------------------------------------


def fine_energy(problem: Problem, curve: Curve) -> float:
    """The integral of the kinetic energy by Gauss's rule, six points an interval."""
    node, weight = np.polynomial.legendre.leggauss(6)
    h = np.diff(curve.times)[:, None]
    moments = (curve.times[:-1, None] + h * (node + 1) / 2).ravel()
    energy = problem.task.arm.kinetic_energy(curve(moments), curve(moments, 1))
    return float(energy @ (h * weight / 2).ravel())


@pytest.fixture
def from_rest(problem: Make, guess: Guess) -> tuple[Problem, Curve]:
    """Trajectory 3 at rest with accelerations of at most 1 rad/s^2, on 25 intervals, and its optimum."""
    asked = replace(problem(3, 25), rest=BOTH, limits=replace(Limits.none(3), acceleration=np.ones(3)))
    return asked, transcribe(asked, Curve.through(asked, asked.times, guess(asked))).solve().curve


def test_trajectory_3_from_rest(from_rest: tuple[Problem, Curve]) -> None:
    """An independent implementation (CasADi) found .006075 on 25 intervals, and .006073 from 100 on."""
    asked, curve = from_rest
    assert fine_energy(asked, curve) == pytest.approx(0.006075, abs=1e-6)
    assert objective(asked, curve) == pytest.approx(fine_energy(asked, curve), rel=1e-3)
    assert np.abs(curve.a).max() == pytest.approx(1.0, abs=1e-7)
    np.testing.assert_allclose(curve.ends, 0.0, atol=1e-12)


def test_the_solution_is_the_spline_through_its_knots(from_rest: tuple[Problem, Curve]) -> None:
    """Velocities and accelerations among the unknowns are those of SciPy's clamped spline, which is exported."""
    asked, curve = from_rest
    spline = CubicSpline(asked.times, curve.q, bc_type="clamped")
    np.testing.assert_allclose(curve.v, spline(asked.times, 1), atol=1e-8)
    np.testing.assert_allclose(curve.a, spline(asked.times, 2), atol=1e-6)
    error = asked.task.error(curve.q, asked.reference.position(asked.times))
    assert np.abs(error).max() < 1e-8


@pytest.mark.parametrize("rest", [BOTH, (False, False), (True, False)])
def test_a_free_start_costs_what_the_calculus_of_variations_says(rest: tuple[bool, bool]) -> None:
    """Rest is its natural condition: .0527173 J s in continuous time, whether it is asked for or not."""
    asked = replace(free_line(25), rest=rest)
    solved = transcribe(asked, Curve.through(asked, asked.times, weighted(asked))).solve()
    assert solved.outcome.converged
    assert fine_energy(asked, solved.curve) == pytest.approx(0.0527173, rel=1e-3)
    assert np.abs(solved.curve.ends).max() < 1e-3


def test_limits_of_jerk_and_no_acceleration_at_the_ends(problem: Make, guess: Guess) -> None:
    """.00611 with jerks of at most 2 rad/s^3 (CasADi); two path rows are left out, and the path is kept there."""
    bounds = replace(Limits.none(3), acceleration=np.ones(3), jerk=np.full(3, 2.0))
    asked = replace(problem(3, 25), rest=BOTH, zero_acceleration=True, limits=bounds)
    curve = transcribe(asked, Curve.through(asked, asked.times, guess(asked))).solve().curve
    assert fine_energy(asked, curve) == pytest.approx(0.00611, abs=1e-5)
    np.testing.assert_allclose(curve.a[[0, -1]], 0.0, atol=1e-12)
    assert (np.abs(np.diff(curve.a, axis=0)) / 0.4).max() <= 2.0 + 1e-7
    error = asked.task.error(curve.q, asked.reference.position(asked.times))
    assert np.abs(error).max() < 1e-4


def test_a_cycle_closes_smoothly(problem: Make, guess: Guess) -> None:
    asked = replace(problem(2, 24), boundary=Boundary.CYCLIC)
    curve = transcribe(asked, Curve.through(asked, asked.times, guess(asked))).solve().curve
    for values in (curve.q, curve.v, curve.a):
        np.testing.assert_allclose(values[-1], values[0], atol=1e-7)
    assert np.abs(curve.v[0]).max() > 1e-3


def test_a_cycle_that_rests(problem: Make, guess: Guess) -> None:
    """Its path and the rest say all that can be said of its ends: continuous accelerations are not asked for too."""
    asked = replace(problem(2, 24), boundary=Boundary.CYCLIC, rest=BOTH)
    start = Curve.through(asked, asked.times, guess(asked))
    for still in (False, True):
        solved = transcribe(replace(asked, zero_acceleration=still), start).solve()
        assert solved.outcome.converged
        np.testing.assert_allclose(solved.curve.q[-1], solved.curve.q[0], atol=1e-7)
        np.testing.assert_allclose(solved.curve.v[[0, -1]], 0.0, atol=1e-9)
        assert (np.abs(solved.curve.a[[0, -1]]).max() < 1e-9) == still
        assert max(solved.residuals()) < 1e-6


def test_the_layer_at_a_start_from_rest_is_summed_up_right(problem: Make, guess: Guess) -> None:
    """.0060732 J s within 1 rad/s^2 (CasADi, 400 intervals); on uneven knots the midpoint rule alone errs by ten times
    as much as is allowed here.
    """
    asked = replace(problem(3, 25), rest=BOTH, limits=replace(Limits.none(3), acceleration=np.ones(3)))
    early = np.array([0.1, 0.2, 0.3])
    asked = replace(asked, times=np.union1d(asked.times, early))
    q = CubicSpline(np.linspace(0.0, 10.0, 26), guess(problem(3, 25)))(asked.times)
    curve = transcribe(asked, Curve.through(asked, asked.times, q)).solve().curve
    assert fine_energy(asked, curve) == pytest.approx(0.0060732, abs=1e-6)


def test_what_it_does_not_serve(problem: Make) -> None:
    asked = problem(3, 6)
    assert why_not(asked) is None
    assert why_not(replace(asked, bounds_of_integrals={"torque": 1.0})) == "integrals are bounded"
    assert why_not(replace(asked, qd_init=np.zeros(3))) == "the first velocity is given"
