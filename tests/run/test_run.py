"""One run: what it leaves, and the numbers of the PMKE paper, recomputed from q(t)."""

from __future__ import annotations

import functools
import json
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import pytest
from hydra import compose, initialize_config_dir

from pipeline.artifacts.recording.blueprint import slug
from pipeline.artifacts.recording.recording import read_series
from pipeline.build.problem import prepare
from pipeline.common.errors import ConfigError, PathError, RobotError
from pipeline.config import run as schema
from pipeline.config.compose import checked
from pipeline.config.methods import LsvOptions
from pipeline.evaluation.evaluation import Evaluation, evaluate
from pipeline.methods.global_planner.planner import global_planner
from pipeline.methods.lsv import lsv
from pipeline.methods.method import Context
from pipeline.methods.pmke.predictive import pmke
from pipeline.problem.problem import Boundary, Problem
from pipeline.problem.solution import Status
from pipeline.run.solve import solve
from tests.reports import leave_out_pictures
from tests.run.test_main import ROOT, Answer, call, command
from tests.support import FEW, FEW_STARTS, RUN_FILES

FIGURES = ("stroboscopic", "joints", "energy", "torques")


def configured(*words: str) -> schema.RunConfig:
    with initialize_config_dir(str(ROOT / "conf"), version_base="1.3"):
        return checked(compose("config", overrides=list(words)))


def prepared(*words: str) -> Problem:
    return prepare(configured(*words))


def strict_json(text: str) -> dict[str, Any]:
    """JSON without the NaN and Infinity that other readers refuse."""

    def refuse(word: str) -> None:
        raise ValueError(f"{word} is not JSON")

    return json.loads(text, parse_constant=refuse)


# --- one whole run ----------------------------------------------------------------------------------------------------


@pytest.fixture(scope="module")
def traj3(tmp_path_factory: pytest.TempPathFactory) -> tuple[Answer, Path]:
    folder = tmp_path_factory.mktemp("traj3")
    answer = command(
        "+experiment=traj3",
        "seed=7",
        *FEW_STARTS,
        "parallel.workers=1",
        f"hydra.run.dir={folder}/results",
        folder=folder,
    )
    return answer, folder / "results"


