"""What a sweeper that optimises hears of a run."""

from __future__ import annotations

import json
import math
from pathlib import Path

import pytest
import yaml

from pipeline.run.objective import numbers
from tests.commands import Run
from tests.reports import leave_out_pictures

TABLE = """method,optimum,kinetic_energy_integral,peak_torque_1,peak_torque_2,min_clearance_between
lsv,1,0.5,7,9,
global,1,0.25,3,2,0.01
global,2,0.125,1,1,0.02
"""


def test_the_numbers_of_the_chosen_motion(tmp_path: Path) -> None:
    (tmp_path / "summary.csv").write_text(TABLE)
    (tmp_path / "run.json").write_text(json.dumps({"chosen": {"method": "global", "optimum": 1}}))
    assert numbers(tmp_path, ["kinetic_energy_integral", "peak_torque"], ["minimize"]) == [0.25, 3.0]
    assert numbers(tmp_path, ["min_clearance_between"], ["maximize"]) == [0.01]
    (tmp_path / "run.json").write_text(json.dumps({"chosen": {"method": "lsv", "optimum": 1}}))
    assert numbers(tmp_path, ["min_clearance_between", "peak_torque"], ["maximize", "minimize"]) == [-math.inf, 9.0]


def test_a_run_without_a_motion_is_the_worst(tmp_path: Path) -> None:
    assert numbers(tmp_path, ["peak_torque"], ["minimize"]) == [math.inf]
    (tmp_path / "summary.csv").write_text(TABLE)
    (tmp_path / "run.json").write_text(json.dumps({"chosen": None}))
    assert numbers(tmp_path, ["peak_torque", "wall_time_s"], ["maximize", "minimize"]) == [-math.inf, math.inf]


@pytest.mark.slow
def test_a_sweeper_optimises(run: Run, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Optuna's, over the motion time: its best value is the least of the runs' own; exit codes stay."""
    leave_out_pictures(monkeypatch)
    optuna = [
        "hydra/sweeper=optuna",
        "hydra.sweeper.n_trials=2",
        "hydra.sweeper.n_jobs=1",
        "hydra.sweeper.sampler.seed=1",
    ]
    words = ["methods=[lsv]", "path.length=0.1", "timing.steps=10", "timing.duration=interval(2.0,6.0)"]
    answer = run("-m", *words, *optuna, "sweep.objective=kinetic_energy_integral", "hydra.sweep.dir=found")
    assert answer.code == 0
    best = yaml.safe_load((tmp_path / "found" / "optimization_results.yaml").read_text(encoding="utf-8"))
    runs = sorted((tmp_path / "found").glob("*/run.json"))
    assert len(runs) == 2
    own = [numbers(file.parent, ["kinetic_energy_integral"], [])[0] for file in runs]
    assert best["best_value"] == min(own) < max(own)
    assert (tmp_path / "found" / "sweep.md").is_file()
