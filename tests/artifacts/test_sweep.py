"""Sweeps as a user runs them."""

from __future__ import annotations

from pathlib import Path

import pandas as pd
import pytest

from tests.commands import call
from tests.reports import leave_out_pictures

pytestmark = pytest.mark.slow
LSV = {"traj1": 8.81e-4, "traj2": 5.37e-3}


def rows_of(file: Path) -> list[list[str]]:
    lines = file.read_text(encoding="utf-8").splitlines()
    return [[cell.strip() for cell in line.strip("|").split("|")] for line in lines if line.startswith("|")]


def words_of(file: Path) -> pd.DataFrame:
    return pd.read_csv(file).astype(object).fillna("")


def test_a_sweep_leaves_one_table(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capfd: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    answer = call(
        monkeypatch,
        capfd,
        "-m",
        "+experiment=traj1,traj2",
        "methods=[lsv]",
        "method.lsv.dt=0.05",
        f"hydra.sweep.dir={tmp_path}/all",
    )
    assert answer.code == 0, answer.error
    assert answer.error == ""
    assert str(tmp_path / "all" / "sweep.md") in answer.out
    table = pd.read_csv(tmp_path / "all" / "sweep.csv")
    assert list(table["run"]) == ["0_traj1", "1_traj2"]
    assert list(table["method"]) == ["lsv", "lsv"]
    assert list(table["published_kinetic_energy_integral"]) == list(LSV.values())
    assert list(table["kinetic_energy_integral"]) == pytest.approx(list(LSV.values()), rel=5e-3)
    assert table["difference_kinetic_energy_integral"].abs().max() < 5e-3
    head, _, *rows = rows_of(tmp_path / "all" / "sweep.md")
    assert head[0] == "run"
    for (name, printed), row in zip(LSV.items(), rows, strict=True):
        assert row[0].endswith(name)
        assert float(row[head.index("printed")]) == printed
        assert float(row[head.index("kinetic energy [J s]")]) == pytest.approx(printed, rel=5e-3)
    for run in ("0_traj1", "1_traj2"):
        assert (tmp_path / "all" / run / "summary.csv").is_file()
        assert (tmp_path / "all" / run / "recording.rrd").is_file()
        assert (tmp_path / "all" / run / ".hydra" / "config.yaml").is_file()


def test_a_bad_job_is_a_row_and_the_others_go_on(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capfd: pytest.CaptureFixture[str]
) -> None:
    leave_out_pictures(monkeypatch)
    monkeypatch.chdir(tmp_path)
    words = ["-m", "+experiment=traj1", "methods=[lsv]", "path.length=-1,0.1,3.0", f"hydra.sweep.dir={tmp_path}/all"]
    answer = call(monkeypatch, capfd, *words)
    assert answer.code == 2
    errors = answer.error.splitlines()
    assert len(errors) == 2
    assert errors[0].startswith("error: path.length = -1")
    assert errors[1].startswith("error: path: out of reach")
    table = words_of(tmp_path / "all" / "sweep.csv")
    assert list(table["run"]) == ["0_traj1", "1_traj1", "2_traj1"]
    assert list(table["status"]) == ["bad input", "solved", "bad input"]
    assert "must be a number >= 0 m" in table["message"][0]
    assert "out of reach from" in table["message"][2]
    assert table["kinetic_energy_integral"][1] == pytest.approx(8.81e-4, rel=5e-3)
    head, _, *rows = rows_of(tmp_path / "all" / "sweep.md")
    assert [row[head.index("status")] for row in rows] == ["bad input", "solved", "bad input"]
    assert "out of reach from" in rows[2][-1]
    assert not (tmp_path / "all" / "0_traj1" / "trajectories.parquet").exists()
    assert not (tmp_path / "outputs").exists()


@pytest.mark.parametrize(
    ("words", "reason"),
    [
        (["seed=${nothing},1"], "nothing"),  # cannot be resolved
        (["methods=[lsv],[lsv,calculus_of_variations]", "limits=joint"], "calculus_of_variations"),
    ],
    ids=["interpolation", "method"],
)
def test_any_bad_input_of_a_job_is_a_row(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capfd: pytest.CaptureFixture[str], words: list[str], reason: str
) -> None:
    leave_out_pictures(monkeypatch)
    monkeypatch.chdir(tmp_path)
    swept = ["-m", "+experiment=traj1", f"hydra.sweep.dir={tmp_path}/all", "timing.steps=10"]
    swept += [] if words[0].startswith("methods") else ["methods=[lsv]"]
    answer = call(monkeypatch, capfd, *swept, *words)
    assert answer.code == 2
    assert "Traceback" not in answer.error
    table = words_of(tmp_path / "all" / "sweep.csv")
    assert sorted(table["status"]) == ["bad input", "solved"]
    assert table["message"].str.contains(reason).any()


def test_a_job_that_fails_is_a_row_and_the_code_is_one(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capfd: pytest.CaptureFixture[str]
) -> None:
    leave_out_pictures(monkeypatch)
    monkeypatch.chdir(tmp_path)
    drift = "method.lsv.max_drift=1e-12,0.01"
    answer = call(
        monkeypatch, capfd, "-m", "+experiment=traj1", "methods=[lsv]", drift, f"hydra.sweep.dir={tmp_path}/all"
    )
    assert answer.code == 1
    table = words_of(tmp_path / "all" / "sweep.csv")
    assert list(table["status"]) == ["unconfirmed", "solved"]
    assert "off its path" in table["message"][0]


def test_a_bad_word_stops_a_sweep_before_it_begins(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capfd: pytest.CaptureFixture[str]
) -> None:
    leave_out_pictures(monkeypatch)
    monkeypatch.chdir(tmp_path)
    answer = call(monkeypatch, capfd, "-m", "+experiment=traj1,traj9", "methods=[lsv]")
    assert answer.code == 2
    assert len(answer.error.splitlines()) == 1
    assert "traj9" in answer.error
    assert "traj4" in answer.error
