"""The arm and itself in the planner: what comes too near is solved again, and what does not stays as it is."""

from __future__ import annotations

from dataclasses import replace

import pytest

from pipeline.build.problem import prepare
from pipeline.evaluation.evaluation import Evaluation, evaluate
from pipeline.methods.global_planner import planner
from pipeline.methods.global_planner.planner import global_planner
from pipeline.methods.method import Context
from pipeline.problem.solution import Status
from tests.support import FEW_STARTS, composed

MARGIN = 0.25  # [m] of the last joint from the first: the best motion keeps it by 11 mm, the second falls 1.4 mm short
SPLINE = "method.global.transcription=spline"
TOO_WIDE = 0.28  # [m] no start keeps it
BALL = "[{kind: sphere, radius: 0.02, center: %s}]"
SHAPES = f"{{base: {BALL % '[0, 0, 0]'}, link2: {BALL % '[0.16, 0, 0]'}}}"


def optima(kept: str) -> list[Evaluation]:
    """The first two."""
    words = (f"robot.collision={SHAPES}", f"collision.margin={MARGIN}", f"collision.self={kept}", *FEW_STARTS)
    config = composed("+experiment=traj3", "timing.steps=20", *words)
    problem = prepare(config)
    return [evaluate(problem, one) for one in global_planner(problem, config.method.of("global"))[:2]]


def least(one: Evaluation) -> float:
    """[m]"""
    assert one.near.own is not None
    return float(one.near.own.bound)


@pytest.mark.slow
def test_an_optimum_too_near_to_the_arm_is_moved_and_others_stay() -> None:
    (best, second), (best_without, second_without) = optima("true"), optima("false")
    assert least(second_without) < MARGIN < least(best_without)
    assert best.energy_integral[-1] == pytest.approx(best_without.energy_integral[-1], rel=1e-9)
    assert second.status is Status.SOLVED
    assert MARGIN <= least(second) < MARGIN + 2e-3
    assert 1 < second.energy_integral[-1] / second_without.energy_integral[-1] < 1.1


@pytest.mark.slow
def test_where_all_are_too_near_the_pair_and_the_keys_are_named(monkeypatch: pytest.MonkeyPatch) -> None:
    """Those solved again are lost, and nothing is found that keeps off from the beginning: limits are not to blame."""
    said: list[str] = []
    monkeypatch.setattr(planner, "apart", lambda _, found, *__: [replace(one, converged=False) for one in found])
    monkeypatch.setattr(planner, "freer", lambda _: pytest.fail("other limits were tried"))
    words = (f"robot.collision={SHAPES}", f"collision.margin={TOO_WIDE}", "collision.self=true", *FEW_STARTS)
    config = composed("+experiment=traj3", "timing.steps=10", "limits=joint", SPLINE, *words)
    (one,) = global_planner(prepare(config), config.method.of("global"), Context(phase=said.append))
    assert not one.found
    assert "too near to the arm itself (base and link2 are 0.1" in one.message
    assert "collision.allow=[[base,link2]]" in one.message
    assert said.count("keeping the arm off itself") == 1


@pytest.mark.slow
def test_optima_that_are_left_out_are_counted(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(
        planner, "apart", lambda _, found, *__: [found[0], *(replace(one, converged=False) for one in found[1:])]
    )
    words = (f"robot.collision={SHAPES}", "collision.margin=0.01", "collision.self=true", *FEW_STARTS)
    config = composed("+experiment=traj3", "timing.steps=10", *words)
    (one,) = global_planner(prepare(config), config.method.of("global"))
    assert "; 2 more left out, too near to the arm itself; " in one.evidence
    assert one.statistics[planner.LOST] == 2
