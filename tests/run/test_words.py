"""Words of the command line and what becomes of them: paths, timing laws, grids, limits, boundaries."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import pytest

from pipeline.build.problem import prepare
from pipeline.common.errors import ConfigError, PathError, RobotError
from pipeline.config import run as schema
from pipeline.config.methods import LsvOptions
from pipeline.evaluation.evaluation import evaluate
from pipeline.methods.global_planner.planner import global_planner
from pipeline.methods.lsv import lsv
from pipeline.methods.pmke.predictive import pmke
from pipeline.problem.problem import Boundary, Problem
from pipeline.problem.solution import Status
from tests.support import FEW, composed


def prepared(*words: str) -> Problem:
    return prepare(composed(*words))


# --- paths, timings, grids -------------------------------------------------------------------------------------------


@pytest.fixture
def points(tmp_path: Path) -> Callable[[Any], Path]:
    def write(rows: Any) -> Path:
        pd.DataFrame(rows, columns=["x", "y"]).to_csv(tmp_path / "points.csv", index=False)
        return tmp_path / "points.csv"

    return write


ROWS = np.array([[0.45, 0.02], [0.40, 0.06], [0.36, 0.05], [0.33, 0.10]])


@pytest.mark.slow
@pytest.mark.parametrize("relative", [False, True])
def test_way_points(points: Callable[[Any], Path], relative: bool) -> None:
    config = composed(
        "path=waypoints",
        f"path.file={points(ROWS)}",
        f"path.relative={str(relative).lower()}",
        "timing.steps=26",
        "path.tolerance=2e-3",
    )
    problem = prepare(config)
    here = prepared().task.value(np.array([config.robot.q_init]))[0]
    shift = here - ROWS[0] if relative else 0.0
    start = problem.task.value(problem.q_init[None])[0]
    np.testing.assert_allclose(start, (ROWS + shift)[0], atol=1e-9)
    dense = problem.reference.geometry.sample(np.linspace(0.0, problem.reference.geometry.length, 4001))[0]
    for point in ROWS + shift:
        assert np.linalg.norm(dense - point, axis=1).min() < 1e-4
    if relative:
        np.testing.assert_allclose(problem.q_init, config.robot.q_init, atol=1e-9)
    solutions = [lsv(problem, LsvOptions(dt=0.05))[0], pmke(problem)[0]]
    solutions += global_planner(problem, replace(FEW, optimised=3))
    assert all(evaluate(problem, solution).status is Status.SOLVED for solution in solutions)


def test_a_path_of_two_way_points_is_a_line(points: Callable[[Any], Path]) -> None:
    problem = prepared("path=waypoints", f"path.file={points(ROWS[:2])}")
    assert problem.reference.geometry.length == pytest.approx(np.linalg.norm(ROWS[1] - ROWS[0]), rel=1e-12)


@pytest.mark.slow
def test_a_path_can_say_where_it_starts() -> None:
    problem = prepared("path.start=[0.40,0.05]", "path.length=0.1")
    moved = problem.task.value(problem.q_init[None])[0]
    np.testing.assert_allclose(moved, [0.40, 0.05], atol=1e-9)
    np.testing.assert_allclose(problem.reference.position(np.zeros(1))[0], [0.40, 0.05], atol=1e-12)
    assert np.abs(problem.q_init - [0.0, 0.327, -0.754]).max() > 1e-2
    assert evaluate(problem, lsv(problem)[0]).status is Status.SOLVED


@pytest.mark.slow
@pytest.mark.parametrize("law", ["constant_speed", "quintic", "raised_cosine"])
def test_timing_laws_run(law: str) -> None:
    problem = prepared("+experiment=traj1", f"timing={law}", "timing.duration=10.0", "timing.steps=26")
    solutions = [lsv(problem, LsvOptions(dt=0.05))[0], pmke(problem)[0]]
    solutions += global_planner(problem, replace(FEW, optimised=3))
    motions = [evaluate(problem, solution) for solution in solutions]
    assert [motion.status for motion in motions] == [Status.SOLVED] * len(motions)
    costs = [motion.energy_integral_spline for motion in motions[:3]]
    assert costs[2] < costs[1] < costs[0]  # global, pmke, lsv
    speed = np.linalg.norm(problem.reference.sample(np.array([0.0, 5.0]))[1], axis=1)
    peak = {"constant_speed": (0.01, 0.01), "quintic": (0.0, 0.01875), "raised_cosine": (0.0, 0.02)}[law]
    np.testing.assert_allclose(speed, peak, atol=1e-12)


def test_grids() -> None:
    even = prepared("timing.duration=2.0", "timing.steps=8").times
    np.testing.assert_allclose(even, np.linspace(0.0, 2.0, 9))
    dense = prepared("timing.duration=2.0", "timing.steps=20", "timing.dense=[[0.0,1.0,3]]").times
    assert (dense[0], dense[-1], len(dense)) == (0.0, 2.0, 21)
    assert ((dense < 1.0).sum(), (dense > 1.0 + 1e-9).sum()) == (15, 5)


@pytest.mark.parametrize(
    ("words", "finite"),
    [
        ([], {}),
        (["limits=joint"], {"lower": True, "upper": True, "velocity": True}),
        (
            ["limits=joint_torque_power"],
            {"lower": True, "upper": True, "velocity": True, "torque": True, "power": True},
        ),
        (["limits.velocity=2.0"], {"velocity": True}),
    ],
)
def test_which_limits_hold(words: list[str], finite: dict[str, bool]) -> None:
    limits = prepared(*words).bounds
    for name in ("lower", "upper", "velocity", "torque", "power"):
        assert np.isfinite(getattr(limits, name)).all() == finite.get(name, False), name
    if "limits=joint_torque_power" in words:
        degrees = np.rad2deg(np.vstack([-limits.lower, limits.upper]))
        np.testing.assert_allclose(degrees, [[90, 120, 120]] * 2, atol=0.01)
        np.testing.assert_allclose([limits.velocity, limits.torque, limits.power], [[3.8] * 3, [0.4] * 3, [0.7] * 3])


def test_a_value_given_overrides_the_description() -> None:
    limits = prepared("limits=joint", "limits.velocity=[1.0,2.0,3.0]", "limits.upper=2.5").bounds
    np.testing.assert_array_equal(limits.velocity, [1.0, 2.0, 3.0])
    np.testing.assert_array_equal(limits.upper, [2.5, 2.5, 2.5])
    assert np.isinf(limits.torque).all()


def test_boundaries_and_objectives_arrive() -> None:
    problem = prepared("path=circle", "boundary=cyclic", "objective=weighted")
    assert problem.boundary is Boundary.CYCLIC
    assert problem.objective.weights == {"kinetic_energy": 0.5, "torque": 0.5}
    gap = problem.reference.position(np.array([0.0, problem.reference.duration]))
    np.testing.assert_allclose(gap[0], gap[1], atol=1e-12)


def test_both_models_of_the_arm() -> None:
    identified, printed = (prepared(f"robot={name}") for name in ("planar3r", "planar3r_printed"))
    q = np.array([[0.1, 0.2, 0.3]])
    np.testing.assert_allclose(identified.task.value(q), printed.task.value(q), atol=1e-15)
    assert np.abs(identified.task.arm.mass_matrix(q) / printed.task.arm.mass_matrix(q) - 1).min() > 0.1


@pytest.mark.parametrize(
    ("values", "error", "named"),
    [
        ({"robot": {"q_init": [0.0, 0.0]}}, RobotError, "robot.q_init has 2 values"),
        ({"limits": {"torque": [0.4, 0.4]}}, ConfigError, "limits.torque has 2 values"),
        ({"boundary": {"kind": "cyclic"}}, PathError, "cyclic"),
        ({"path": {"kind": "line", "length": 3.0}}, PathError, "out of reach from"),
        ({"path": {"kind": "waypoints"}}, ConfigError, "path.file"),
    ],
)
def test_python_callers_get_the_same_errors(values: dict[str, Any], error: type[Exception], named: str) -> None:
    with pytest.raises(error, match=named):
        prepare(schema.check(values))
