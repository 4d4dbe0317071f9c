"""The exported motion: a smooth curve at the rate asked for, judged by what it does between knots and samples too."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from pipeline.artifacts.motion_files import save_motion
from pipeline.build.problem import prepare
from pipeline.build.rest import suggested
from pipeline.config.methods import GlobalOptions
from pipeline.config.run import RunConfig
from pipeline.evaluation.evaluation import Evaluation, evaluate
from pipeline.methods.global_planner.planner import global_planner
from pipeline.model.obstacles import Obstacles
from pipeline.path.timing import ConstantSpeed
from pipeline.problem.limits import Limits
from pipeline.problem.problem import Boundary, Problem
from pipeline.problem.solution import Solution, Status, Trajectory
from pipeline.robot.shapes import Shape
from pipeline.studies.export import Nothing, Resampled, instead, resample, sentence, study
from pipeline.studies.study import Motions, Result
from tests.support import ROOT, composed

FEW = GlobalOptions(candidates=60, optimised=2, refine_to=None)
Case = tuple[Problem, Evaluation]


def solved(*words: str) -> Case:
    problem = prepare(composed(*words))
    return problem, evaluate(problem, global_planner(problem, FEW)[0])


@pytest.fixture(scope="module")
def line() -> Case:
    return solved("path.length=0.2", "timing.duration=2", "timing.steps=20")


@pytest.fixture(scope="module")
def at_rest() -> Case:
    """A free start, at which rest is the natural condition: differences begin and end there by themselves."""
    return solved("boundary=free", "path.length=0.2", "timing.duration=2", "timing.steps=40")


@pytest.fixture(scope="module")
def cycle() -> Case:
    return solved("path=circle", "boundary=cyclic", "timing.duration=2", "timing.steps=24")


@pytest.mark.parametrize("rate", [100.0, 30.0, 7.0, 1000.0])
def test_the_rate_and_the_last_sample(line: Case, rate: float) -> None:
    motion = resample(*line, rate)
    assert (motion.time[0], motion.time[-1]) == (0.0, 2.0)
    step = np.diff(motion.time)
    np.testing.assert_allclose(step[:-1], 1 / rate, rtol=1e-9)
    assert 1e-9 < step[-1] <= 1 / rate + 1e-9
    assert len(motion.time) == int(np.ceil(2.0 * rate - 1e-9)) + 1
    assert (motion.method, motion.optimum) == ("global", 1)


def test_the_curve_goes_through_the_knots_from_rest_to_rest(line: Case) -> None:
    motion = resample(*line, 100.0)  # every tenth sample is a knot
    np.testing.assert_allclose(motion.q[::10], line[1].q, atol=1e-12)
    np.testing.assert_allclose(motion.qd[[0, -1]], 0.0, atol=1e-12)


def assert_consistent(motion: Resampled) -> None:
    """Velocities and accelerations are those of the positions, by central differences."""
    for value, rate in ((motion.q, motion.qd), (motion.qd, motion.qdd)):
        by_difference = (value[2:] - value[:-2]) / (motion.time[2:] - motion.time[:-2])[:, None]
        scale = np.abs(rate).max()
        assert np.abs(by_difference - rate[1:-1]).max() < 2e-3 * scale


@pytest.mark.slow
def test_derivatives_are_those_of_the_positions(line: Case, cycle: Case) -> None:
    assert_consistent(resample(*line, 2000.0))
    assert_consistent(resample(*cycle, 2000.0))


def test_a_cyclic_motion_can_be_repeated(cycle: Case) -> None:
    motion = resample(*cycle, 50.0)
    for values in (motion.q, motion.qd, motion.qdd):
        np.testing.assert_allclose(values[-1], values[0], atol=1e-9 * np.abs(values).max())
    assert np.abs(motion.qd[0]).max() > 0.01, "a cycle that starts at rest shows nothing"


def test_a_path_that_is_entered_at_speed_is_not_forced_to_rest(line: Case) -> None:
    problem, motion = line
    moving = replace(problem, reference=replace(problem.reference, timing=ConstantSpeed(2.0)))
    q = motion.q[0] + np.linspace(0.0, 0.4, 21)[:, None] * np.ones(3)
    straight = evaluate(moving, Solution("global", Trajectory(motion.time, q), Status.SOLVED))
    np.testing.assert_allclose(resample(moving, straight, 100.0).qd, 0.2, atol=1e-9)


def limited(case: Case, **bounds: float | list[float]) -> Problem:
    free = Limits.none(3)
    values = {name: np.broadcast_to(bound, 3).astype(float) for name, bound in bounds.items()}
    return replace(case[0], limits=replace(free, **values))


@pytest.mark.parametrize("rate", [500.0, 1.5])
def test_a_limit_that_only_the_curve_exceeds_is_reported(line: Case, rate: float) -> None:
    """The knots keep it; so do the samples of a slow rate."""
    problem, evaluation = line
    fine = resample(problem, evaluation, 500.0)
    row, joint = np.unravel_index(np.argmax(np.abs(fine.qd)), fine.qd.shape)
    peak = float(np.abs(fine.qd)[row, joint])
    asked = limited(line, velocity=peak / 1.01)
    motion = resample(asked, evaluation, rate)
    assert motion.limit_excess["velocity"] == pytest.approx(0.01, abs=2e-3)
    time, name = motion.worst["velocity"]
    assert name == f"joint{joint + 1}"
    assert time == pytest.approx(fine.time[row], abs=0.03)
    assert not motion.keeps_limits
    said = sentence(motion)
    assert f"exceeds the velocity limit of joint{joint + 1} by " in said
    assert f"at t = {time:.3g} s" in said


def test_torques_are_judged_as_the_curve_needs_them(line: Case) -> None:
    problem, evaluation = line
    motion = resample(limited(line, torque=1e-3), evaluation, 1000.0)
    tau = problem.task.arm.inverse_dynamics(motion.q, motion.qd, motion.qdd)
    assert motion.limit_excess["torque"] == pytest.approx(np.abs(tau).max() / 1e-3 - 1, rel=1e-6)


def test_limits_that_are_kept_and_limits_that_are_not_there(at_rest: Case) -> None:
    kept = resample(limited(at_rest, velocity=100.0), at_rest[1], 100.0)
    assert kept.keeps_limits
    assert sentence(kept).endswith("and meets every limit")
    assert sentence(resample(*at_rest, 100.0)).endswith("has no limits to check it against")
    assert resample(*at_rest, 100.0).tracking_error < 1e-4


# --- which motion is sent -------------------------------------------------------------------------------------------


def sent_by(problem: Problem, settings: RunConfig, *motions: Evaluation) -> Result | None:
    return study(Motions(settings, problem, motions))


@pytest.mark.slow
def test_the_best_motion_is_the_cheapest_that_hits_nothing() -> None:
    """A method that promises no clearance goes through the ball: cheaper, and not to be sent."""
    ball = Shape("ball", "sphere", (0.04,), (0.69, 0.49, 0.0))
    words = ("robot=planar4r", "path.length=0.3", "path.direction=170", "timing.duration=2", "timing.steps=24")
    words += ("boundary.rest=[start,end]", "limits.acceleration=20")
    config = composed(*words)
    free = prepare(config)
    there = replace(free, obstacles=Obstacles((ball,), 0.03))
    through = evaluate(there, replace(global_planner(free, FEW)[0], method="lsv", limits_kept=()))
    around = evaluate(there, global_planner(there, FEW)[0])
    assert through.status is around.status is Status.SOLVED
    assert through.objective < around.objective
    sent = sent_by(there, config, through, around)
    assert isinstance(sent, Resampled)
    assert sent.method == "global"
    assert sent.limit_excess["clearance"] <= 0
    for cheaper, best in ((1e-7, 1), (1e-3, 2)):  # what a table does not show is not preferred
        other = replace(
            around, objective=around.objective * (1 - cheaper), solution=replace(around.solution, optimum=2)
        )
        sent = sent_by(there, config, around, other)
        assert isinstance(sent, Resampled)
        assert sent.optimum == best
    nothing = sent_by(there, config, through)
    assert nothing is not None
    assert nothing.section()[0].startswith("Exported: nothing")
    assert [nothing.columns(through), nothing.tables()] == [{}, {}]
    assert list(nothing.facts()["refused"]) == ["lsv 1"]
    named = composed(*words, "export.method=lsv")
    refused = sent_by(there, named, through, around)
    assert isinstance(refused, Nothing)
    assert "lsv 1 exceeds the clearance limit by" in refused.section()[0]
    forced = sent_by(there, composed(*words, "export.method=lsv", "export.force=true"), through, around)
    assert isinstance(forced, Resampled)
    assert "exceeds the clearance limit by" in sentence(forced)
    assert "not to be sent as it is" in sentence(forced)
    assert sent_by(there, composed(*words, "export.method=none"), through, around) is None


# --- what cannot be sent --------------------------------------------------------------------------------------------


def test_a_jump_of_velocity_is_not_sent(line: Case, at_rest: Case) -> None:
    """An optimum by differences from a given start jumps to its speed: the curve at rest would ask for an impulse."""
    motion = resample(*line, 100.0)
    (fault,) = motion.faults
    jump = (line[1].q[1] - line[1].q[0]) / 0.1
    joint = int(np.abs(jump).argmax())
    assert fault.startswith(f"starts with a jump of velocity (joint{joint + 1} at ")
    settings = composed("path.length=0.2", "timing.duration=2", "timing.steps=20")
    nothing = sent_by(line[0], settings, line[1])
    assert isinstance(nothing, Nothing)
    said = nothing.section()[0]
    assert "global 1 starts with a jump of velocity" in said
    number = suggested(line[0])
    assert f"boundary.rest=[start,end] limits.acceleration={number:g} makes the planner seek one that can be." in said
    third = composed("+experiment=sim3", "limits=none", "limits.power=null")
    words = instead(Motions(third, replace(at_rest[0], rest=(False, False)), ()), ())
    assert (
        words
        == "boundary.rest=[start,end] makes the planner seek one that can be, and so does +experiment=sim3_sendable. "
    )
    assert instead(Motions(third, replace(at_rest[0], rest=(True, True)), ()), ()) == ""
    bounded = replace(at_rest[0], rest=(False, False), bounds_of_integrals={"torque": 1.0})
    assert instead(Motions(third, bounded, ()), ()) == "No start from rest is sought where integrals are bounded. "


def test_a_motion_that_ends_while_it_moves_or_off_its_path_is_not_sent(at_rest: Case) -> None:
    problem, motion = at_rest
    assert resample(problem, motion, 100.0).faults == ()
    moving = motion.q + 0.05 * np.linspace(0.0, 1.0, 41)[:, None] ** 3
    faults = resample(
        problem, evaluate(problem, Solution("lsv", Trajectory(motion.time, moving), Status.SOLVED)), 50.0
    ).faults
    assert len(faults) == 2
    assert faults[0].startswith("ends while it moves (joint")
    assert "off its path, more than path.tolerance = 0.0001 m" in faults[1]


def test_a_cycle_is_begun_from_rest_and_comes_back(cycle: Case, at_rest: Case) -> None:
    """The path rests at its ends, the joints of the best cycle do not; and what does not close is none."""
    motion = resample(*cycle, 50.0)
    speed = np.abs(motion.qd[0])
    joint = f"joint{int(speed.argmax()) + 1} at {speed.max():.3g} rad/s"
    assert motion.faults[:2] == (f"starts with a jump of velocity ({joint})", f"ends while it moves ({joint})")
    problem, open_motion = at_rest
    faults = resample(replace(problem, boundary=Boundary.CYCLIC), open_motion, 50.0).faults
    apart = np.abs(open_motion.q[-1] - open_motion.q[0])
    assert faults == (f"is no cycle (joint{int(apart.argmax()) + 1} ends {apart.max():.3g} rad from where it began)",)


def test_a_transcription_that_keeps_limits_between_knots_is_named(line: Case) -> None:
    """Where the path is entered at speed rest is no way out."""
    problem = limited(line, velocity=1e-3)
    moving = replace(problem, reference=replace(problem.reference, timing=ConstantSpeed(2.0)))
    refused = resample(problem, line[1], 50.0)
    words = "method.global.transcription=spline keeps the limits between the knots too. "
    assert instead(Motions(composed(), moving, ()), [refused]) == words
    assert instead(Motions(composed(), moving, ()), [resample(line[0], line[1], 50.0)]) == ""


def test_a_tolerance_that_would_do_is_named(at_rest: Case) -> None:
    problem, motion = at_rest
    strict = replace(problem, reference=replace(problem.reference, tolerance=1e-9), rest=(True, True))
    refused = resample(strict, motion, 50.0)
    words = instead(Motions(composed(), strict, ()), [refused])
    given = float(words.split("path.tolerance=")[1].split()[0])
    assert refused.tracking_error < given < 1.2 * refused.tracking_error
    again = replace(strict, reference=replace(strict.reference, tolerance=given))
    assert resample(again, motion, 50.0).faults == ()


@pytest.mark.slow
def test_what_is_sent_keeps_its_limits_read_back_by_pinocchio(tmp_path: Path) -> None:
    """The file alone, by another library: torques, powers, second differences, and where the tool goes."""
    import pinocchio

    config = composed("+experiment=sim4_sendable", "timing.steps=50", "export.rate=1000")
    problem = prepare(config)
    motions = global_planner(problem, config.method.global_)
    sent = study(Motions(config, problem, [evaluate(problem, one) for one in motions]))
    assert isinstance(sent, Resampled)
    arm = problem.task.arm.description
    save_motion(tmp_path, sent, arm.actuated, arm.base)
    table, bounds = pd.read_csv(tmp_path / "motion.csv"), problem.bounds
    q, qd, qdd = (
        table[[f"{joint}_{kind}" for joint in arm.actuated]].to_numpy()
        for kind in ("position", "velocity", "acceleration")
    )
    model = pinocchio.buildModelFromUrdf(str(ROOT / "robots" / "planar3r.urdf"))
    model.gravity.setZero()
    data, tip = model.createData(), model.getFrameId("tip")
    tau, place = np.empty_like(q), np.empty((len(q), 2))
    for i in range(len(q)):
        tau[i] = pinocchio.rnea(model, data, q[i], qd[i], qdd[i])
        pinocchio.framesForwardKinematics(model, data, q[i])
        place[i] = data.oMf[tip].translation[:2]
    np.testing.assert_allclose(qd[[0, -1]], 0.0, atol=1e-9)
    for values, most in ((qd, bounds.velocity), (tau, bounds.torque), (tau * qd, bounds.power)):
        assert (np.abs(values) / most).max() <= 1 + 1e-6
    assert np.abs(tau).max() / 0.4 > 0.999, "a limit that does not bind shows nothing"
    time = table["time"].to_numpy()
    second = np.diff(q, 2, axis=0)[:-1] / np.diff(time)[:-2, None] ** 2
    assert np.abs(second).max() <= np.abs(qdd).max() * (1 + 1e-6)
    assert np.abs(place - problem.reference.position(time)).max() < 1e-4
