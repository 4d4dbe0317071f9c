"""One run: what it leaves, all methods having done well or one of them having failed."""

from __future__ import annotations

import json
import os
import subprocess
import sys
from dataclasses import asdict
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import pytest

from pipeline.artifacts.recording.blueprint import slug
from pipeline.artifacts.recording.recording import read_series
from pipeline.build.problem import prepare
from pipeline.run import run as run_module
from tests.commands import Answer, call, command
from tests.once import made_once
from tests.reports import leave_out_pictures
from tests.support import FEW_STARTS, ROOT, RUN_FILES, composed

FIGURES = ("stroboscopic", "joints", "energy", "torques")


def strict_json(text: str) -> dict[str, Any]:
    """JSON without the NaN and Infinity that other readers refuse."""

    def refuse(word: str) -> None:
        raise ValueError(f"{word} is not JSON")

    return json.loads(text, parse_constant=refuse)


# --- one whole run ----------------------------------------------------------------------------------------------------


def run_traj3(folder: Path) -> None:
    words = ("+experiment=traj3", "seed=7", *FEW_STARTS, "parallel.workers=1", f"hydra.run.dir={folder}/own/results")
    words += ("path.tolerance=1e-3",)  # PMKE drifts by 0.7 mm: what is sent, since the optimum jumps to its speed
    (folder / "own").mkdir()
    (folder / "answer.json").write_text(json.dumps(asdict(command(*words, folder=folder / "own"))), encoding="utf-8")


@pytest.fixture(scope="session")
def traj3(tmp_path_factory: pytest.TempPathFactory) -> tuple[Answer, Path]:
    folder = made_once(tmp_path_factory, "traj3", run_traj3)
    return Answer(**json.loads((folder / "answer.json").read_text(encoding="utf-8"))), folder / "own" / "results"


@pytest.mark.slow
class TestTraj3:
    def test_a_singular_baseline_is_no_failure(self, traj3: tuple[Answer, Path]) -> None:
        answer, folder = traj3
        assert answer.code == 0, answer.error
        assert answer.error == ""
        assert "singular" in answer.out
        assert "error [m]" in answer.out  # units are no markup
        assert answer.out.index("Send pmke 1: ") < answer.out.index("Exported: pmke 1 at 100 Hz")
        assert str(folder) in answer.out

    def test_every_file_of_the_contract(self, traj3: tuple[Answer, Path]) -> None:
        _, folder = traj3
        assert {file.name for file in folder.iterdir()} == RUN_FILES
        exported = strict_json((folder / "run.json").read_text(encoding="utf-8"))["export"]
        assert (exported["method"], exported["faults"]) == ("pmke", [])
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
        problem = prepare(composed("+experiment=traj3"))
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


def test_the_verdict_comes_before_what_is_drawn(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capfd: pytest.CaptureFixture[str]
) -> None:
    def full(*_: object) -> None:
        raise OSError(28, "No space left on device", "summary.md")

    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(run_module, "write", full)
    words = ("methods=[lsv]", "timing.steps=4", "method.lsv.dt=0.5", "path.length=0.05", "export.method=none")
    answer = call(monkeypatch, capfd, *words, "hydra.run.dir=results")
    assert (answer.code, answer.error) == (2, "error: cannot read or write summary.md: No space left on device\n")
    assert "lsv" in answer.out
    assert "results in" not in answer.out


@pytest.mark.slow
def test_nobody_waits_for_what_draws_and_records(tmp_path: Path) -> None:
    heavy = "{'matplotlib', 'rerun', 'scipy.stats', 'casadi'}"
    asked = f"import sys; import pipeline.run.run; sys.exit(len({heavy} & {{*sys.modules}}))"
    environment = {**os.environ, "PYTHONPATH": str(ROOT)}
    assert subprocess.run([sys.executable, "-c", asked], cwd=tmp_path, env=environment, check=False).returncode == 0


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
