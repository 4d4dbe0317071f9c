"""A floating base in what a run leaves: tables, figures, recording, and a front of its rotation against energy."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from rerun.chunk import RrdReader
from scipy.spatial.transform import Rotation

from pipeline.artifacts.recording.recording import read_series
from pipeline.artifacts.scene import box, corners
from pipeline.build.problem import prepare
from pipeline.evaluation.base import BaseMotion
from pipeline.run.run import run
from tests.once import made_once
from tests.reports import leave_out_pictures
from tests.support import FEW_STARTS, composed

SMALL = (
    "method.global.refine_to=null",
    "method.global.starts=population",
    *FEW_STARTS,
    "timing.steps=20",
    "method.global.optimised=2",
    "method.pmke.prediction_step=1",
    "method.pmke.update_interval=1",
)


def run_small(folder: Path) -> None:
    assert run(composed("+experiment=floating3r", *SMALL, "parallel.workers=1"), folder / "results") == 0


@pytest.fixture(scope="session")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return made_once(tmp_path_factory, "floating", run_small) / "results"


@pytest.mark.slow
def test_summary(folder: Path) -> None:
    table = pd.read_csv(folder / "summary.csv").set_index(["method", "optimum"])
    assert {"lsv", "inertia_weighted", "pmke", "global"} == set(table.index.get_level_values(0))
    assert (table[["linear_momentum_residual", "angular_momentum_residual"]] < 1e-6).all(axis=None)
    assert (table["max_floating_path_error"] < 0.02).all()
    assert (table["max_base_turn"] >= table["final_base_turn"]).all()
    assert (table["base_rotation_integral"] > 0).all()
    assert "peak_reaction_force" not in table
    text = (folder / "summary.md").read_text(encoding="utf-8")
    assert "base free" in text
    assert "| max floating path error [m] |" in text


@pytest.mark.slow
def test_trajectories_hold_the_base(folder: Path) -> None:
    table = pd.read_parquet(folder / "trajectories.parquet")
    summary = pd.read_csv(folder / "summary.csv").set_index(["method", "optimum"])
    assert [name for name in table if name.startswith("q_")] == ["q_1", "q_2", "q_3"]
    for key, part in table.groupby(["method", "optimum"]):
        start, end = part.iloc[0], part.iloc[-1]
        shift = np.linalg.norm([end[f"base_{a}"] - start[f"base_{a}"] for a in "xyz"])
        # The summary integrates the base from the joints: PMKE's own base, in steps of its controller, drifts from it.
        assert shift == pytest.approx(summary.loc[key, "final_base_shift"], rel=0.01)
        assert abs(end["base_rz"]) == pytest.approx(summary.loc[key, "final_base_turn"], abs=1e-3)
        if key[0] == "pmke":
            assert abs(abs(end["base_rz"]) - summary.loc[key, "final_base_turn"]) > 1e-4


@pytest.mark.slow
def test_the_base_moves_in_the_recording(folder: Path) -> None:
    table = pd.read_parquet(folder / "trajectories.parquet").query("method == 'lsv'")
    chunks = (
        RrdReader(folder / "recording.rrd").stream().filter(content="/lsv/tf/base", has_timeline="time").to_chunks()
    )
    (batch,) = [chunk.to_record_batch() for chunk in chunks]
    name = next(name for name in batch.schema.names if name.endswith(":translation"))
    moved = batch[name].flatten().flatten().to_numpy(zero_copy_only=False).reshape(-1, 3)
    np.testing.assert_allclose(moved, table[["base_x", "base_y", "base_z"]].to_numpy(), atol=1e-6)
    _, turn = read_series(folder / "recording.rrd", "/lsv/base_turn")
    np.testing.assert_allclose(turn[:, 0], np.abs(table["base_rz"]), atol=1e-6)


@pytest.mark.slow
def test_figures(folder: Path) -> None:
    assert (folder / "figures" / "base.png").stat().st_size > 10_000


def test_the_box_has_the_mass_and_inertia() -> None:
    mass, edges = 60.0, np.array([0.8, 0.6, 0.4])
    moments = mass * (np.sum(edges**2) - edges**2) / 12
    words = ("robot=panda", "path.direction=[0,1,0]", "base=free", f"base.mass={mass}", "base.com=[0,0,-0.2]")
    problem = prepare(composed(*words, f"base.inertia={moments.tolist()}"))
    shape = box(problem.task.arm)
    seen = np.abs(Rotation.from_rotvec(shape.rotation).apply(np.diag(shape.size))).sum(axis=0)
    np.testing.assert_allclose(seen, edges, rtol=1e-9)
    still = BaseMotion(np.zeros((1, 3)), np.eye(3)[None], np.zeros(1), None, {}, None)
    placed = corners(problem.task.arm, still)[0]
    np.testing.assert_allclose(placed.min(axis=0), [-0.4, -0.3, -0.4], atol=1e-9)
    np.testing.assert_allclose(placed.max(axis=0), [0.4, 0.3, 0.0], atol=1e-9)


@pytest.mark.slow
def test_front_of_rotation_against_energy(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """The trade that the PMKE paper names: none of its points dominated, each bound met."""
    leave_out_pictures(monkeypatch)
    words = (
        *FEW_STARTS,
        "method.global.refine_to=null",
        "method.global.starts=population",
        "timing.steps=10",
        "method.global.optimised=2",
        "method.pareto.steps=3",
        "method.pareto.rounds=1",
        "method.pareto.max_iterations=60",
    )
    assert run(composed("+experiment=floating_front", *words, "parallel.workers=1"), tmp_path) == 0
    front = pd.read_csv(tmp_path / "front.csv")
    good = front[front["status"] == "optimal"]
    assert len(good) >= 5
    assert good["kinetic_energy"].is_monotonic_increasing
    assert good["base_rotation"].is_monotonic_decreasing
    assert front["bound_excess"].max() < 1e-6
    assert good["base_rotation"].iloc[-1] < 1e-3 * good["base_rotation"].iloc[0]
