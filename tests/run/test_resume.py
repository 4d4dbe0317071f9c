"""Sweeps that are started again, that fail in part, and that run through Hydra's launchers."""

from __future__ import annotations

import shutil
from collections.abc import Callable
from functools import partial
from pathlib import Path

import pandas as pd
import pytest
from joblib import Parallel, cpu_count, delayed, parallel_config

from pipeline.common import versions
from pipeline.common.workers import Workers
from pipeline.config.run import RunConfig
from pipeline.problem.problem import Problem
from pipeline.run import resume
from pipeline.run import run as run_module
from tests.commands import Answer, call, command
from tests.killed import run_and_kill
from tests.reports import leave_out_pictures
from tests.support import composed
from tests.tasks import kept

Sweep = Callable[..., Answer]
LSV = (
    *("-m", "name=traj1", "methods=[lsv]", "timing.steps=10", "method.lsv.dt=0.05", "path=line"),
    *("export.method=none", "hydra.sweep.dir=all"),
)


@pytest.fixture(scope="module")
def finished(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The folder of a sweep over two lengths. Tests go on in a copy of it."""
    folder = tmp_path_factory.mktemp("finished")
    with pytest.MonkeyPatch.context() as patch:
        leave_out_pictures(patch)
        patch.chdir(folder)
        assert call(patch, None, *LSV, "path.length=0.1,0.15").code == 0
    return folder / "all"


@pytest.fixture
def sweep(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capfd: pytest.CaptureFixture[str]) -> Sweep:
    """A sweep into the folder `all`, within this process."""
    leave_out_pictures(monkeypatch)
    monkeypatch.chdir(tmp_path)
    return partial(call, monkeypatch, capfd, *LSV)


@pytest.fixture
def again(sweep: Sweep, tmp_path: Path, finished: Path) -> Sweep:
    """The same where `path.length=0.1,0.15` is finished."""
    shutil.copytree(finished, tmp_path / "all")
    return sweep


def skipped(answer: Answer) -> list[str]:
    return [line.split(":")[0] for line in answer.out.splitlines() if "skipped" in line]


def table(folder: Path) -> pd.DataFrame:
    return pd.read_csv(folder / "all" / "sweep.csv")


@pytest.mark.slow
def test_what_is_finished_is_skipped_and_stays_in_the_table(again: Sweep, tmp_path: Path) -> None:
    made = (tmp_path / "all" / "sweep.csv").read_bytes()
    answer = again("path.length=0.1,0.15", "parallel.workers=2")  # how it is computed changes no result
    assert (answer.code, skipped(answer)) == (0, ["0_traj1", "1_traj1"])
    assert (tmp_path / "all" / "sweep.csv").read_bytes() == made
    assert list(table(tmp_path)["path.length"]) == [0.1, 0.15]
    (tmp_path / "all" / "0_traj1" / "run.json").unlink()  # killed before the end
    assert skipped(again("path.length=0.1,0.15")) == ["1_traj1"]
    assert skipped(again("path.length=0.1", "sweep.resume=false")) == []


@pytest.mark.slow
@pytest.mark.parametrize("change", ["value", "version", "record", "objective"])
def test_what_would_be_another_run_is_run_again(
    change: str, again: Sweep, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    words = ["path.length=0.1"]
    if change == "value":
        words = ["path.length=0.1,0.2"]
    elif change == "version":
        monkeypatch.setattr(versions, "_of", lambda package: "99")
    elif change == "record":
        (tmp_path / "all" / "0_traj1" / "run.json").write_text('{"config": ', encoding="utf-8")
    else:
        words += ["objective=torque"]
    assert skipped(again(*words)) == (["0_traj1"] if change == "value" else [])
    assert len(skipped(again(*words))) == len(table(tmp_path))


@pytest.mark.slow
def test_another_content_of_a_file_is_another_run(sweep: Sweep, tmp_path: Path) -> None:
    words = ["path=waypoints", "path.file=points.csv", "path.relative=true"]
    for middle in (0.05, 0.04):
        (tmp_path / "points.csv").write_text(f"x,y\n0.0,0.0\n0.0,{middle}\n0.0,0.1\n", encoding="utf-8")
        assert skipped(sweep(*words)) == []
    assert skipped(sweep(*words)) == ["0_traj1"]


@pytest.mark.slow
def test_a_run_that_fails_takes_the_finished_one_out_of_its_folder(again: Sweep, tmp_path: Path) -> None:
    assert again("path.length=0.1,3.0").code == 2
    assert list(table(tmp_path)["status"]) == ["solved", "bad input"]
    assert skipped(again("path.length=0.1,0.15")) == ["0_traj1"]
    assert list(table(tmp_path)["status"]) == ["solved", "solved"]


@pytest.mark.slow
def test_a_run_that_is_finished_but_not_confirmed_is_not_made_better_by_skipping(sweep: Sweep) -> None:
    words = ["path.length=0.1", "method.lsv.max_drift=1e-12"]
    assert sweep(*words).code == 1
    answer = sweep(*words)
    assert (answer.code, skipped(answer)) == (1, ["0_traj1"])


@pytest.mark.slow
def test_runs_of_an_earlier_sweep_are_not_in_the_table(again: Sweep, tmp_path: Path) -> None:
    assert again("path.length=0.1").code == 0
    assert list(table(tmp_path)["run"]) == ["0_traj1"]


@pytest.mark.slow
def test_a_run_that_crashes_is_a_row_and_the_others_go_on(
    sweep: Sweep, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    solve = run_module.solve

    def fragile(problem: Problem, config: RunConfig, *more: object) -> object:
        if config.seed == 2:
            raise RuntimeError("a | bug\nin two lines")
        return solve(problem, config, *more)  # type: ignore[arg-type]

    monkeypatch.setattr(run_module, "solve", fragile)
    answer = sweep("path.length=0.1", "seed=2,1")
    assert answer.code == 1
    assert answer.error == "error: 0_traj1: RuntimeError: a | bug in two lines (see error.txt)\n"
    rows = table(tmp_path)
    assert list(rows["status"]) == ["error", "solved"]
    assert list(rows["seed"]) == [2, 1]
    assert rows["message"][0].startswith("RuntimeError: a | bug in two lines")
    assert "in fragile" in (tmp_path / "all" / "0_traj1" / "error.txt").read_text(encoding="utf-8")
    lines = (tmp_path / "all" / "sweep.md").read_text(encoding="utf-8").splitlines()
    assert [line.split(" | ")[1] for line in lines if line.startswith("|") and "_traj1" in line] == ["2", "1"]
    monkeypatch.setattr(run_module, "solve", solve)
    mended = sweep("path.length=0.1", "seed=2,1")
    assert (mended.code, skipped(mended)) == (0, ["1_traj1"])
    assert not (tmp_path / "all" / "0_traj1" / "error.txt").exists()


def test_a_crash_of_a_single_run_is_not_hidden(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capfd: pytest.CaptureFixture[str]
) -> None:
    def crash(*_: object) -> None:
        raise RuntimeError("a bug")

    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(run_module, "solve", crash)
    answer = call(monkeypatch, capfd, *LSV[1:4], "hydra.run.dir=out")
    assert (answer.code, answer.error) == (1, "error: RuntimeError: a bug (see error.txt)\n")
    assert "in crash" in (tmp_path / "out" / "error.txt").read_text(encoding="utf-8")


@pytest.mark.slow
@pytest.mark.parametrize(
    ("error", "code", "line"),
    [
        (SystemExit("Failure at a.cc:1 in F():\n  condition 'x' failed."), 1, "Drake: Failure at a.cc:1 in F(): "),
        (MemoryError(), 1, "out of memory"),
        (RecursionError(), 2, "nested too deeply"),
        (OSError(28, "No space left on device", "run.json"), 2, "run.json: No space left on device"),
        (UnicodeDecodeError("utf-8", b"\xff", 0, 1, "invalid start byte"), 2, "not UTF-8 text"),
    ],
)
def test_what_ends_a_run_is_a_line_and_a_row(
    error: BaseException, code: int, line: str, sweep: Sweep, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    solve = run_module.solve

    def fails(problem: Problem, config: RunConfig, *more: object) -> object:
        if config.seed == 2:
            raise error
        return solve(problem, config, *more)  # type: ignore[arg-type]

    monkeypatch.setattr(run_module, "solve", fails)
    answer = sweep("path.length=0.1", "seed=2,1")
    assert answer.code == code
    assert len(answer.error.splitlines()) == 1
    assert line in answer.error
    rows = table(tmp_path)
    assert list(rows["status"]) == ["error" if code == 1 else "bad input", "solved"]
    assert line in rows["message"][0]


@pytest.mark.slow
def test_a_run_in_a_process_of_a_launcher_does_not_take_all_cores_for_itself() -> None:
    assert Workers(None)._count() == cpu_count()
    with parallel_config(backend="loky"):
        counts = Parallel(n_jobs=2)(delayed(Workers(count)._count)() for count in (None, 3))
    assert counts == [1, 3]


@pytest.mark.slow
@pytest.mark.parametrize(
    "launcher", [("joblib", "hydra.launcher.n_jobs=2"), ("submitit_local", "hydra.launcher.cpus_per_task=1")]
)
def test_launchers(launcher: tuple[str, str], sweep: Sweep, tmp_path: Path) -> None:
    """Runs in other processes: the table and the exit code are made from what they leave."""
    name, option = launcher
    pytest.importorskip(f"hydra_plugins.hydra_{name.removesuffix('_local')}_launcher")
    words = [*LSV, "path.length=0.1,3.0", f"hydra/launcher={name}", option, "parallel.workers=1"]
    answer = command(*words, folder=tmp_path, module="tests.plain")
    assert answer.code == 2, answer
    rows = table(tmp_path)
    assert list(rows["run"]) == ["0_traj1", "1_traj1"]
    assert list(rows["status"]) == ["solved", "bad input"]
    mended = sweep("path.length=0.1,0.2")
    assert (mended.code, skipped(mended)) == (0, ["0_traj1"])
    assert list(table(tmp_path)["path.length"]) == [0.1, 0.2]


@pytest.mark.slow
def test_a_killed_sweep_goes_on(sweep: Sweep, tmp_path: Path) -> None:
    few = [f"method.global.{key}" for key in ("configurations=8", "candidates=60", "optimised=6")]
    more = ["+experiment=sim1", "methods=[global]", "timing.steps=26", *few, "path.length=0.4", "seed=1,2"]
    # The first run is finished, the second at work.
    run_and_kill(Path("1_sim1"), 2, *LSV, *more, "name=sim1", "parallel.workers=1", cwd=tmp_path)
    assert len(kept(tmp_path / "all" / "1_sim1" / run_module.UNFINISHED)) == 2
    record = (tmp_path / "all" / "0_sim1" / "run.json").read_bytes()
    assert not (tmp_path / "all" / "1_sim1" / "run.json").exists()
    answer = sweep(*more, "name=sim1", "parallel.workers=2")
    assert (answer.code, skipped(answer)) == (0, ["0_sim1"])
    assert (tmp_path / "all" / "0_sim1" / "run.json").read_bytes() == record
    assert sweep(*more, "name=sim1", "hydra.sweep.dir=whole").code == 0
    tables = [pd.read_csv(tmp_path / name / "sweep.csv").drop(columns="wall_time_s") for name in ("all", "whole")]
    pd.testing.assert_frame_equal(*tables, check_exact=True)
    assert sorted(set(tables[0]["seed"])) == [1, 2]
    for run in ("0_sim1", "1_sim1"):
        motions = [pd.read_parquet(tmp_path / name / run / "trajectories.parquet") for name in ("all", "whole")]
        pd.testing.assert_frame_equal(*motions, check_exact=True)


SDF = "<sdf version='1.9'><model name='{name}'>{inside}</model></sdf>"
MJCF = "<mujoco><worldbody>{inside}</worldbody></mujoco>"


@pytest.mark.parametrize(
    ("main", "outer", "inner", "plain"),
    [
        (
            "arm.sdf",
            SDF.format(name="arm", inside="<include><uri>model://wrist</uri></include>"),
            SDF.format(name="wrist", inside="<include><uri>parts/hand.sdf</uri></include>"),
            SDF.format(name="hand", inside="<link name='hand'/>"),
        ),
        (
            "arm.xml",
            MJCF.format(inside="<include file='wrist/model.sdf'/>"),
            "<mujocoinclude><include file='parts/hand.sdf'/></mujocoinclude>",
            "<mujocoinclude><body name='hand'/></mujocoinclude>",
        ),
    ],
)
def test_every_file_that_the_robot_is_read_from_counts(
    main: str, outer: str, inner: str, plain: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("GZ_SIM_RESOURCE_PATH", str(tmp_path))
    parts = {main: outer, "wrist/model.sdf": inner, "wrist/parts/hand.sdf": plain}
    for name, text in parts.items():
        (tmp_path / name).parent.mkdir(exist_ok=True)
        (tmp_path / name).write_text(text)
    config = composed(f"robot.urdf={tmp_path / main}")
    before = resume.inputs(config)
    assert set(before) == {"robot.urdf", "robot.urdf: wrist/model.sdf", "robot.urdf: wrist/parts/hand.sdf"}
    (tmp_path / "wrist/parts/hand.sdf").write_text(plain + "<!-- heavier -->")
    after = resume.inputs(config)
    assert {key for key in before if before[key] != after[key]} == {"robot.urdf: wrist/parts/hand.sdf"}


def test_files_of_limits_and_documents_of_an_identification_count(tmp_path: Path) -> None:
    plain = set(resume.inputs(composed()))
    limits = tmp_path / "limits.yaml"
    limits.write_text("joint_limits: {}\n", encoding="utf-8")
    with_limits = resume.inputs(composed(f"limits.file={limits}"))
    assert set(with_limits) - plain == {"limits.file"}
    limits.write_text("joint_limits: {joint1: {}}\n", encoding="utf-8")
    assert resume.inputs(composed(f"limits.file={limits}"))["limits.file"] != with_limits["limits.file"]
    named = resume.inputs(composed("identification.run=true", "identification.documents=[pmke]"))
    assert set(named) - plain == {"conf/reproduction/pmke.yaml"}
