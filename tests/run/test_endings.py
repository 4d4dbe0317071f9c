"""A run that is ended from outside leaves nobody behind and nothing half-written, and a new start ends the same."""

from __future__ import annotations

import gc
import os
import signal
from functools import cache
from pathlib import Path

import pytest
from omegaconf import DictConfig

from pipeline.model.arm import Arm
from pipeline.run import main
from pipeline.run.run import UNFINISHED
from tests.commands import call
from tests.endings import GONE, SAID, WHAT, assert_same, begin, end, placed, session, strays
from tests.reports import leave_out_pictures
from tests.support import FEW_STARTS
from tests.tasks import kept, wait_until

pytestmark = pytest.mark.slow
BUSY = 28.0  # [s] more, on a machine that has much else to do


@cache
def whole(what: str, folder: Path) -> Path:
    with pytest.MonkeyPatch.context() as patch:
        leave_out_pictures(patch)
        assert call(patch, None, *WHAT[what], "parallel.workers=1", placed(what, folder)).code == 0
    return folder


@pytest.fixture(scope="module")
def undisturbed(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return tmp_path_factory.mktemp("whole")


@pytest.mark.parametrize(
    ("what", "workers"),
    [("front", 1), ("sweep", 2)],  # by SIGKILL: test_resume.py, test_workers.py; all twelve: python -m tests.endings
)
def test_a_run_that_is_ended_goes_on(
    what: str, workers: int, tmp_path: Path, undisturbed: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    folder = tmp_path / "out"
    words = (*WHAT[what], f"parallel.workers={workers}", placed(what, folder))
    at_work = folder / "1_sim1" if what == "sweep" else folder
    store = at_work / UNFINISHED
    running = begin(*words, cwd=tmp_path, module="tests.plain")
    wait_until(lambda: len(kept(store)) >= 3 or running.poll() is not None)
    assert running.poll() is None
    said, took = end(running, signal.SIGTERM)
    assert took < GONE + BUSY
    assert (running.returncode, said) == (143, SAID)
    assert not strays(folder)
    before = {file: file.stat().st_mtime_ns for file in kept(store)}
    assert len(before) >= 3
    assert not (at_work / "run.json").exists()

    leave_out_pictures(monkeypatch)
    assert call(monkeypatch, None, *words).code == 0
    assert not strays(folder)
    assert not store.exists()
    assert_same(folder, whole(what, undisturbed / what))


def test_workers_that_have_no_work_yet_leave_too(tmp_path: Path) -> None:
    running = begin(*WHAT["plan"], "parallel.workers=2", placed("plan", tmp_path / "out"), cwd=tmp_path)
    wait_until(lambda: len(session(running.pid)) >= 3 or running.poll() is not None)
    assert running.poll() is None
    assert end(running, signal.SIGKILL)[1] < GONE + BUSY


def test_a_sweep_leaves_no_thread_and_no_arm(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Rerun's streams, a run's and its blueprint's, have two threads each until they are told to go; a program that
    Drake holds can hold an arm with all its plants; Hydra keeps what every job returns.
    """
    monkeypatch.chdir(tmp_path)
    small = ("path.length=0.05", "timing.steps=12", "timing.duration=2", "path.tolerance=0.01", "export.method=none")
    few = ("method.lsv.dt=0.05", "method.pmke.dt=0.05", "method.pmke.horizon=1", *FEW_STARTS)
    living: list[tuple[int, int, int]] = []

    def watched(values: DictConfig) -> int:
        code = main.job(values)
        gc.collect()
        everything = gc.get_objects()
        arms = sum(type(one) is Arm for one in everything)
        living.append((len(os.listdir("/proc/self/task")), arms, len(everything)))
        return code

    words = ("-m", "methods=[lsv,pmke,global]", *small, *few, "seed=1,2,3", "hydra.sweep.dir=all")
    assert call(monkeypatch, None, *words, entry=lambda: main.run_job(watched)).code == 0
    threads, arms, objects = zip(*living[1:], strict=True)
    assert max(threads) == threads[0]
    assert max(arms) == arms[0]
    assert objects[1] - objects[0] < 500