@pytest.mark.slow
class TestTraj3:
    def test_a_singular_baseline_is_no_failure(self, traj3: tuple[Answer, Path]) -> None:
        answer, folder = traj3
        assert answer.code == 0, answer.error
        assert answer.error == ""
        assert "singular" in answer.out
        assert str(folder) in answer.out

    def test_every_file_of_the_contract(self, traj3: tuple[Answer, Path]) -> None:
        _, folder = traj3
        assert {file.name for file in folder.iterdir()} == RUN_FILES
        pictures = {file.stem: file for file in (folder / "figures").iterdir()}
        assert set(FIGURES) <= set(pictures)
        for picture in pictures.values():
            assert picture.read_bytes().startswith(b"\x89PNG")
        assert {file.name for file in (folder / ".hydra").iterdir()} >= {"config.yaml", "overrides.yaml"}
        assert [file.name for file in folder.parent.iterdir()] == ["results"]

    def test_summary(self, traj3: tuple[Answer, Path]) -> None:
        table = pd.read_csv(traj3[1] / "summary.csv")
        columns = ["method", "optimum", "status", "kinetic_energy_integral", "torque_integral", "max_tracking_error"]
        columns += [f"peak_{name}_{j}" for name in ("velocity", "torque", "power") for j in (1, 2, 3)]
        columns += ["min_singular_value", "wall_time_s", "published_kinetic_energy_integral", "published_singular_time"]
        assert set(columns) <= set(table.columns)
        assert list(table["method"][:3]) == ["lsv", "pmke", "global"]
        assert list(table["status"][:3]) == ["singular", "solved", "solved"]
        rows = table[table["optimum"] == 1].set_index("method")
        assert rows["singular_time"]["lsv"] == pytest.approx(6.5, abs=0.1)
        assert rows["published_singular_time"]["lsv"] == 6.5
        assert rows["kinetic_energy_integral"]["global"] == pytest.approx(6.09e-3, rel=5e-3)
        assert rows["kinetic_energy_integral"]["pmke"] <= 1.01 * 7.57e-3
        assert rows["max_tracking_error"]["global"] <= 1e-8
        text = (traj3[1] / "summary.md").read_text(encoding="utf-8")
        for words in ("printed 0.00757", "printed 0.00609", "singular at t = 6.4", "seed 7"):
            assert words in text

    def test_the_summary_is_that_of_the_trajectories(self, traj3: tuple[Answer, Path]) -> None:
        """From the two files and the arm alone."""
        table = pd.read_csv(traj3[1] / "summary.csv").set_index(["method", "optimum"])
        motions = pd.read_parquet(traj3[1] / "trajectories.parquet")
        names = [f"{name}_{j}" for name in ("q", "qd", "qdd", "tau") for j in (1, 2, 3)]
        assert list(motions.columns) == ["method", "optimum", "time", *names, "x", "y", "z"]
        problem = prepared("+experiment=traj3")
        arm = problem.task.arm
        assert set(motions.groupby(["method", "optimum"]).groups) == set(table.index)
        for key, part in motions.groupby(["method", "optimum"]):
            time, q = part["time"].to_numpy(), part[["q_1", "q_2", "q_3"]].to_numpy()
            qd, tau = part[["qd_1", "qd_2", "qd_3"]].to_numpy(), part[["tau_1", "tau_2", "tau_3"]].to_numpy()
            step = np.diff(time)
            np.testing.assert_allclose(np.diff(q, axis=0) / step[:, None], qd[1:], atol=1e-9)
            energy = arm.kinetic_energy(q[1:], qd[1:]) @ step
            row = table.loc[key]
            assert energy == pytest.approx(row["kinetic_energy_integral"], rel=1e-9)
            assert (tau[1:] ** 2).sum(axis=1) @ step == pytest.approx(row["torque_integral"], rel=1e-9)
            np.testing.assert_allclose(arm.position(q), part[["x", "y", "z"]], atol=1e-12)
            gap = np.linalg.norm(part[["x", "y"]].to_numpy() - problem.reference.position(time), axis=1).max()
            assert gap == pytest.approx(row["max_tracking_error"], abs=1e-12)

    def test_the_recording_holds_the_same_motions(self, traj3: tuple[Answer, Path]) -> None:
        motions = pd.read_parquet(traj3[1] / "trajectories.parquet")
        for (method, optimum), part in motions.groupby(["method", "optimum"]):
            entity = "/" + slug(method if optimum == 1 else f"{method} {optimum}")
            time, q = read_series(traj3[1] / "recording.rrd", f"{entity}/joint_position")
            np.testing.assert_array_equal(q, part[["q_1", "q_2", "q_3"]])
            np.testing.assert_allclose(time, part["time"], atol=1e-9)
            _, tau = read_series(traj3[1] / "recording.rrd", f"{entity}/joint_torque")
            np.testing.assert_array_equal(tau, part[["tau_1", "tau_2", "tau_3"]])

    def test_what_it_was_made_with(self, traj3: tuple[Answer, Path]) -> None:
        facts = strict_json((traj3[1] / "run.json").read_text(encoding="utf-8"))
        assert facts["seed"] == 7
        assert facts["experiment"] == "traj3"
        for package in ("python", "selfmotion", "drake", "numpy", "scipy", "rerun-sdk", "hydra-core"):
            assert facts[package][0].isdigit(), package
        assert {"prepare", "solve", "evaluate", "tables", "figures", "recording"} <= set(facts["stages_s"])
        assert all(seconds >= 0 for seconds in facts["stages_s"].values())
        assert set(facts["methods_s"]) == {"lsv", "pmke", "global"}
        assert 0 < sum(facts["methods_s"].values()) <= facts["stages_s"]["solve"] + 0.01
        assert facts["config"]["timing"]["steps"] == 100
        by_method = {solved["method"]: solved["statistics"] for solved in facts["solutions"] if solved["optimum"] == 1}
        predictions = by_method["pmke"]["predictions"]
        assert len(predictions) == 17
        for entry in predictions:
            assert entry["wall_time_s"] >= entry["solver_time_s"] > 0
            assert entry["converged"]
        assert len(by_method["global"]["starts"]) > 1
        assert all(solve["wall_time_s"] > 0 for solve in by_method["global"]["solves"])


# --- the numbers of the PMKE paper -----------------------------------------------------------------------------------


@functools.cache
def solved(number: int, method: str) -> tuple[Problem, list[Evaluation]]:
    config = configured(f"+experiment=traj{number}", f"methods=[{method}]", *FEW_STARTS, "method.lsv.dt=0.02")
    problem = prepare(config)
    solutions, seconds = solve(problem, config, Context())
    assert seconds[method] > 0
    return problem, [evaluate(problem, solution) for solution in solutions]


@pytest.mark.parametrize(("number", "energy"), [(1, 8.81e-4), (2, 5.37e-3), (4, 5.17e-2)])
def test_lsv(number: int, energy: float) -> None:
    (motion,) = solved(number, "lsv")[1]
    assert motion.status is Status.SOLVED
    assert motion.energy_integral[-1] == pytest.approx(energy, rel=5e-3)


def test_lsv_meets_a_singularity_on_trajectory_3() -> None:
    (motion,) = solved(3, "lsv")[1]
    assert motion.status is Status.SINGULAR
    assert motion.confirmed
    assert motion.solution.event_time == pytest.approx(6.5, abs=0.1)


def test_lsv_peaks() -> None:
    peaks = [np.abs(solved(number, "lsv")[1][0].qd).max(axis=0) for number in (1, 4)]
    assert peaks[0][[0, 2]] == pytest.approx([0.063, 0.197], abs=6e-4)
    assert peaks[1][0] == pytest.approx(0.512, abs=6e-4)


