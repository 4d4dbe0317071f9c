"""PMKE's controller in Drake's Simulator, and how long updates take."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from pipeline.build.problem import prepare
from pipeline.common.errors import ConfigError
from pipeline.config.run import RunConfig
from pipeline.config.studies import ControlConfig
from pipeline.evaluation.evaluation import evaluate
from pipeline.methods.pmke.predictive import pmke
from pipeline.run.state import state
from pipeline.studies import control, deadlines
from pipeline.studies.control import Loop
from pipeline.studies.study import Motions
from tests.support import composed


def loop_of(*words: str, **options: float) -> Loop:
    config = composed("path.length=0.08", "timing.duration=1.6", "method.pmke.prediction_step=0.4", *words)
    asked = replace(ControlConfig(), **options)  # type: ignore[arg-type]
    return control.simulate(prepare(config), replace(config.method.pmke, update_interval=0.4), asked)


@pytest.mark.slow
def test_an_arm_lighter_than_it_is_taken_for_stays_within_a_millimetre() -> None:
    loop = loop_of()
    assert loop.error.max() < 1e-3
    assert len(loop.status) == len(loop.time) == 161
    assert not any(status.startswith(("late", "held", "no ", "begins")) for status in loop.status)
    assert loop.energy > 0
    assert not loop.at_limit.any()
    exact = loop_of(mass_error=0.0, latency=0)
    assert exact.error.max() < loop.error.max()
    assert "off the path by at most" in loop.section()[0]
    figure = loop.figures("here")["control"]
    assert [axes.get_ylabel() for axes in figure.axes] == ["Off the path [mm]", "Torque [N m]", "Ticks"]


@pytest.mark.slow
def test_a_push_and_a_stall_are_seen_and_made_good() -> None:
    loop = loop_of(push_time=0.5, push_torque=0.05, stall_time=0.9, stall_ticks=6)
    push, stall = loop.disturbed[50:60], loop.disturbed[90:96]
    assert push.all()
    assert stall.all()
    assert loop.disturbed.sum() == 16
    assert len(loop.status) == len(loop.time) - 6
    assert "late: 6 ticks were missed" in loop.status
    assert loop.calm < 1e-3 < loop.error.max(), "the push is not felt: the test shows nothing"
    assert loop.error[-20:].max() < 1e-3
    assert "back at the end" in loop.section()[0]


@pytest.mark.slow
def test_weak_motors_are_at_their_limits() -> None:
    assert loop_of("limits=joint_torque_power", "limits.torque=2e-5", "limits.power=null").at_limit.mean() > 0.1


def test_a_problem_that_the_controller_does_not_serve_is_refused() -> None:
    words = ("methods=[pmke]", "control.run=true", "method.pmke.objective=torque")
    with pytest.raises(ConfigError, match=r"control\.run = true: pmke\.Controller does not serve torques"):
        state(composed(*words))


@pytest.mark.slow
def test_how_long_updates_took() -> None:
    problem = prepare(composed("timing.duration=4"))
    config = composed()
    solution = pmke(problem, replace(config.method.pmke, dt=0.1, confirm="last"))[0]
    log = solution.statistics["predictions"]
    for entry, took in zip(log, np.arange(1, len(log) + 1), strict=True):
        entry["wall_time_s"], entry["processor_time_s"] = 0.2 * took, 0.1 * took
    evaluation = evaluate(problem, solution)
    found = deadlines.study(Motions(RunConfig(), problem, [evaluation]))
    assert found is not None
    row = found.columns(evaluation)
    assert row["updates"] == len(log) == 5
    assert row["update_median_s"] == pytest.approx(0.6)
    assert row["update_processor_max_s"] == pytest.approx(0.5)
    assert row["update_99_percent_s"] == pytest.approx(0.992)
    assert row["late_updates"] == pytest.approx(0.6)  # of 0.5 s: 0.6, 0.8 and 1 s
    assert row["late_updates_processor"] == 0.0
    assert row["confirmed_updates"] == 5
    assert row["apart_from_ipopt"] < 1e-6
    assert "5 of them were confirmed by IPOPT, which moved no joint by more than" in found.section()[0]
    assert "60 % were later than 500 ms, by processor time 0 %" in found.section()[0]
    without_unit = {"updates", "late_updates", "late_updates_processor", "confirmed_updates"}
    assert set(row) - without_unit == set(found.units)
    assert [*found.figures("here")] == ["updates"]
