"""A path that need not be kept exactly: optima in a tube against an independent program, and who uses it."""

from __future__ import annotations

from dataclasses import replace

import casadi as ca
import numpy as np
import pytest
from scipy.interpolate import CubicSpline

from pipeline.build.problem import prepare
from pipeline.common.arrays import Array
from pipeline.common.errors import InputError
from pipeline.config.methods import GlobalOptions, ParetoOptions
from pipeline.evaluation.evaluation import evaluate
from pipeline.methods.global_planner.planner import global_planner
from pipeline.methods.global_planner.smooth import Searches, exactly, refine
from pipeline.methods.lsv import inertia_weighted, lsv
from pipeline.methods.pareto import pareto
from pipeline.methods.tolerance_front import descending
from pipeline.problem.costs import objective_values
from pipeline.problem.problem import Problem
from pipeline.problem.solution import Solution, Status, Trajectory
from pipeline.program.spline.curve import objective
from pipeline.program.spline.tighten import peaks
from pipeline.program.transcription import transcribe
from pipeline.studies.front import Front, draw, table, unit
from tests.benchmarks.peer import QUIET, ROBOT, PlanarArm
from tests.program.test_spline import weighted
from tests.support import composed, free_line, robot

FEW = GlobalOptions(nodes=60, optimised=4, budget=4)
TOLERANCE = 0.01


def line(intervals: int = 16, **more: object) -> Problem:
    """Simulation 1's line, from rest to rest, within a tube of 10 mm."""
    problem = free_line(intervals)
    reference = replace(problem.reference, exact=False, tolerance=TOLERANCE)
    return replace(problem, reference=reference, rest=(True, True), **more)  # type: ignore[arg-type]


def peers(problem: Problem, guess: Array) -> float:
    """The least energy by backward differences in the tube, by CasADi: its own dynamics, exact Hessians, and the tube
    as |x - x_ref|^2 <= e^2, positions alone for unknowns.
    """
    arm, n, count = PlanarArm.from_urdf(ROBOT), 3, len(problem.times)
    state, rate = ca.SX.sym("q", n), ca.SX.sym("qd", n)
    energy = ca.Function("T", [state, rate], [arm.kinetic_energy(state, rate)])
    tip = ca.Function("x", [state], [arm.end_effector(state)])
    q, path, dt = ca.MX.sym("q", n, count), problem.reference.position(problem.times).T, float(problem.times[1])
    cost = ca.sum2(energy.map(count - 1)(q[:, 1:], (q[:, 1:] - q[:, :-1]) / dt)) * dt
    off = ca.sum1((tip.map(count)(q) - path) ** 2).T / TOLERANCE**2
    solver = ca.nlpsol("tube", "ipopt", {"x": ca.vec(q), "f": cost, "g": off}, {**QUIET, "ipopt.tol": 1e-10})
    return float(solver(x0=guess.ravel(), lbg=0.0, ubg=1.0)["f"])


def test_the_optimum_in_a_tube_is_another_codes() -> None:
    asked = replace(line(), rest=(False, False))
    guess = weighted(free_line(16))
    q, outcome, _ = transcribe(asked, asked.times, guess).solve(tolerance=1e-9)
    assert outcome.converged
    found = float(objective_values(asked, asked.times, q[None])[0])
    assert found == pytest.approx(peers(asked, guess), rel=1e-5)
    off = np.linalg.norm(asked.task.error(q, asked.reference.position(asked.times)), axis=1)
    assert off.max() <= TOLERANCE
    assert off.max() == pytest.approx(TOLERANCE, rel=1e-5)