def test_least_spectral_radius_on_trajectory_4() -> None:
    (motion,) = solved(4, "lsv")[1]
    least = int(np.argmin(motion.spectral_radius))
    assert motion.spectral_radius[least] == pytest.approx(0.0998, abs=1e-4)
    assert motion.time[least] == pytest.approx(5.71, abs=0.02)


@pytest.mark.parametrize(("number", "energy"), [(1, 5.98e-4), (2, 4.08e-3), (3, 7.57e-3), (4, 3.97e-2)])
def test_pmke_is_at_most_one_percent_above_the_paper(number: int, energy: float) -> None:
    (motion,) = solved(number, "pmke")[1]
    assert motion.status is Status.SOLVED
    assert motion.energy_integral[-1] <= 1.01 * energy
    # And no better than what is best: that would be another motion or another sum.
    assert motion.energy_integral_spline > 0.99 * solved(number, "global")[1][0].energy_integral_spline


@pytest.mark.parametrize(("number", "energy"), [(1, 5.97e-4), (2, 3.87e-3), (3, 6.09e-3), (4, 3.03e-2)])
def test_global(number: int, energy: float) -> None:
    problem, motions = solved(number, "global")
    assert all(motion.status is Status.SOLVED for motion in motions)
    assert motions[0].energy_integral[-1] == pytest.approx(energy, rel=5e-3)
    for motion in motions:
        assert motion.tracking_error.max() <= 1e-8
        np.testing.assert_allclose(motion.q[0], problem.q_init, atol=1e-9)


# --- failures --------------------------------------------------------------------------------------------------------


@pytest.mark.slow
def test_a_failing_method_fails_the_run_and_leaves_everything(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capfd: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    words = ["+experiment=traj1", "methods=[lsv,global]", "timing.steps=26", "parallel.workers=1", *FEW_STARTS]
    answer = call(monkeypatch, capfd, *words, "method.global.max_iterations=1", "hydra.run.dir=results")
    folder = tmp_path / "results"
    assert answer.code == 1
    assert "Traceback" not in answer.error
    table = pd.read_csv(folder / "summary.csv").set_index("method")
    assert table["status"].to_dict() == {"lsv": "solved", "global": "not converged"}
    assert "iteration" in table["message"]["global"]
    text = (folder / "summary.md").read_text(encoding="utf-8")
    assert f"- **global**: {table['message']['global']}" in text
    assert "not converged" in answer.out
    assert str(table["message"]["global"]) in answer.out
    assert {file.name for file in folder.iterdir()} == RUN_FILES
    assert set(FIGURES) <= {file.stem for file in (folder / "figures").iterdir()}
    facts = strict_json((folder / "run.json").read_text(encoding="utf-8"))
    assert [solved["status"] for solved in facts["solutions"]] == ["solved", "not converged"]


def test_a_motion_that_was_not_found_does_not_cost_nothing(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capfd: pytest.CaptureFixture[str]
) -> None:
    """The arm standing still is no result: 0 J s in the tables would be the best of all."""
    leave_out_pictures(monkeypatch)
    monkeypatch.chdir(tmp_path)
    words = ["+experiment=traj1", "methods=[global]", "timing.steps=13", "parallel.workers=1", *FEW_STARTS]
    call(monkeypatch, capfd, *words, "method.global.max_iterations=1", "hydra.run.dir=results")
    (row,) = pd.read_csv(tmp_path / "results" / "summary.csv").to_dict("records")
    assert row["status"] == "not converged"
    assert row["kinetic_energy_integral"] != 0.0
    assert row.get("difference_kinetic_energy_integral", 0.0) != -1.0


# --- paths, timings, grids -------------------------------------------------------------------------------------------


@pytest.fixture
def points(tmp_path: Path) -> Callable[[Any], Path]:
    def write(rows: Any) -> Path:
        pd.DataFrame(rows, columns=["x", "y"]).to_csv(tmp_path / "points.csv", index=False)
        return tmp_path / "points.csv"

    return write


ROWS = np.array([[0.45, 0.02], [0.40, 0.06], [0.36, 0.05], [0.33, 0.10]])


@pytest.mark.parametrize("relative", [False, True])
def test_way_points(points: Callable[[Any], Path], relative: bool) -> None:
    config = configured(
        "path=waypoints", f"path.file={points(ROWS)}", f"path.relative={str(relative).lower()}", "timing.steps=26"
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


def test_a_path_can_say_where_it_starts() -> None:
    problem = prepared("path.start=[0.40,0.05]", "path.length=0.1")
    moved = problem.task.value(problem.q_init[None])[0]
    np.testing.assert_allclose(moved, [0.40, 0.05], atol=1e-9)
    np.testing.assert_allclose(problem.reference.position(np.zeros(1))[0], [0.40, 0.05], atol=1e-12)
    assert np.abs(problem.q_init - [0.0, 0.327, -0.754]).max() > 1e-2
    assert evaluate(problem, lsv(problem)[0]).status is Status.SOLVED


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
