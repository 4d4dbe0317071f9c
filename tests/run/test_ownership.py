"""A result folder has one owner."""

from __future__ import annotations

import fcntl
import json
import os
import shlex
import signal
import socket
import subprocess
import sys
from functools import partial
from pathlib import Path

import pytest

from pipeline.common.errors import OutputError
from pipeline.run import ownership
from tests.commands import Run, assert_refused, call
from tests.reports import leave_out_pictures
from tests.support import ROOT

LSV = ("methods=[lsv]", "timing.steps=10", "method.lsv.dt=0.05")
HOLD = """
import sys
from pathlib import Path
from pipeline.run import ownership
ownership.own(Path(sys.argv[1]))
print("held", flush=True)
input()
"""


@pytest.fixture
def run(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capfd: pytest.CaptureFixture[str]) -> Run:
    leave_out_pictures(monkeypatch)
    monkeypatch.chdir(tmp_path)
    return partial(call, monkeypatch, capfd)


def holder(folder: Path) -> subprocess.Popen[str]:
    """Another process that holds `folder` until it is killed or its input ends."""
    environment = {**os.environ, "PYTHONPATH": str(ROOT)}
    line = [sys.executable, "-c", HOLD, str(folder)]
    made = subprocess.Popen(line, env=environment, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True)
    assert made.stdout is not None
    assert made.stdout.readline() == "held\n"
    return made


def left(folder: Path) -> set[str]:
    return {str(file.relative_to(folder)) for file in folder.rglob("*")}


@pytest.mark.slow
def test_a_folder_in_use_is_refused_and_untouched_and_that_of_a_dead_process_is_taken_over(
    run: Run, tmp_path: Path
) -> None:
    other = holder(tmp_path / "out")
    before = left(tmp_path)
    assert_refused(run(*LSV, "hydra.run.dir=out"), "in use by process", str(other.pid), socket.gethostname())
    assert left(tmp_path) == before
    assert run("-m", *LSV, "seed=1,2", "hydra.sweep.dir=out").code == 2
    other.send_signal(signal.SIGKILL)
    other.communicate()
    (tmp_path / "out" / f".{other.pid}.summary.csv").write_text("half", encoding="utf-8")
    answer = run(*LSV, "hydra.run.dir=out")
    assert answer.code == 0
    assert f"taken over from process {other.pid}" in answer.out
    assert not [name for name in left(tmp_path) if Path(name).name.startswith(".") and name != "out/.hydra"]


def test_the_lock_of_another_machine_is_not_taken(tmp_path: Path) -> None:
    (tmp_path / ownership.LOCK).write_text(json.dumps({"process": 1, "host": "elsewhere"}), encoding="utf-8")
    with pytest.raises(OutputError, match=r"process 1 on elsewhere; if that has ended, delete .*\.lock"):
        ownership.own(tmp_path)


@pytest.mark.parametrize("content", ["", "{", "[1]", "\x00"])
def test_a_lock_without_a_name_is_taken(content: str, tmp_path: Path) -> None:
    (tmp_path / ownership.LOCK).write_text(content, encoding="utf-8")
    ownership.own(tmp_path)
    ownership.own(tmp_path)  # it is ours already
    ownership.release()
    assert left(tmp_path) == set()


@pytest.mark.slow
def test_the_results_of_another_configuration_are_not_lost(run: Run, tmp_path: Path) -> None:
    assert run(*LSV, "hydra.run.dir=out").code == 0
    record = (tmp_path / "out" / "run.json").read_bytes()
    assert_refused(run(*LSV, "seed=2", "hydra.run.dir=out"), "holds the finished run of another configuration")
    assert (tmp_path / "out" / "run.json").read_bytes() == record
    assert run(*LSV, "parallel.workers=1", "hydra.run.dir=out").code == 0


