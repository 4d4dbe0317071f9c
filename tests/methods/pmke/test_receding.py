from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from pipeline.build.problem import prepare
from pipeline.common.errors import InputError
from pipeline.config.methods import PmkeOptions, RecedingOptions
from pipeline.evaluation.evaluation import evaluate
from pipeline.methods.global_planner.planner import global_planner
from pipeline.methods.pmke.predictive import pmke
from pipeline.methods.pmke.receding import _knots, at_rest, follow, receding
from pipeline.problem.costs import integrals
from pipeline.problem.curve import curve
from pipeline.problem.objective import Objective
from pipeline.problem.problem import Problem
from pipeline.problem.solution import Solution, Status, Trajectory
from tests.support import FEW, composed

WINDOW = RecedingOptions(prediction_step=0.2, horizon=5, update_interval=0.6)


def trajectory3(*overrides: str) -> Problem:
    return prepare(composed("path=line", "timing.steps=50", *overrides))


@pytest.mark.slow
def test_limits_hold_at_every_executed_knot_and_the_cost_is_near_the_optimum() -> None:
    asked = trajectory3("limits.velocity=0.32", "limits=joint")
    done = receding(asked, WINDOW)[0]
    judged = evaluate(asked, done)
    assert judged.status is Status.SOLVED, judged.message
    assert max(judged.limit_excess.values()) <= 1e-6
    assert judged.limit_excess["velocity"] > -0.2, "the limit is not felt: the test shows nothing"
    assert judged.tracking_error.max() < 1e-7
    best = evaluate(asked, global_planner(asked, FEW)[0])
    assert judged.objective < 1.1 * best.objective
    log = done.statistics["predictions"]
    assert [round(entry["time"], 6) for entry in log] == pytest.approx(np.arange(0, 10, 0.6).tolist())
    assert all(entry["converged"] and entry["wall_time_s"] > 0 for entry in log)
    assert {entry["status"] for entry in log} == {"newton"}
    apart = [entry["apart_from_ipopt"] for entry in log if entry["apart_from_ipopt"] is not None]
    assert len(apart) == 10
    assert max(apart) < 1e-4, "IPOPT moves the windows"
    assert done.statistics["update_interval"] == pytest.approx(0.6)


def test_a_window_knows_the_velocity_it_comes_with() -> None:
    """Squared torques over a window change when the arm arrives at speed; the first acceleration starts from there."""
    asked = trajectory3("objective=torque")
    q = np.tile(asked.q_init, (4, 1)) + np.linspace(0, 0.3, 4)[:, None]
    times, speed = np.linspace(0.0, 0.6, 4), np.array([0.4, -0.2, 0.1])
    moving = replace(asked, times=times, qd_init=speed)
    step = np.diff(q, axis=0) / 0.2
    qdd = np.diff(np.vstack([speed, step]), axis=0) / 0.2
    tau = asked.task.arm.inverse_dynamics(q[1:], step, qdd)
    assert integrals(moving, times, q).integrals["torque"] == pytest.approx(0.2 * (tau**2).sum(), rel=1e-12)


@pytest.mark.slow
def test_torque_as_the_objective_of_the_predictions_costs_less_torque() -> None:
    asked = trajectory3()
    options = PmkeOptions(prediction_step=0.5, update_interval=0.5, horizon=4, objective="torque")
    interpolated = evaluate(asked, pmke(asked, options)[0])
    assert interpolated.status is Status.SOLVED
    by_energy = evaluate(asked, receding(asked, WINDOW)[0])
    by_torque = evaluate(asked, receding(asked, replace(WINDOW, objective="torque"))[0])
    best = evaluate(asked, global_planner(replace(asked, objective=Objective({"torque": 1.0})), FEW)[0])
    assert by_torque.status is by_energy.status is Status.SOLVED
    assert best.torque_integral[-1] * 0.9 < by_torque.torque_integral[-1] < 0.8 * by_energy.torque_integral[-1]
    assert by_torque.energy_integral[-1] > by_energy.energy_integral[-1]


@pytest.mark.slow
def test_what_cannot_be_met_is_said() -> None:
    asked = trajectory3("limits.velocity=0.05", "timing.steps=25")
    done = receding(asked, WINDOW)[0]
    assert not done.found
    assert done.status is Status.INFEASIBLE
    assert "the velocity limit of joint" in done.message
    assert evaluate(asked, done).status is Status.INFEASIBLE


