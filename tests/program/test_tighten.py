"""Limits between the knots of a spline, and the shortest motion within them."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from scipy.interpolate import CubicSpline

from pipeline.problem.limits import Limits
from pipeline.problem.objective import Objective
from pipeline.problem.problem import Problem
from pipeline.program.spline.curve import Curve
from pipeline.program.spline.program import Spline, Tightened
from pipeline.program.spline.tighten import excesses, keeps_forces, tighten, worst
from pipeline.program.spline.transcription import transcribe
from tests.program.test_spline import BOTH, weighted
from tests.support import free_line

CUT = 0.98


@pytest.fixture(scope="module")
def tight() -> tuple[Problem, Curve]:
    """Simulation 1's line at rest with limits that bind, and its optimum by squared torques without them."""
    asked = replace(free_line(16), rest=BOTH, objective=Objective({"torque": 1.0}))
    free = transcribe(asked, Curve.through(asked, asked.times, weighted(asked))).solve().curve
    peak = {
        kind: np.abs(values).max(axis=0)
        for kind, values in (
            ("velocity", free(np.linspace(0, 1, 251), 1)),
            ("torque", asked.task.arm.inverse_dynamics(free.q, free.v, free.a)),
        )
    }
    bounds = replace(Limits.none(3), velocity=CUT * peak["velocity"], torque=np.full(3, CUT * peak["torque"].max()))
    return replace(asked, limits=bounds), free


def test_limits_hold_between_the_knots(tight: tuple[Problem, Curve]) -> None:
    """Sampled by other code, twenty times as finely as the knots: what binds does so to the digit."""
    asked, free = tight
    assert not keeps_forces(asked, free)
    first = transcribe(asked, free).solve()
    solved, further = tighten(asked, first, lambda *_: 0.0)
    assert first.outcome.converged
    assert solved.outcome.converged
    spline = CubicSpline(asked.times, solved.curve.q, bc_type="clamped")
    fine = np.linspace(0.0, 1.0, 501)
    qd, qdd = spline(fine, 1), spline(fine, 2)
    tau = asked.task.arm.inverse_dynamics(spline(fine), qd, qdd)
    speed, torque = np.abs(qd) / asked.bounds.velocity, np.abs(tau) / asked.bounds.torque
    assert speed.max() <= 1 + 1e-6
    assert torque.max() <= 1 + 1e-6
    assert torque.max() > 0.99, "a limit that does not bind shows nothing"
    before = max(float(excess.max()) for excess in excesses(asked, first.curve).values())
    assert bool(further) == (before > 1e-7)


@pytest.mark.parametrize(("room", "counted"), [(10.0, 0), (1.0, 3)])
def test_forces_stay_out_of_a_solve_that_keeps_off_while_they_are_kept(
    tight: tuple[Problem, Curve], room: float, counted: int
) -> None:
    """They cost several times what all else does. Where they are exceeded they come in."""
    bounded, free = tight
    tau = np.abs(bounded.task.arm.inverse_dynamics(free.q, free.v, free.a)).max()
    asked = replace(bounded, objective=Objective(), limits=replace(Limits.none(3), torque=np.full(3, room * tau)))
    first = transcribe(replace(asked, limits=None), free).solve()
    lacking = iter([1e-3, 0.0])
    solved, further = tighten(asked, first, lambda *_: next(lacking, 0.0))
    assert len(first.program.forces) == 0
    assert len(further[0].program.forces) == counted
    assert solved.outcome.converged
    assert keeps_forces(asked, solved.curve, -1e-6)


def test_the_worst_excess_is_named(tight: tuple[Problem, Curve]) -> None:
    asked, free = tight
    found = worst(asked, free)
    assert found is not None
    assert found.kind in ("velocity", "torque")
    assert found.relative == pytest.approx(1 / CUT - 1, abs=0.02)
    assert found.reached == pytest.approx(found.limit * (1 + found.relative))
    assert worst(replace(asked, limits=None), free) is None


def test_the_shortest_motion_leaves_no_room_and_exceeds_nothing(tight: tuple[Problem, Curve]) -> None:
    """Replayed in its own time it keeps every limit, and one of them binds."""
    asked, free = tight
    solved = transcribe(asked, free, stretch=1.2).solve()
    assert solved.outcome.converged
    assert 0.3 < solved.stretch < 1.0
    fast = solved.curve.stretched(solved.stretch)
    tau = asked.task.arm.inverse_dynamics(fast.q, fast.v, fast.a)
    used = max(float((np.abs(tau) / asked.bounds.torque).max()), float((np.abs(fast.v) / asked.bounds.velocity).max()))
    assert used == pytest.approx(1.0, abs=1e-5)


def test_the_shortest_motion_that_was_lost_is_sought_again(
    tight: tuple[Problem, Curve], monkeypatch: pytest.MonkeyPatch
) -> None:
    """A first solve that is stopped at once, and then another one, to the end."""
    program, stopped, run = transcribe(*tight, stretch=1.2), [], Spline.run

    def first_stopped(self: Spline, **options: Any) -> Any:
        outcome, iterations = run(self, **options, **({} if stopped else {"max_iterations": 1}))
        stopped.append(outcome.status)
        return outcome, iterations

    monkeypatch.setattr(Spline, "run", first_stopped)
    solved = program.solve()
    assert stopped == ["max iteration exceeded", "success"]
    assert solved.outcome.converged
    assert 0.3 < solved.stretch < 1.0


def test_tightened_limits_hold_at_the_knots(tight: tuple[Problem, Curve]) -> None:
    asked, free = tight
    whole = Tightened.none(asked, asked.times)
    solved = transcribe(asked, free, replace(whole, torque=0.98 * whole.torque)).solve()
    tau = asked.task.arm.inverse_dynamics(solved.curve.q, solved.curve.v, solved.curve.a)
    assert (np.abs(tau) / asked.bounds.torque).max() == pytest.approx(0.98, abs=1e-6)
