"""A run that is ended from outside leaves nobody behind and nothing half-written, and a new start ends the same."""

from __future__ import annotations

import os
import re
import signal
import subprocess
import sys
import time
from functools import cache
from pathlib import Path

import pandas as pd
import pytest

from pipeline.run.ownership import LOCK
from pipeline.run.run import UNFINISHED
from tests.commands import call
from tests.reports import leave_out_pictures
from tests.support import ROOT
from tests.tasks import kept, wait_until

pytestmark = pytest.mark.slow

SIZES = ("configurations=8", "candidates=60", "optimised=8", "solver=ipopt", "starts=population", "coarse_steps=12")
PLAN = ("+experiment=sim1", "methods=[global]", "timing.steps=26", *(f"method.global.{size}" for size in SIZES))
FRONT = ("+experiment=pareto", "timing.steps=20", "method.pareto.steps=4", *(f"method.global.{size}" for size in SIZES))
GONE = 2.0  # [s] by when every process has left


def begin(*words: str, cwd: Path) -> subprocess.Popen[str]:
    """The command line, with its workers in a session of its own."""
    environment = {**os.environ, "PYTHONPATH": str(ROOT), "OMP_NUM_THREADS": "1"}
    line = [sys.executable, "-m", "pipeline", *words]
    return subprocess.Popen(
        line,
        cwd=cwd,
        env=environment,
        stdout=subprocess.DEVNULL,
        stderr=subprocess.PIPE,
        text=True,
        start_new_session=True,
    )


def session(leader: int) -> set[int]:
    """The living processes of a session; what waits for its parent to look is dead."""
    found = set()
    for folder in Path("/proc").iterdir():
        if folder.name.isdigit():
            try:
                fields = (folder / "stat").read_text().rpartition(")")[2].split()
            except OSError:
                continue
            if int(fields[3]) == leader and fields[0] not in "ZX":
                found.add(int(folder.name))
    return found


def strays(folder: Path) -> list[str]:
    """Half-written files and locks."""
    return [str(file) for file in folder.rglob(".*") if re.fullmatch(r"\.\d+\..+", file.name) or file.name == LOCK]


@cache
def whole(words: tuple[str, ...], folder: Path) -> pd.DataFrame:
    with pytest.MonkeyPatch.context() as patch:
        leave_out_pictures(patch)
        assert call(patch, None, *words, "parallel.workers=1", f"hydra.run.dir={folder}").code == 0
    return pd.read_parquet(folder / "trajectories.parquet")


@pytest.fixture(scope="module")
def undisturbed(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return tmp_path_factory.mktemp("whole")


@pytest.mark.parametrize("workers", [1, 2])
@pytest.mark.parametrize("how", [signal.SIGKILL, signal.SIGTERM])
@pytest.mark.parametrize("what", ["plan", "front"])
def test_a_run_that_is_ended_goes_on(
    what: str, how: signal.Signals, workers: int, tmp_path: Path, undisturbed: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    words, folder = {"plan": PLAN, "front": FRONT}[what], tmp_path / "run"
    store = folder / UNFINISHED
    running = begin(*words, f"parallel.workers={workers}", f"hydra.run.dir={folder}", cwd=tmp_path)
    wait_until(lambda: len(kept(store)) >= 3 or running.poll() is not None)
    assert running.poll() is None
    running.send_signal(how)
    asked = time.monotonic()
    _, said = running.communicate()
    wait_until(lambda: not session(running.pid))
    assert time.monotonic() - asked < GONE + 28  # on a machine that has much else to do
    if how is signal.SIGTERM:
        assert running.returncode == 143
        assert said == "error: terminated; what is finished is kept, start again to go on\n"
        assert not strays(folder)
    else:
        assert running.returncode == -signal.SIGKILL
    before = {file: file.stat().st_mtime_ns for file in kept(store)}
    assert not (folder / "run.json").exists()

    leave_out_pictures(monkeypatch)
    assert call(monkeypatch, None, *words, f"parallel.workers={workers}", f"hydra.run.dir={folder}").code == 0
    assert len(before) >= 3
    assert not strays(folder)
    assert not store.exists()
    again = pd.read_parquet(folder / "trajectories.parquet")
    pd.testing.assert_frame_equal(again, whole(words, undisturbed / what), check_exact=True)


def test_a_sweep_leaves_no_thread(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Rerun's streams, a run's and its blueprint's, have two threads each until they are told to go."""
    monkeypatch.chdir(tmp_path)
    words = ("-m", "methods=[lsv]", "path.length=0.05", "export.method=none")

    def after(seeds: str) -> int:
        assert call(monkeypatch, None, *words, f"seed={seeds}", f"hydra.sweep.dir=of{len(seeds)}").code == 0
        return len(os.listdir("/proc/self/task"))

    first = after("1,2")
    assert after("3,4,5,6") <= first
