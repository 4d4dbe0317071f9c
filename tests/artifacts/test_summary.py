from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from pipeline.artifacts import summary as tables
from pipeline.artifacts import sweep
from pipeline.artifacts.report import Report
from pipeline.common.arrays import Array
from pipeline.config.documents import Printed, printed_for
from pipeline.config.run import RunConfig
from pipeline.evaluation.evaluation import Evaluation, evaluate
from pipeline.problem.problem import Problem
from pipeline.problem.solution import Solution, Status, Trajectory
from tests.reports import report_of
from tests.support import ROOT

Make = Callable[[int, int], Problem]
EXPERIMENTS = sorted((ROOT / "conf" / "experiment").glob("*.yaml"))
PRINTED = Printed({"lsv": {"kinetic_energy_integral": 1e-3, "singular_time": 6.5}}, "A paper", "A note.")


@pytest.fixture
def asked(problem: Make) -> Problem:
    return problem(1, 10)


@pytest.fixture
def motions(asked: Problem, guess: Callable[[Problem], Array]) -> list[Evaluation]:
    q = guess(asked)
    own = [
        Solution("lsv", Trajectory(asked.times, q), Status.SINGULAR, "met | one", event_time=6.0),
        Solution("global", Trajectory(asked.times, q), Status.SOLVED, statistics={"starts_in_basin": 4}),
        Solution("global", Trajectory(asked.times, q), Status.SOLVED, optimum=2),
    ]
    return [evaluate(asked, solution) for solution in own]


@pytest.fixture
def report(asked: Problem, motions: list[Evaluation], monkeypatch: pytest.MonkeyPatch) -> Report:
    """Of the experiment `mine`, of which a paper prints two numbers."""
    monkeypatch.setattr(tables, "printed_for", {"mine": PRINTED}.get)
    made = report_of(asked, motions, settings=RunConfig(name="mine"))
    return replace(made, seconds={"lsv": 0.5, "global": 2.5})


@pytest.fixture
def summary(report: Report) -> pd.DataFrame:
    return tables.summary(report)


def test_summary_is_one_row_per_motion(motions: list[Evaluation], summary: pd.DataFrame) -> None:
    assert list(zip(summary["method"], summary["optimum"], strict=True)) == [("lsv", 1), ("global", 1), ("global", 2)]
    assert list(summary["status"]) == ["singular", "solved", "solved"]
    assert list(summary["wall_time_s"]) == [0.5, 2.5, 2.5]
    for row, motion in zip(summary.to_dict("records"), motions, strict=True):
        assert row["kinetic_energy_integral"] == motion.energy_integral[-1]
        assert row["torque_integral"] == motion.torque_integral[-1]
        assert row["max_tracking_error"] == motion.tracking_error.max()
        for j in range(3):
            assert row[f"peak_velocity_{j + 1}"] == np.abs(motion.qd[:, j]).max()
            assert row[f"peak_torque_{j + 1}"] == np.abs(motion.tau[:, j]).max()
            assert row[f"peak_power_{j + 1}"] == np.abs(motion.tau[:, j] * motion.qd[:, j]).max()
        usable = motion.time <= (motion.solution.event_time or np.inf)  # as the figure marks it
        assert row["min_singular_value"] == motion.singular_value[usable].min()
        assert row["min_spectral_radius"] == motion.spectral_radius[usable].min()


def test_printed_values_stand_beside_the_first_optimum_of_their_method(summary: pd.DataFrame) -> None:
    lsv, best, second = summary.to_dict("records")
    assert lsv["published_kinetic_energy_integral"] == 1e-3
    assert lsv["difference_kinetic_energy_integral"] == pytest.approx(lsv["kinetic_energy_integral"] / 1e-3 - 1)
    assert lsv["difference_singular_time"] == pytest.approx(6.0 / 6.5 - 1)
    for row in (best, second):
        assert all(np.isnan(row[key]) for key in row if key.startswith(("published_", "difference_")))


@pytest.mark.parametrize("file", EXPERIMENTS, ids=lambda file: file.stem)
def test_every_printed_number_has_a_column_to_compare_it_with(file: Path, summary: pd.DataFrame) -> None:
    """A misspelt column would silently compare nothing."""
    printed = printed_for(file.stem)
    for method, values in printed.numbers.items():
        assert set(values) <= set(summary.columns), method


def test_trajectories_read_back_as_they_are(
    tmp_path: Path, motions: list[Evaluation], report: Report, summary: pd.DataFrame
) -> None:
    tables.write(report, tmp_path)
    read = pd.read_parquet(tmp_path / "trajectories.parquet")
    kinds = [f"{name}_{j}" for name in ("q", "qd", "qdd", "tau") for j in (1, 2, 3)]
    assert list(read.columns) == ["method", "optimum", "time", *kinds, "x", "y", "z"]
    for (_, part), motion in zip(read.groupby(["method", "optimum"], sort=False), motions, strict=True):
        for name in ("q", "qd", "qdd", "tau"):
            np.testing.assert_array_equal(part[[f"{name}_{j}" for j in (1, 2, 3)]], getattr(motion, name))
        np.testing.assert_array_equal(part[["x", "y", "z"]], motion.position)
        np.testing.assert_array_equal(part["time"], motion.time)
    own, back = (part.astype(object).fillna("") for part in (summary, pd.read_csv(tmp_path / "summary.csv")))
    pd.testing.assert_frame_equal(back, own, check_dtype=False)
    assert (tmp_path / "summary.md").read_text(encoding="utf-8") == tables.text(report)
    assert sorted(file.name for file in tmp_path.iterdir()) == ["summary.csv", "summary.md", "trajectories.parquet"]


