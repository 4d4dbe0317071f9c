from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest
from scipy.interpolate import BSpline

from pipeline.common.arrays import Array
from pipeline.common.errors import InputError
from pipeline.config.methods import LsvOptions, PmkeOptions
from pipeline.evaluation.evaluation import evaluate
from pipeline.methods.lsv import lsv
from pipeline.methods.pmke.exact import ExactWindow, Found
from pipeline.methods.pmke.predictive import pmke
from pipeline.methods.pmke.predictor import SAMPLE, Predictor
from pipeline.methods.pmke.window import Window
from pipeline.problem.problem import Problem
from pipeline.problem.solution import Status

Make = Callable[[int, int], Problem]
Seen = list[tuple[Array, Array, Array, Array, BSpline]]

NOTHING = Found(np.zeros(0), np.zeros(0), np.zeros(2, bool), np.zeros(0), 0)


@pytest.fixture
def predictions(monkeypatch: pytest.MonkeyPatch) -> Seen:
    """Knots (h + 1,), points (h + 1, n), qd, qdd at the start and the spline of every prediction made."""
    seen: Seen = []
    interpolate = Predictor._interpolate

    def watched(self: Predictor, now: float, points: Array, qd: Array, qdd: Array) -> BSpline:
        spline = interpolate(self, now, points, qd, qdd)
        seen.append((now + self.times, points, qd, qdd, spline))
        return spline

    monkeypatch.setattr(Predictor, "_interpolate", watched)
    return seen


@pytest.mark.slow
@pytest.mark.parametrize("interpolation", ["quartic", "quintic", "cubic"])
@pytest.mark.parametrize("horizon", [1, 2, 5])
def test_predictions_are_on_the_path_and_join_the_motion(
    problem: Make, predictions: Seen, horizon: int, interpolation: str
) -> None:
    asked = problem(1, 100)
    solution = pmke(asked, PmkeOptions(dt=0.05, horizon=horizon, interpolation=interpolation))[0]
    result = evaluate(asked, solution)
    assert result.status is Status.SOLVED
    log = solution.statistics["predictions"]
    # A prediction every 0.5 s while a whole window is left.
    np.testing.assert_allclose([entry["time"] for entry in log], np.arange(0.0, 10.0 - horizon + 0.1, 0.5), atol=1e-9)
    assert len(predictions) == len(log)
    assert all(entry["converged"] for entry in log)
    motion = solution.trajectory
    for times, points, qd, qdd, spline in predictions:
        assert len(times) == horizon + 1
        np.testing.assert_allclose(asked.task.value(points[1:]), asked.reference.position(times[1:]), atol=1e-8)
        np.testing.assert_array_equal(points[0], motion.q[round(times[0] / 0.05)])
        np.testing.assert_allclose(spline(times), points, atol=1e-9)
        np.testing.assert_allclose(spline(times[0], 1), qd, atol=1e-9)
        np.testing.assert_allclose(spline(times[-1], 1), 0.0, atol=1e-9)
        assert spline.k == {"quartic": 4, "quintic": 5, "cubic": 3}[interpolation]
        if interpolation != "cubic":
            np.testing.assert_allclose(spline(times[0], 2), qdd, atol=1e-8)
            np.testing.assert_allclose(spline(times[-1], 2), 0.0, atol=1e-8)
    # Looking ahead pays: this motion costs LSV half as much again.
    baseline = evaluate(asked, lsv(asked, LsvOptions(dt=0.05))[0]).energy_integral[-1]
    assert result.energy_integral[-1] < (0.9 if horizon == 1 else 0.75) * baseline


def test_the_energy_of_a_prediction_is_that_of_its_knots(problem: Make, predictions: Seen) -> None:
    asked = problem(2, 100)
    solution = pmke(asked)[0]
    arm = asked.task.arm
    for (_, points, *_), entry in zip(predictions, solution.statistics["predictions"], strict=True):
        qd = np.diff(points, axis=0)  # knots are a second apart
        assert entry["objective"] == pytest.approx(arm.kinetic_energy(points[1:], qd).sum(), rel=1e-6)


@pytest.mark.parametrize(
    ("options", "horizon"),
    [
        (PmkeOptions(dt=0.05, horizon=10), 10),
        (PmkeOptions(dt=0.05, horizon=50), 10),
        (PmkeOptions(dt=0.05, prediction_step=4.0, horizon=5), 2),
        (PmkeOptions(dt=0.05, prediction_step=20.0), 1),
    ],
)
def test_a_window_longer_than_the_motion_is_cut(problem: Make, options: PmkeOptions, horizon: int) -> None:
    asked = problem(1, 100)
    solution = pmke(asked, options)[0]
    assert solution.status is Status.SOLVED
    assert solution.statistics["horizon"] == horizon
    assert all(0.0 <= entry["time"] < 10.0 for entry in solution.statistics["predictions"])
    assert solution.trajectory.time[-1] == 10.0
    assert np.isfinite(solution.trajectory.q).all()