def test_the_knots_reach_to_the_end_of_the_path() -> None:
    times = np.linspace(0.0, 1.0, 11)
    np.testing.assert_allclose(_knots(times, 2, 4, 3), [0.2, 0.3, 0.4, 0.6, 0.8, 1.0])
    np.testing.assert_allclose(_knots(times, 8, 10, 3), [0.8, 0.9, 1.0])
    np.testing.assert_allclose(_knots(times, 2, 4, 0), [0.2, 0.3, 0.4])
    np.testing.assert_allclose(_knots(times, 6, 8, 5), [0.6, 0.7, 0.8, 0.9, 1.0])


@pytest.mark.slow
def test_torques_at_their_limit_and_windows_cut_off() -> None:
    """One program an update: what it does not solve is followed on the plan before, and no knot is beyond a limit."""
    asked = trajectory3("limits=joint_torque_power", "limits.torque=0.012", "limits.power=null")
    done = receding(asked, replace(WINDOW, real_time_iterations=3))[0]
    judged = evaluate(asked, done)
    assert judged.limit_excess["torque"] > -0.3, "the limit is not felt: the test shows nothing"
    assert max(judged.limit_excess.values()) <= 1e-6
    assert all(entry["iterations"] == 3 for entry in done.statistics["predictions"] if entry["status"] == "newton")


@pytest.mark.slow
def test_jerks_are_limited_from_rest_to_rest() -> None:
    """Standing before the start and after the end too: differences of the executed knots alone say so."""
    ends = ("boundary.rest=[start,end]", "limits.acceleration=1")
    free = trajectory3(*ends)
    asked = trajectory3(*ends, "boundary.zero_acceleration=true", "limits.jerk=2")
    most, energy = [], []
    for problem in (free, asked):
        done = follow(problem, WINDOW)
        judged = evaluate(problem, done)
        assert judged.status is Status.SOLVED, judged.message
        assert {entry["status"] for entry in done.statistics["predictions"]} == {"newton"}
        q = done.trajectory.q
        standing = np.vstack([q[:1], q[:1], q[:1], q, q[-1:], q[-1:], q[-1:]])
        most.append([float(np.abs(np.diff(standing, order, axis=0) / 0.2**order).max()) for order in (2, 3)])
        energy.append(judged.objective)
    assert most[0][0] <= 1 + 1e-6
    assert most[0][1] > 4, "the limit would not be felt: the test shows nothing"
    assert most[1][1] == pytest.approx(2, rel=1e-6)
    assert judged.limit_excess["jerk"] == pytest.approx(0, abs=1e-6)
    assert energy[0] < energy[1] < 1.01 * energy[0]


@pytest.mark.slow
def test_the_curve_keeps_limits_between_its_knots() -> None:
    """Its spline would exceed what its knots' differences keep."""
    asked = trajectory3("boundary.rest=[start,end]", "limits.acceleration=1", "boundary.zero_acceleration=true")
    asked = replace(asked, limits=replace(asked.bounds, jerk=np.full(3, 2.0)))
    done = receding(asked, WINDOW)[0]
    judged = evaluate(asked, done)
    spline = curve(asked, done.trajectory.time, done.trajectory.q)
    assert 1.8 < float(np.abs(spline(done.trajectory.time, 3)).max()) <= 2 * (1 + 1e-6)
    assert judged.status is Status.SOLVED, judged.message
    assert judged.limit_excess_between["jerk"] <= 1e-6


def test_from_rest_it_is_a_spline_that_can_be_sent() -> None:
    """Not within a limit of jerk: it accelerates from its first moment on."""
    rests, one = trajectory3("boundary.rest=[start,end]", "limits.acceleration=1"), trajectory3()
    done = Solution("receding", Trajectory(rests.times, np.tile(rests.q_init, (51, 1))), Status.SOLVED)
    jerks = replace(rests, limits=replace(rests.bounds, jerk=np.full(3, 2.0)))
    np.testing.assert_array_equal(at_rest(rests, done).trajectory.ends, np.zeros((2, 3)))
    assert at_rest(jerks, done).trajectory.ends is at_rest(one, done).trajectory.ends is None


def test_what_receding_does_not_serve_is_said() -> None:
    with pytest.raises(InputError, match="receding: limits of acceleration or jerk together with terms beside the kin"):
        receding(trajectory3("limits.acceleration=1", "objective=torque"))
    with pytest.raises(InputError, match="receding: the joints are to rest at an end, but not all accelerations"):
        receding(replace(trajectory3(), rest=(True, False)))
