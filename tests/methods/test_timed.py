"""Timing that is found with the motion: the cheapest law of a path, and the shortest time within its limits."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from pipeline.build.problem import prepare
from pipeline.common import kept
from pipeline.common.arrays import Array
from pipeline.common.errors import InputError
from pipeline.config.methods import GlobalOptions
from pipeline.evaluation.evaluation import evaluate
from pipeline.methods.global_planner.planner import global_planner
from pipeline.methods.global_planner.smooth import Searches
from pipeline.methods.global_planner.timed import Timed, cheapest, recorded, settle, settled, timed
from pipeline.methods.lsv import lsv
from pipeline.methods.method import Context
from pipeline.problem.limits import LIMIT_KINDS, Limits
from pipeline.problem.problem import Problem
from pipeline.problem.solution import Solution, Status, Trajectory
from pipeline.program.spline.curve import Curve
from pipeline.program.spline.tighten import excesses
from pipeline.studies.retiming import retimed
from tests.program.test_spline import weighted
from tests.support import composed, free_line

OPTIONS = GlobalOptions()
PACE = replace(Limits.none(3), velocity=np.full(3, 2.0), acceleration=np.full(3, 10.0))


def line(**more: object) -> Problem:
    """Simulation 1's line on 16 intervals, from rest to rest."""
    return replace(free_line(16), rest=(True, True), **more)  # type: ignore[arg-type]


@pytest.fixture(scope="module")
def motion() -> Array:
    return weighted(free_line(16))


@pytest.fixture(scope="module")
def fastest(motion: Array) -> Timed:
    return settle((line(limits=PACE, free_law=True, free_duration=True), OPTIONS), motion)


@pytest.mark.slow
def test_energy_goes_with_the_speed_and_not_with_its_bounds(motion: Array) -> None:
    """Without limits the cheapest law is one of constant energy but for its ends: of 1/T, and below the raised cosine's
    by a fifth at least.
    """
    costs = {}
    for seconds in (1.0, 2.0):
        asked = line(free_law=True).slowed(seconds)
        answer = cheapest(asked, Curve.through(asked, asked.times, motion), Searches(OPTIONS))
        assert answer.converged
        assert answer.problem.reference.duration == pytest.approx(seconds)
        costs[seconds] = answer.cost
    assert 2 * costs[2.0] == pytest.approx(costs[1.0], rel=1e-6)
    assert costs[1.0] < 0.8 * 0.0527  # simulation 1's


@pytest.mark.slow
def test_the_shortest_motion_keeps_its_limits_and_uses_them(fastest: Timed) -> None:
    """It cannot be faster than the least time of its own joint path (toppra), and is nearly as fast."""
    assert fastest.converged
    reached = {kind: float(excess.max()) for kind, excess in excesses(fastest.problem, fastest.curve).items()}
    assert max(reached.values()) <= 1e-6
    assert max(reached.values()) > -1e-4
    bound = retimed(fastest.problem, fastest.curve(np.linspace(0.0, fastest.curve.times[-1], 201)))
    assert bound * (1 - 1e-3) <= fastest.cost <= 1.15 * bound
    law = fastest.problem.reference.timing
    s, sd, _ = law.sample(np.linspace(0.0, law.duration, 301), 0.4)
    assert sd.min() >= -1e-9
    np.testing.assert_allclose(s[[0, -1]], [0.0, 0.4], atol=1e-12)


@pytest.mark.slow
@pytest.mark.parametrize("free", [True, False])
def test_workers_hand_back_numbers_and_words(fastest: Timed, monkeypatch: pytest.MonkeyPatch, free: bool) -> None:
    asked = line(limits=PACE, free_law=free, free_duration=True)
    found = fastest if free else replace(fastest, problem=asked.slowed(fastest.cost))
    monkeypatch.setattr("pipeline.methods.global_planner.timed.settle", lambda *_: found)
    record = kept.loads(kept.dumps(settled((asked, OPTIONS), fastest.curve.q)))
    t = np.linspace(0.0, fastest.cost, 21)
    expected = found.problem.reference.position(t)
    np.testing.assert_allclose(record.reference(asked).position(t), expected, atol=1e-12)


@pytest.mark.slow
def test_a_free_law_is_faster_than_one_that_is_kept(fastest: Timed, motion: Array) -> None:
    slow = settle((line(limits=PACE, free_duration=True), OPTIONS), motion)
    assert slow.converged
    assert slow.cost > 1.1 * fastest.cost
    assert type(slow.problem.reference.timing) is type(line().reference.timing)


@pytest.mark.slow
def test_the_answer_is_judged_by_its_own_law(motion: Array) -> None:
    asked = line(limits=PACE, free_law=True, free_duration=True)
    begun = [Solution("global", Trajectory(asked.times, motion), Status.SOLVED)]
    (answer,) = timed(asked, begun, OPTIONS, Context())
    judged = evaluate(asked, answer)
    assert judged.status is Status.SOLVED
    assert answer.reference is not None
    assert answer.message == f"shortest duration found {answer.reference.duration:.4g} s, law of the path free"
    short = replace(asked, free_duration=False).slowed(0.5 * answer.reference.duration)
    (none,) = timed(short, begun, OPTIONS, Context())
    assert none.status is Status.INFEASIBLE
    said = float(none.message.split("shortest feasible duration ")[1].split()[0])
    assert said == pytest.approx(answer.reference.duration, rel=1e-2)


@pytest.mark.slow
@pytest.mark.parametrize("free", [False, True])
def test_the_pace_of_the_tool_is_kept_and_used(motion: Array, free: bool) -> None:
    """Under the raised cosine 2 L / V; under a free law not much more than L / V + V / A, which is bang and bang.
    Judged between the knots by the evaluation's own plant.
    """
    speed, acceleration = 0.3, 2.0 if free else np.inf
    bounds = replace(PACE, tool_speed=speed, tool_acceleration=acceleration)
    asked = line(limits=bounds, free_law=free, free_duration=True)
    answer = settle((asked, OPTIONS), motion)
    length = asked.reference.geometry.length
    least = length / speed + speed / acceleration if free else 2 * length / speed
    assert answer.converged
    assert least <= answer.cost <= (1.06 if free else 1.005) * least
    curve = answer.curve
    one = Solution("global", Trajectory(curve.times, curve.q, curve.ends), Status.SOLVED, limits_kept=LIMIT_KINDS)
    judged = evaluate(asked, replace(one, reference=recorded(answer).reference(asked)))
    kinds = ["tool_speed", "tool_acceleration"][: 1 + free]
    for kind in kinds:
        assert -0.02 < judged.limit_excess_between[kind] <= 1e-6


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (("timing.duration=shortest",), "nothing limits the motion's pace; set limits.velocity"),
        (("timing=optimal",), "unless the accelerations of all joints are limited"),
        (("timing.duration=shortest", "timing=from_file", "path=waypoints"), "the times are those of path.file"),
        (("timing.duration=shortest", "timing.dense=[[0,1,2]]", "limits.torque=1"), "timing.dense: its times"),
    ],
)
def test_what_has_no_answer_is_refused(words: tuple[str, ...], said: str) -> None:
    with pytest.raises(InputError) as refused:
        prepare(composed(*words))
    assert said in str(refused.value)


def test_other_methods_say_who_finds_a_timing() -> None:
    with pytest.raises(InputError, match=r"^lsv: timing.law = optimal and .* are found by the method global alone$"):
        lsv(line(free_law=True))
    with pytest.raises(InputError, match=r"^global: method.global.transcription = differences"):
        global_planner(line(free_law=True), replace(OPTIONS, transcription="differences"))
