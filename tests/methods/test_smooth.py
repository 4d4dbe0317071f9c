"""The planner's splines: rest and limits that hold between the knots, and what is said where none can hold."""

from __future__ import annotations

import re
from dataclasses import replace

import numpy as np
import pytest

from pipeline.build.problem import prepare
from pipeline.common.errors import InputError
from pipeline.config.methods import GlobalOptions
from pipeline.evaluation.evaluation import evaluate
from pipeline.methods.global_planner.planner import global_planner
from pipeline.methods.global_planner.smooth import resolved, room
from pipeline.methods.pareto import pareto
from pipeline.problem.limits import Limits
from pipeline.problem.objective import Objective
from pipeline.problem.problem import Boundary, Problem
from pipeline.problem.solution import Status
from pipeline.program.spline.curve import Curve
from tests.support import composed, free_line

FEW = GlobalOptions(starts="population", configurations=12, candidates=60, optimised=3)


@pytest.mark.slow
def test_rest_asks_for_a_spline_and_differences_refuse_it() -> None:
    problem = replace(free_line(12), rest=(True, True))
    (best, *_) = global_planner(problem, FEW)
    assert best.status is Status.SOLVED
    np.testing.assert_allclose(best.trajectory.ends, 0.0, atol=1e-9)
    assert re.match(r"\d distinct opti.* starts; .* confirmed by IPOPT: constraints to \de-\d+, optim", best.evidence)
    with pytest.raises(InputError, match=r"^global: method.global.transcription = differences keeps neither"):
        global_planner(problem, replace(FEW, transcription="differences"))
    with pytest.raises(InputError, match=r"integrals are bounded, and a spline, which alone keeps boundary\.rest"):
        global_planner(replace(problem, bounds_of_integrals={"torque": 1.0}), FEW)
    with pytest.raises(InputError, match=r"^pareto: the joints are to rest at an end"):
        pareto(problem)
    assert global_planner(replace(problem, rest=(False, False)), FEW)[0].trajectory.ends is None


def test_a_start_that_the_grid_does_not_show_gets_knots() -> None:
    """What jumps to 0.6 rad/s takes 0.06 s to it at 10 rad/s^2: 0.1 s is too long a step for it, 0.02 s not."""
    problem = replace(free_line(10), boundary=Boundary.FIXED, rest=(True, True))
    problem = replace(problem, limits=replace(Limits.none(3), acceleration=np.full(3, 10.0)))
    motion = problem.q_init + 0.06 * np.arange(11)[:, None] * np.array([0.1, 1.0, 0.2])
    knots = resolved(problem, motion)
    np.testing.assert_allclose(knots[:7], [0.0, 0.03, 0.06, 0.09, 0.12, 0.18, 0.3], atol=1e-12)
    np.testing.assert_allclose(knots[6:], problem.times[3:], atol=1e-12)
    fine, free = replace(problem, times=np.linspace(0.0, 1.0, 51)), replace(problem, boundary=Boundary.FREE)
    assert len(resolved(fine, np.repeat(motion, 5, axis=0)[:51])) == 51
    assert len(resolved(free, motion)) == 11
    by_jerk = replace(problem, limits=replace(problem.bounds, jerk=np.full(3, 960.0)))
    np.testing.assert_allclose(resolved(by_jerk, motion)[1], 0.03, atol=1e-12)
    by_jerk = replace(problem, limits=replace(problem.bounds, jerk=np.full(3, 240.0)))
    np.testing.assert_allclose(resolved(by_jerk, motion)[1], 0.05, atol=1e-12)