@pytest.mark.slow
def test_a_spline_stays_in_the_tube_between_its_knots() -> None:
    """It costs less than on the path, and is judged by the tube: a narrower one refuses it."""
    asked, guess = line(), weighted(free_line(16))
    found = refine((asked, FEW), guess)
    exact = refine((replace(asked, reference=replace(asked.reference, exact=True)), FEW), guess)
    assert found.converged
    assert found.cost < 0.97 * exact.cost
    motion = Solution("global", Trajectory(asked.times, found.curve.q, found.curve.ends), Status.SOLVED)
    judged = evaluate(asked, motion)
    assert (judged.status, judged.on_path) == (Status.SOLVED, True)
    assert judged.tracking_error_between == pytest.approx(TOLERANCE, rel=1e-2)
    narrow = evaluate(replace(asked, reference=asked.reference.within(0.9)), motion)
    assert (narrow.status, narrow.on_path) == (Status.UNCONFIRMED, False)
    assert "outside the tube of path.tolerance = 0.009 m" in narrow.message


@pytest.mark.slow
def test_differences_in_a_tube() -> None:
    asked = replace(line(12), rest=(False, False))
    (best, *_) = global_planner(asked, replace(FEW, transcription="differences"))
    judged = evaluate(asked, best)
    assert judged.status is Status.SOLVED, judged.message
    assert 0.9 * TOLERANCE < judged.tracking_error_between <= TOLERANCE
    assert best.trajectory.ends is None


@pytest.mark.slow
def test_what_a_tolerance_buys() -> None:
    few = GlobalOptions(nodes=40, optimised=1, budget=1)
    asked, options = line(8), ParetoOptions(objectives=("path_tolerance", "kinetic_energy"), steps=2, planner=few)
    motions = [evaluate(asked, one) for one in pareto(asked, options)]
    assert [motion.status for motion in motions] == [Status.SOLVED] * 3
    front = Front(table(motions))
    assert list(front.table["bound"]) == [np.inf, pytest.approx(TOLERANCE / 100), TOLERANCE]
    tolerances, energies = (front.table[name].to_numpy() for name in front.objectives)
    assert tolerances[0] < 0.5 * tolerances[1]  # on its path at its knots, of which there are few
    assert np.all(tolerances[1:] <= np.array([TOLERANCE / 100, TOLERANCE]))
    assert tolerances[1:] == pytest.approx([TOLERANCE / 100, TOLERANCE], rel=0.05)
    assert unit("path_tolerance") == "m"
    assert np.all(np.diff(energies) < 0)
    assert draw(front, "a front").axes[0].get_xlabel() == "largest distance from the path [m]"


def test_orientations_have_a_tolerance_of_their_own(rng: np.random.Generator) -> None:
    """A pose's departures: three in a ball of [m], three in one of [rad]."""
    arm = robot("panda")
    asked = prepare(composed("+experiment=panda_pose", "timing.steps=4", "path.exact=false", "path.tolerance=1e-3"))
    assert asked.task.arm.n == arm.n
    made = transcribe(asked, asked.times, np.tile(asked.q_init, (5, 1)) + 0.01 * rng.normal(size=(5, 7)))
    assert made["off"].shape == (5, 6)
    balls = [b.evaluator() for b in made.drake.quadratic_constraints()]
    assert len(balls) == 8
    x = made.drake.initial_guess()
    values = np.array([made.drake.EvalBinding(b, x)[0] for b in made.drake.quadratic_constraints()])
    error = asked.task.error(made.guess.q, asked.reference.position(asked.times))[1:]
    share = np.array([np.linalg.norm(error[:, :3], axis=1) / 1e-3, np.linalg.norm(error[:, 3:], axis=1) / 1e-3])
    np.testing.assert_allclose(np.sort(values), np.sort((share**2).ravel()), rtol=1e-5)


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (("path.tolerance=1e-7",), "path.tolerance = 1e-07: with path.exact = false must be at least 1e-06"),
        (("limits.tool_speed=1",), "they are kept by the law of the path"),
    ],
)
def test_what_does_not_go_with_a_tube(words: tuple[str, ...], said: str) -> None:
    with pytest.raises(InputError) as refused:
        prepare(composed("path.exact=false", *words))
    assert said in str(refused.value)


