from __future__ import annotations

import re
from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest

import pipeline
from pipeline.common.errors import InputError
from pipeline.config.methods import PmkeOptions
from pipeline.methods.pmke.controller import Command, Controller
from pipeline.methods.pmke.exact import ExactWindow, Found
from pipeline.methods.pmke.predictive import pmke
from pipeline.problem.limits import Limits
from pipeline.problem.objective import Objective
from pipeline.problem.problem import Problem
from tests.support import ROOT

Make = Callable[[int, int], Problem]
PERIOD = 0.05
NOTHING = Found(np.zeros(0), np.zeros(0), np.zeros(2, bool), np.zeros(0), 0)


def ticks(controller: Controller, begin: int, end: int) -> list[Command]:
    """An arm that does exactly what it is told."""
    commands = []
    for k in range(begin, end):
        commands.append(controller.update(k * PERIOD, controller.q, controller.qd))
    return commands


def test_an_arm_that_obeys_makes_the_motion_of_the_method(problem: Make) -> None:
    asked = problem(1, 100)
    motion = pmke(asked, PmkeOptions(dt=PERIOD, project=True, confirm="none"))[0].trajectory
    commands = ticks(Controller(asked, PmkeOptions(), period=PERIOD), 0, 200)
    np.testing.assert_allclose([command.q for command in commands], motion.q[1:], atol=1e-6)
    assert {command.status for command in commands} == {"follows", "predicts"}
    assert sum(command.status == "predicts" for command in commands) == 17
    own = commands[20]
    tau = asked.task.arm.inverse_dynamics(*(row[None] for row in (commands[19].q, commands[19].qd, own.qdd)))[0]
    tau += asked.task.arm.mass_matrix(commands[19].q[None])[0] @ (50 * (own.qd - commands[19].qd))
    np.testing.assert_allclose(own.tau, tau, atol=1e-9)
    assert own.horizon.shape == (3, 4)
    np.testing.assert_allclose(own.horizon[:, 0], [1.0, 2.0, 3.0])
    assert own.wall_time > 0


def test_nothing_is_raised_in_the_loop_and_the_arm_is_held(problem: Make, monkeypatch: pytest.MonkeyPatch) -> None:
    controller = Controller(problem(1, 100), period=PERIOD)
    before = ticks(controller, 0, 5)[-1]
    for q in (np.full(3, np.nan), np.zeros(2), "nonsense"):
        command = controller.update(0.25, q, np.zeros(3))  # type: ignore[arg-type]
        assert command.status.startswith("held: ")
        np.testing.assert_array_equal(command.q, before.q)
        np.testing.assert_array_equal(command.qd, 0.0)
        assert np.isfinite(command.tau).all()
    late = controller.update(0.5, controller.q, controller.qd)
    assert late.status == "late: 5 ticks were missed"
    assert controller.time == pytest.approx(0.55)
    target = controller.problem.reference.position(np.array([0.55]))
    np.testing.assert_allclose(controller.task.value(late.q[None]), target, atol=1e-8)
    monkeypatch.setattr(ExactWindow, "solve", lambda *_: NOTHING)
    later = ticks(controller, 11, 31)
    assert any(command.status.startswith("no prediction: ") for command in later)
    away = controller.update(31 * PERIOD, controller.q + 0.3, np.zeros(3))
    assert away.status == "begins anew: 0.3 rad from the reference" or away.status.startswith("no prediction")


def test_the_guides_example_runs(monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> None:
    monkeypatch.chdir(ROOT)
    (example,) = re.findall(r"```python\n(.*?)```", (ROOT / "docs/guide/control.md").read_text(encoding="utf-8"), re.S)
    exec(compile(example, "control.md", "exec"), {})
    assert re.match(r"(follows|predicts) \[", capsys.readouterr().out)


def test_an_arm_that_was_pushed_goes_on_from_where_it_is(problem: Make) -> None:
    controller = Controller(problem(1, 100), period=PERIOD)
    ticks(controller, 0, 40)
    shifted = controller.q + np.array([0.3, -0.3, 0.2])
    command = controller.update(2.0, shifted, np.zeros(3))
    assert command.status == "begins anew: 0.3 rad from the reference"
    assert np.abs(command.q - shifted).max() < 0.25, "the reference is where it was"
    np.testing.assert_allclose(
        controller.task.value(command.q[None]), controller.problem.reference.position(np.array([2.05])), atol=1e-8
    )


def test_torques_end_at_the_motors_limits(problem: Make) -> None:
    weak = replace(problem(1, 100), limits=replace(Limits.none(3), torque=np.full(3, 1e-4)))
    command = Controller(weak, period=PERIOD).update(0.0, weak.q_init + 0.05, np.zeros(3))
    np.testing.assert_allclose(np.abs(command.tau), 1e-4)


def test_what_it_does_not_serve_is_refused_before_the_loop(problem: Make) -> None:
    assert pipeline.Controller is Controller
    with pytest.raises(InputError, match="period = 0 s; it must be positive"):
        Controller(problem(1, 10), period=0.0)
    torque = replace(problem(1, 10), objective=Objective({"torque": 1.0}))
    with pytest.raises(InputError, match="does not serve torques"):
        Controller(torque, PmkeOptions(objective="torque"))