@pytest.mark.slow
def test_a_spline_is_judged_as_the_curve_that_it_is() -> None:
    """Its velocities, accelerations and integrals are the curve's: recomputed here by SciPy and the stacked arm."""
    problem = replace(free_line(20), rest=(True, True))
    motion = evaluate(problem, global_planner(problem, FEW)[0])
    assert motion.status is Status.SOLVED
    curve = Curve.through(problem, motion.time, motion.q)
    np.testing.assert_allclose(motion.qd, curve.v, atol=1e-9)
    np.testing.assert_allclose(motion.qdd, curve.a, atol=1e-6)
    fine = np.linspace(0.0, 1.0, 4001)
    q, qd, qdd = curve(fine), curve(fine, 1), curve(fine, 2)
    arm = problem.task.arm
    energy = np.trapezoid(arm.kinetic_energy(q, qd), fine)
    torque = np.trapezoid((arm.inverse_dynamics(q, qd, qdd) ** 2).sum(axis=1), fine)
    assert motion.integral("kinetic_energy") == pytest.approx(energy, rel=1e-4)
    assert motion.integral("torque") == pytest.approx(torque, rel=1e-4)
    assert motion.objective == pytest.approx(energy, rel=1e-4)


def limited() -> Problem:
    """No motion at rest follows simulation 1's line in 1 s with torques of at most 0.15 N m."""
    problem = free_line(12)
    reference = replace(problem.reference, tolerance=0.01)  # twelve intervals are few
    limits = replace(Limits.none(3), torque=np.full(3, 0.15))
    return replace(problem, reference=reference, rest=(True, True), limits=limits)


def test_the_room_that_a_motion_needs(rng: np.random.Generator) -> None:
    """Stretched by so much it keeps its limits, and by less it does not."""
    problem = limited()
    q = problem.q_init + np.cumsum(0.1 * rng.normal(size=(13, 3)), axis=0)
    curve = Curve.through(problem, problem.times, q)
    need = room(problem, curve)
    fine = np.linspace(0.0, 1.0, 121)
    tau = problem.task.arm.inverse_dynamics(curve(fine), curve(fine, 1) / need, curve(fine, 2) / need**2)
    assert np.abs(tau).max() == pytest.approx(0.15, rel=1e-9)


@pytest.mark.slow
def test_a_time_that_is_too_short_is_answered_with_the_shortest() -> None:
    """In that time, a little more, there is a motion; its limits are kept between the knots too."""
    problem = limited()
    (answer,) = global_planner(problem, FEW)
    assert answer.status is Status.INFEASIBLE
    assert "the torque limit of joint1 (0.15 N m) cannot be met between the knots" in answer.message
    shortest = float(answer.message.split("shortest feasible duration ")[1].split()[0])
    slower = replace(problem.reference, timing=replace(problem.reference.timing, duration=1.02 * shortest))
    there = replace(problem, reference=slower, times=np.linspace(0.0, 1.02 * shortest, 13))
    motion = evaluate(there, global_planner(there, FEW)[0])
    assert motion.status is Status.SOLVED
    assert max(motion.limit_excess_between.values()) <= 1e-6


@pytest.mark.slow
def test_simulation_3_and_4_from_rest_to_rest() -> None:
    """Simulation 3 costs .1090 then, and 4 has no motion within its limits below 1.005 s (CasADi; `sending`)."""
    rest = ("boundary.rest=[start,end]", "timing.steps=40", "method.global.solver=newton")
    third = prepare(composed("+experiment=sim3", *rest))
    best = evaluate(third, global_planner(third, replace(FEW, optimised=1))[0])
    assert best.integral("torque") == pytest.approx(0.1090, rel=5e-3)
    fourth = prepare(composed("+experiment=sim4", *rest))
    (answer,) = global_planner(fourth, replace(FEW, optimised=1))
    shortest = float(answer.message.split("shortest feasible duration ")[1].split()[0])
    assert shortest == pytest.approx(1.005, rel=3e-3)
    assert "cannot be met" in answer.message


def test_an_objective_without_velocities_and_with_torques(rng: np.random.Generator) -> None:
    problem = replace(free_line(12), rest=(True, True), objective=Objective({"torque": 1.0}))
    best = global_planner(problem, FEW)[0]
    assert best.status is Status.SOLVED
    assert best.statistics["cost"] == pytest.approx(evaluate(problem, best).integral("torque"), rel=6e-2)