@pytest.mark.slow
@pytest.mark.parametrize("update", [0.1, 0.04])
def test_a_prediction_at_every_step(problem: Make, update: float) -> None:
    """Update interval equal to dt, or below it: a prediction at every step while a window of 2 s is left."""
    asked = problem(1, 100)
    solution = pmke(asked, PmkeOptions(dt=0.1, update_interval=update))[0]
    log = solution.statistics["predictions"]
    np.testing.assert_allclose([entry["time"] for entry in log], np.arange(81) / 10, atol=1e-9)
    assert solution.status is Status.SOLVED
    baseline = evaluate(asked, lsv(asked, LsvOptions(dt=0.05))[0]).energy_integral[-1]
    assert 5.96e-4 < evaluate(asked, solution).energy_integral[-1] < 0.8 * baseline


def test_an_update_interval_beyond_the_motion_predicts_once(problem: Make) -> None:
    solution = pmke(problem(1, 100), PmkeOptions(dt=0.05, update_interval=100.0))[0]
    assert len(solution.statistics["predictions"]) == 1


def test_a_gain_too_large_for_the_step_is_refused(problem: Make) -> None:
    with pytest.raises(InputError, match=r"method\.pmke\.gain = 100 1/s diverges: .* below 2 / dt = 100 1/s"):
        pmke(problem(1, 100), PmkeOptions(dt=0.02, gain=100.0))


@pytest.mark.slow
def test_the_gain_takes_the_drift_away(problem: Make) -> None:
    asked = problem(2, 100)
    free, held = (
        evaluate(asked, pmke(asked, PmkeOptions(dt=0.05, gain=k))[0]).tracking_error.max() for k in (0.0, 10.0)
    )
    assert held < 0.3 * free


def test_predictions_that_fail_are_said(problem: Make, monkeypatch: pytest.MonkeyPatch) -> None:
    solve = Window.solve
    monkeypatch.setattr(Window, "solve", lambda *a, **k: solve(*a, **{**k, "max_iterations": 0}))
    monkeypatch.setattr("pipeline.methods.pmke.window.quasi_newton", lambda cost, rows, x, **_: x)
    monkeypatch.setattr(ExactWindow, "solve", lambda *_: NOTHING)
    solution = pmke(problem(1, 100), PmkeOptions(dt=0.05))[0]
    assert solution.status is Status.NOT_CONVERGED
    assert "17 of 17 predictions did not converge, the first at t = 0.00 s" in solution.message


def test_ipopt_confirms_what_is_asked_for_and_takes_over_where_newton_ends(
    problem: Make, monkeypatch: pytest.MonkeyPatch
) -> None:
    asked, logs, motions = problem(4, 100), {}, {}

    def run(name: str, **options: str) -> None:
        solution = pmke(asked, PmkeOptions(dt=0.1, **options))[0]  # type: ignore[arg-type]
        logs[name], motions[name] = solution.statistics["predictions"], solution.trajectory.q

    for confirm in ("every", "last", "none"):
        run(confirm, confirm=confirm)
    monkeypatch.setattr(ExactWindow, "solve", lambda *_: NOTHING)
    run("ipopt", confirm="none")
    for name, confirmed in (("every", 17), ("last", SAMPLE), ("none", 0), ("ipopt", 0)):
        apart = [entry["apart_from_ipopt"] for entry in logs[name] if entry["apart_from_ipopt"] is not None]
        assert len(apart) == confirmed
        assert max(apart, default=0.0) < 1e-6
        by_ipopt = name in ("every", "ipopt")
        assert {entry["status"] for entry in logs[name]} == ({"success"} if by_ipopt else {"newton"})
        np.testing.assert_allclose(motions[name], motions["ipopt"], atol=1e-5)


def test_projected_steps_leave_no_drift(problem: Make) -> None:
    asked = problem(2, 100)
    judged = evaluate(asked, pmke(asked, PmkeOptions(dt=0.05, project=True, confirm="none"))[0])
    assert judged.status is Status.SOLVED
    assert judged.tracking_error.max() < 1e-8
    with pytest.raises(
        InputError, match=r"method\.pmke\.gain corrects an error that method\.pmke\.project leaves none"
    ):
        pmke(asked, PmkeOptions(project=True, gain=1.0))