@pytest.mark.slow
def test_runs_of_one_second_have_folders_of_their_own(run: Run, tmp_path: Path) -> None:
    for _ in range(3):
        assert run(*LSV).code == 0
    assert len(list((tmp_path / "outputs" / "run").iterdir())) == 3


REFUSED = {
    "no folder": (["hydra.run.dir="], ["hydra.run.dir: empty"]),
    "no folder of a sweep": (["-m", "seed=1,2", "hydra.sweep.dir="], ["hydra.sweep.dir: empty"]),
    "one folder for all": (["-m", "seed=1,2", "hydra.sweep.subdir=a"], ["hydra.sweep.subdir = a", "two runs"]),
    "up": (["name=../x"], ["name = '../x'", "must be a name"]),
    "dots": (["name=.."], ["name = '..'", "must be a name"]),
    "up in a sweep": (["-m", "name=a,../../x"], ["name = ../../x", "must be a name"]),
    "table": (['name="a|b"'], ["name = 'a|b'"]),
    "markup": (['robot.name="<b>"'], ["robot.name = '<b>'"]),
    "flag": (["--swep"], ["unrecognized arguments: --swep", "--help"]),
    "bytes": (["name=a\udcff"], ["not UTF-8 text"]),
    "lines": (['name="a\nb"'], ["name = ", "must be a name"]),
}


@pytest.mark.parametrize("case", REFUSED)
def test_what_cannot_be_a_place_is_refused(case: str, run: Run, tmp_path: Path) -> None:
    words, named = REFUSED[case]
    answer = run(*words, *LSV)
    assert_refused(answer, *named)
    assert not [name for name in left(tmp_path) if "summary" in name or ".lock" in name]


@pytest.mark.slow
def test_a_sweep_whose_runs_turn_out_to_share_a_folder(run: Run, tmp_path: Path) -> None:
    answer = run("-m", *LSV, "seed=1,2", "hydra.sweep.dir=all", "hydra.sweep.subdir=${name}")
    assert_refused(answer, "two runs of the sweep share it", "hydra.sweep.subdir")


def test_how_to_write_what_hydra_reads_in_quotes_only(run: Run, tmp_path: Path) -> None:
    (tmp_path / "arm ö.urdf").write_bytes((ROOT / "robots" / "planar3r.urdf").read_bytes())
    assert_refused(run(*LSV, "robot.urdf=arm ö.urdf"), "'robot.urdf=\"arm ö.urdf\"'")
    assert run(*LSV, 'robot.urdf="arm ö.urdf"', "robot.q_init=[0,0.327,-0.754]").code == 0
    (record,) = tmp_path.rglob("run.json")
    assert json.loads(record.read_text(encoding="utf-8"))["robot"] == "arm_ö"  # not planar3r, whose option stands there


def test_what_is_told_to_be_written_is_what_a_shell_passes_on(run: Run) -> None:
    """A value with both kinds of quotes, ended within the outer ones by the shell's own rules."""
    answer = run(*LSV, 'robot.urdf=it\'s "ö".urdf')
    told = answer.error.partition("in quotes: ")[2].strip()
    assert shlex.split(told) == ['robot.urdf="it\'s \\"ö\\".urdf"']
    assert_refused(run(*LSV, *shlex.split(told)), 'it\'s "ö".urdf', "no such file")


@pytest.mark.parametrize("replaced", [False, True])
def test_a_lock_file_that_its_owner_takes_away_meanwhile_is_opened_anew(
    replaced: bool, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    flock, file = fcntl.flock, tmp_path / ownership.LOCK

    def late(lock: int, how: int) -> None:
        monkeypatch.setattr(fcntl, "flock", flock)
        file.unlink()
        if replaced:
            file.touch()
        flock(lock, how)

    monkeypatch.setattr(fcntl, "flock", late)
    ownership.own(tmp_path)
    try:
        assert json.loads(file.read_text(encoding="utf-8"))["process"] == os.getpid()
    finally:
        ownership.release()