def test_who_uses_a_tube() -> None:
    with pytest.raises(InputError, match=r"^lsv: path.exact = false is used by the method global, and by the front"):
        lsv(line())
    with pytest.raises(InputError, match=r"^pareto: path.exact = false"):
        pareto(replace(line(), rest=(False, False)), ParetoOptions(planner=FEW))
    ways = ParetoOptions(objectives=("path_tolerance", "kinetic_energy"), planner=FEW)
    with pytest.raises(InputError, match=r"^pareto: .*set path.exact=false$"):
        pareto(free_line(4), ways)
    with pytest.raises(InputError, match=r"^pareto: .* have the timing that is given"):
        pareto(line(free_law=True), ways)
    with pytest.raises(InputError, match=r"one of them goes with an integral$"):
        pareto(line(), replace(ways, objectives=("path_tolerance", "duration")))


@pytest.mark.slow
def test_the_prices_of_a_path_say_what_a_small_tolerance_buys() -> None:
    """To first order the cost falls by the price at each knot times the tolerance there."""
    asked = replace(line(), reference=line().reference.within(1e-2))
    on_path = refine((exactly(asked), FEW), weighted(free_line(16)))
    searches = Searches(FEW)
    searches.value(asked, on_path.curve)
    within = searches.lazily(asked, on_path.curve)
    assert within.outcome.converged
    assert searches.prices is not None
    predicted = float(searches.prices.at(asked.times)[:, 0].sum()) * asked.reference.tolerance
    assert 1 - objective(asked, within.curve) / on_path.cost == pytest.approx(predicted, rel=0.01)


@pytest.mark.slow
def test_a_pose_of_seven_joints_in_a_tube() -> None:
    """From rest within the limits of a data sheet: the motion stays in the tube between its knots and costs less."""
    words = ("timing.steps=10", "path.exact=false", "path.tolerance=1e-3", "path.orientation_tolerance=1e-3")
    asked = prepare(composed("+experiment=panda_sendable", *words))
    own = inertia_weighted(replace(exactly(asked), rest=(False, False), zero_acceleration=False))[0].trajectory
    found = refine((asked, FEW), CubicSpline(own.time, own.q)(asked.times))
    assert found.converged, found.status
    moments = np.linspace(0.0, asked.times[-1], 4001)
    error = asked.task.error(found.curve(moments), asked.reference.position(moments))
    for part in (error[:, :3], error[:, 3:]):
        assert np.linalg.norm(part, axis=1).max() == pytest.approx(1e-3, rel=0.01)
        assert np.linalg.norm(part, axis=1).max() <= 1e-3 * (1 + 1e-6)
    assert found.cost < 0.995 * refine((exactly(asked), FEW), found.curve.q).cost


@pytest.mark.slow
def test_no_point_of_a_front_is_dearer_than_one_in_a_narrower_tube() -> None:
    """Of two points that are, one is sought again from the narrower tube's, the other is none."""
    asked = line(8)
    guess = weighted(free_line(8))
    good = refine((asked, FEW), guess)
    on_path = refine((exactly(asked), FEW), guess)
    dear = replace(good, cost=2 * good.cost)
    shares = np.array([0.5, 1.0])
    found = descending((asked, FEW), shares, [refine((asked, FEW), guess), dear], on_path.cost)
    assert [one.converged for one in found] == [True, True]
    assert found[1].cost <= found[0].cost
    (lost,) = descending((asked, FEW), shares[:1], [dear], on_path.cost)
    assert (lost.converged, lost.status) == (False, "dearer than in a narrower tube")


def test_the_peak_between_samples() -> None:
    """Of a parabola it is exact, on uneven samples too; what falls or rises stays as it is."""
    moments = np.array([0.0, 0.2, 0.35, 0.6, 1.0])
    assert peaks(moments, 1 - (moments - 0.3) ** 2).max() == pytest.approx(1.0, abs=1e-12)
    np.testing.assert_array_equal(peaks(moments, moments), moments)
