"""The closed loop in Drake's Simulator: what a controlled arm of given strength makes of a motion."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from pipeline.build.problem import prepare
from pipeline.config.studies import ClosedLoopConfig
from pipeline.evaluation.evaluation import Evaluation, evaluate
from pipeline.methods.lsv import lsv
from pipeline.model.arm import Arm
from pipeline.model.task import PositionTask
from pipeline.problem.limits import Limits
from pipeline.problem.problem import Problem
from pipeline.robot.mounting import Mounting
from pipeline.studies.closed_loop import ClosedLoop, simulate
from tests.support import composed, robot

Case = tuple[Problem, Evaluation]
OPTIONS = ClosedLoopConfig()


def case_of(*words: str) -> Case:
    problem = prepare(composed("path.length=0.15", "timing.duration=2", *words))
    return problem, evaluate(problem, lsv(problem)[0])


@pytest.fixture(scope="module")
def case() -> Case:
    return case_of()


def weak(problem: Problem, torque: float) -> Problem:
    return replace(problem, limits=replace(Limits.none(3), torque=np.full(3, torque)))


def joint_error(loop: ClosedLoop) -> float:
    return float(np.abs(loop.joint_error).max())


def test_a_motion_is_followed(case: Case) -> None:
    loop = simulate(*case, OPTIONS)
    assert loop.diverged is None
    assert loop.saturation == 0.0
    assert joint_error(loop) < 1e-3
    assert loop.end_effector_error.max() < 1e-3
    assert (loop.time[0], loop.time[-1]) == (0.0, pytest.approx(2.0))
    np.testing.assert_allclose(np.diff(loop.time), 1e-3, atol=1e-9)
    # The torques are those of inverse dynamics, within what the controller's corrections add.
    problem, motion = case
    wanted = np.interp(loop.time, motion.time, motion.tau[:, 0])
    later = slice(20, None)
    assert np.abs(loop.tau[later, 0] - wanted[later]).max() < 0.1 * np.abs(motion.tau[:, 0]).max()
    np.testing.assert_array_equal(loop.effort, problem.task.arm.description.effort)
    assert "followed to" in loop.sentence
    assert loop.sentence.endswith("0 % of the time")


def test_a_weak_motor_is_reported_and_never_gives_more_than_it_can(case: Case) -> None:
    problem, motion = case
    strongest = np.abs(motion.tau).max()
    strong, enough = simulate(*case, OPTIONS), 0.5 * strongest
    loop = simulate(weak(problem, enough), motion, OPTIONS)
    assert loop.saturation > 0.05
    assert np.abs(loop.tau).max() <= enough
    assert np.abs(loop.wanted).max() > enough
    assert joint_error(loop) > 10 * joint_error(strong)
    np.testing.assert_array_equal(loop.saturated.any(axis=1), (np.abs(loop.wanted) > enough * (1 + 1e-9)).any(axis=1))
    assert f"{100 * loop.saturation:.2g} % of the time" in loop.sentence


def test_the_simulated_arm_gets_no_more_than_the_limit(case: Case) -> None:
    """What the plant gains in kinetic energy, a motor at its limit can have given: the loop is cut, not the log."""
    problem, motion = case
    strongest = np.abs(motion.tau).max()
    loop = simulate(weak(problem, 0.01 * strongest), motion, OPTIONS)
    q = loop.joint_error + np.array([np.interp(loop.time, motion.time, column) for column in motion.q.T]).T
    qd = np.gradient(q, loop.time, axis=0)
    energy = problem.task.arm.kinetic_energy(q, qd)
    work = np.concatenate([[0.0], np.cumsum((np.abs(qd) * 0.01 * strongest).sum(axis=1)[1:] * np.diff(loop.time))])
    assert (energy[20:-20] <= 1.2 * work[20:-20] + 1e-9).all()


def test_a_wrong_mass_costs_accuracy(case: Case) -> None:
    errors = [joint_error(simulate(*case, replace(OPTIONS, mass_error=error))) for error in (0.0, 0.1, 0.3)]
    assert 3 * errors[0] < errors[1] < errors[2]


def test_more_bandwidth_follows_better_and_an_error_at_the_start_dies_out(case: Case) -> None:
    slow, fast = (
        joint_error(simulate(*case, replace(OPTIONS, bandwidth=bandwidth, mass_error=0.2)))
        for bandwidth in (10.0, 40.0)
    )
    assert fast < 0.3 * slow
    loop = simulate(*case, replace(OPTIONS, initial_error=0.01))
    assert np.abs(loop.joint_error[0]) == pytest.approx([0.01] * 3)
    assert np.abs(loop.joint_error[-1]).max() < 1e-4


def test_a_lost_motion_is_said(case: Case) -> None:
    """A controller that samples far too slowly for its gains."""
    loop = simulate(*case, replace(OPTIONS, bandwidth=200.0, sampling=10.0, initial_error=0.1))
    assert loop.diverged is not None
    assert loop.diverged < 2.0
    assert "lost the motion at t = " in loop.sentence


def test_gravity_payload_rotors_and_a_placed_base(case: Case) -> None:
    """The plant of the simulation and the controller's model carry all of them, and agree."""
    problem, _ = case
    arm = Arm(
        robot("planar3r").description,
        Mounting(
            gravity=(0.0, -0.1, -9.8),
            payload=0.1,
            armature=0.04,
            base_position=(0.2, 0.1, 0.3),
            base_rpy=(0.0, 0.0, 0.4),
        ),
    )
    task = PositionTask(arm)
    start = task.value(problem.q_init[None])[0]
    moved = replace(
        problem,
        task=task,
        reference=replace(problem.reference, geometry=replace(problem.reference.geometry, start=start)),
    )  # type: ignore[type-var]
    motion = evaluate(moved, lsv(moved)[0])
    loop = simulate(moved, motion, OPTIONS)
    assert loop.diverged is None
    assert joint_error(loop) < 1e-3
    assert loop.end_effector_error.max() < 1e-3
    # Both could forget the same thing: the torques are also those of the evaluation.
    for wanted, got in zip(motion.tau.T, loop.tau.T, strict=True):
        off = np.interp(loop.time, motion.time, wanted)[20:] - got[20:]
        assert np.abs(off).max() < 0.04 * np.abs(motion.tau).max()


def test_the_picture(case: Case) -> None:
    problem, motion = case
    loop = simulate(weak(problem, 0.5 * float(np.abs(motion.tau).max())), motion, OPTIONS)
    for one in (loop, replace(loop, effort=np.full(3, np.inf))):
        (figure,) = one.figures("line").values()
        assert figure.get_suptitle() == "line: closed loop, LSV"
        assert [axes.get_ylabel() for axes in figure.axes][:2] == ["Joint error [rad]", "End-effector error [m]"]
        assert [text.get_text() for text in figure.legends[0].get_texts()] == ["joint1", "joint2", "joint3"]