def table_rows(text: str) -> list[list[str]]:
    return [[cell.strip() for cell in line.strip("|").split("|")] for line in text.splitlines() if line.startswith("|")]


def test_summary_for_people(motions: list[Evaluation], report: Report) -> None:
    text = tables.text(report)
    beside, details = text.split("## Energies")
    assert [row[:2] for row in table_rows(beside)[2:]] == [
        ["lsv", "singular"],
        ["global", "solved"],
        ["global 2", "solved"],
    ]
    rows = table_rows(details)
    assert rows[0] == ["", "lsv", "global", "global 2"]
    assert {len(row) for row in rows} == {4}
    by_name = {row[0]: row[1:] for row in rows}
    energy = by_name["kinetic energy integral [J s]"]
    value = motions[0].energy_integral[-1]
    assert energy[0] == f"{value:.4g} (printed 0.001, {100 * (value / 1e-3 - 1):+.2g} %)"
    assert energy[1] == f"{value:.4g}"
    assert by_name["singular time [s]"] == ["6 (printed 6.5, -7.7 %)", "", ""]
    assert not any("nan" in cell for row in rows for cell in row)
    assert "- **lsv**: met | one" in text
    assert f"- **global**: {Status.SOLVED.value}" in text
    assert "A paper. A note." in text
    assert text.startswith("# mine\n\n**Best found: global 1: peak acceleration ")
    peaks = " ".join(by_name["joint2"][1].split(" rad/s, ")[0].split())
    assert float(peaks) == pytest.approx(np.abs(motions[1].qd[:, 1]).max(), rel=0.01)


def made(folder: Path, name: str, table: pd.DataFrame) -> None:
    (folder / name).mkdir()
    table.to_csv(folder / name / "summary.csv", index=False)


def test_sweep_is_all_summaries_in_the_order_of_the_jobs(tmp_path: Path, summary: pd.DataFrame) -> None:
    made(tmp_path, "10_second", summary)
    made(tmp_path, "2_first", summary)
    sweep.write_failure(tmp_path / "11_bad", "path.length = -1: must be a number > 0 m")
    (tmp_path / "12_empty").mkdir()
    sweep.write(tmp_path)
    read = pd.read_csv(tmp_path / "sweep.csv")
    assert list(read["run"]) == ["2_first"] * 3 + ["10_second"] * 3 + ["11_bad"]
    bad = read.iloc[-1]
    assert (bad["status"], bad["message"]) == ("bad input", "path.length = -1: must be a number > 0 m")
    lsv = read.iloc[0]
    assert lsv["published_kinetic_energy_integral"] == 1e-3
    assert lsv["kinetic_energy_integral"] == pytest.approx(summary["kinetic_energy_integral"][0], rel=1e-12)
    rows = table_rows((tmp_path / "sweep.md").read_text(encoding="utf-8"))
    by_run = {(row[0], row[1]): row for row in rows[2:]}
    assert by_run["10_second", "global 2"][3] == f"{summary['kinetic_energy_integral'][2]:.4g}"
    assert by_run["2_first", "lsv"][4] == "0.001"
    assert by_run["11_bad", ""][2:] == ["bad input", *[""] * 6, "path.length = -1: must be a number > 0 m"]


def test_a_bar_in_a_message_does_not_break_a_table(tmp_path: Path, summary: pd.DataFrame) -> None:
    made(tmp_path, "0_run", summary)
    sweep.write(tmp_path)
    lines = [line for line in (tmp_path / "sweep.md").read_text(encoding="utf-8").splitlines() if line.startswith("|")]
    assert {line.replace("\\|", "").count("|") for line in lines} == {lines[0].count("|")}


def test_a_sweep_without_any_summary_writes_nothing(tmp_path: Path) -> None:
    (tmp_path / "0_run").mkdir()
    sweep.write(tmp_path)
    assert [file.name for file in tmp_path.iterdir()] == ["0_run"]


def test_a_printed_zero_or_an_unknown_column_is_no_crash(report: Report, monkeypatch: pytest.MonkeyPatch) -> None:
    values = {"lsv": {"torque_integral": 0.0, "nonsense": 1.0}}
    monkeypatch.setattr(tables, "printed_for", {"mine": Printed(values)}.get)
    with np.errstate(divide="ignore"):
        assert np.isnan(tables.summary(report)["difference_nonsense"][0])
        assert "printed 0" in tables.text(report)
