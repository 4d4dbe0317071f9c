"""The map on a running Dask cluster: a scheduler and workers as processes of their own, on the loopback address."""

from __future__ import annotations

import io
import json
import os
import signal
import socket
import subprocess
import sys
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from contextlib import redirect_stdout
from dataclasses import dataclass, field
from itertools import pairwise
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from distributed import Client

from pipeline.build.problem import prepare
from pipeline.common import cluster
from pipeline.common import kept as stored
from pipeline.common.errors import ConfigError
from pipeline.common.workers import Workers
from pipeline.config import run as config
from pipeline.methods.global_planner.planner import global_planner
from pipeline.methods.method import Context
from pipeline.run.run import UNFINISHED
from tests.commands import assert_refused, call
from tests.common.test_workers import SIM1
from tests.killed import run_and_kill
from tests.reports import leave_out_pictures
from tests.support import ROOT
from tests.tasks import (
    HUNG,
    die_at_the_second,
    done_by,
    fail_late,
    first_is_last,
    kept,
    only_the_first,
    threads,
    wait_until,
    work,
)

pytestmark = pytest.mark.slow
NOWHERE = "tcp://127.0.0.1:9"
LOOPBACK = ("--host", "127.0.0.1", "--dashboard-address", "127.0.0.1:0")


@dataclass
class Cluster:
    folder: Path
    address: str = ""
    processes: list[subprocess.Popen[bytes]] = field(default_factory=list)
    said_before_any_worker: str = ""
    refused_before_any_worker: str = ""

    def begin(self, *words: str) -> subprocess.Popen[bytes]:
        environment = {**os.environ, "PYTHONPATH": os.pathsep.join([str(ROOT), str(ROOT / "tests")])}
        for name in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"):
            environment.pop(name, None)
        with (self.folder / f"{len(self.processes)}.log").open("wb") as log:
            command = [sys.executable, "-m", "dask", *words, *LOOPBACK]
            process = subprocess.Popen(command, cwd=self.folder, env=environment, stdout=log, stderr=log)
        self.processes.append(process)
        return process

    def begin_scheduler(self) -> subprocess.Popen[bytes]:
        file = self.folder / "scheduler.json"
        process = self.begin("scheduler", "--port", "0", "--scheduler-file", str(file))
        wait_until(lambda: file.is_file() and file.read_text(encoding="utf-8").endswith("}"))
        self.address = json.loads(file.read_text(encoding="utf-8"))["address"]
        return process

    def begin_worker(self, threads: int = 1) -> subprocess.Popen[bytes]:
        return self.begin("worker", self.address, "--nthreads", str(threads), "--no-nanny")

    def wait_for_workers(self, count: int) -> None:
        with Client(self.address, set_as_default=False) as client:
            client.wait_for_workers(count, timeout=HUNG)

    def end(self) -> None:
        for process in reversed(self.processes):
            process.kill()
            process.wait()


@pytest.fixture(scope="module")
def two_workers(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Cluster]:
    started = Cluster(tmp_path_factory.mktemp("cluster"))
    try:
        started.begin_scheduler()
        with redirect_stdout(io.StringIO()) as said:
            Workers(address=started.address).check()
        started.said_before_any_worker = said.getvalue()
        with pytest.raises(ConfigError) as refused, redirect_stdout(io.StringIO()):
            Workers(address=started.address, wait=0.05).map(work, started.folder, [1.0])
        started.refused_before_any_worker = str(refused.value)
        started.begin_worker()
        started.begin_worker(threads=2)
        started.wait_for_workers(2)
        yield started
    finally:
        started.end()


@pytest.fixture
def own_cluster(tmp_path: Path) -> Iterator[Cluster]:
    started = Cluster(tmp_path)
    try:
        started.begin_scheduler()
        yield started
    finally:
        started.end()


def test_results_and_progress_come_in_the_order_of_the_items(two_workers: Cluster, tmp_path: Path) -> None:
    said: list[tuple[int, float]] = []
    items = [float(item) for item in range(9)]
    results = Workers(address=two_workers.address).map(first_is_last, tmp_path, items, lambda *step: said.append(step))
    assert results == [item / 3 for item in items]
    assert said == list(enumerate(results, start=1))
    assert [item for item, _ in done_by(tmp_path, "ended")] == items
    assert len({process for _, process in done_by(tmp_path, "ended")}) == 2


def test_no_items(two_workers: Cluster, tmp_path: Path) -> None:
    assert Workers(address=two_workers.address).map(work, tmp_path, []) == []


def test_an_error_is_itself_and_what_was_finished_is_kept(two_workers: Cluster, tmp_path: Path) -> None:
    workers, items = Workers(store=tmp_path / "store", address=two_workers.address), [2.0, 5.0, 1.0, 4.0]
    with pytest.raises(ZeroDivisionError, match="thirteen"):
        workers.map(fail_late, tmp_path, [*items[:2], 13.0, *items[2:]])
    finished = len(kept(tmp_path / "store"))
    assert finished >= 2
    assert Workers(1, tmp_path / "store").map(fail_late, tmp_path, items) == [item / 3 for item in items]
    here = [item for item, process in done_by(tmp_path, "ended") if process == os.getpid()]
    assert len(here) == len(items) - finished  # what the cluster finished is taken by local workers too


def test_one_solve_at_a_time_on_one_thread(two_workers: Cluster, tmp_path: Path) -> None:
    """Whatever the worker was started with: one of the two has two threads."""
    results = Workers(address=two_workers.address).map(threads, tmp_path, list(range(8)))
    assert {count for count, *_ in results} == {1}
    for process in {process for _, process, _, _ in results}:
        spans = sorted(span for _, worker, *span in results if worker == process)
        assert all(end <= begin for (_, end), (begin, _) in pairwise(spans))


def test_the_planner_gives_the_same_as_here(two_workers: Cluster, tmp_path: Path) -> None:
    asked = config.check(SIM1)
    ways = [Workers(1), Workers(2), Workers(store=tmp_path, address=two_workers.address)]
    solved = [global_planner(prepare(asked), asked.method.global_, Context(1, workers)) for workers in ways]
    assert list(tmp_path.glob("*.result"))
    assert len({len(solutions) for solutions in solved}) == 1
    for one, two, there in zip(*solved, strict=True):
        np.testing.assert_array_equal(one.trajectory.q, two.trajectory.q)
        np.testing.assert_array_equal(one.trajectory.q, there.trajectory.q)


def test_a_killed_worker_loses_nothing(two_workers: Cluster, tmp_path: Path) -> None:
    victim = two_workers.begin_worker()
    two_workers.wait_for_workers(3)
    (tmp_path / "victim").write_text(str(victim.pid), encoding="utf-8")
    items = [float(item) for item in range(20) if item != 13]
    workers = Workers(store=tmp_path / "store", address=two_workers.address)
    assert workers.map(die_at_the_second, tmp_path, items) == [item / 3 for item in items]
    assert victim.wait(HUNG) == -signal.SIGKILL
    begun, ended = (set(done_by(tmp_path, what)) for what in ("begun", "ended"))
    (lost,) = (item for item, process in begun - ended if process == victim.pid)
    assert lost in {item for item, process in ended if process != victim.pid}
    assert len(kept(tmp_path / "store")) == len(items)


def test_a_scheduler_that_goes_away_is_one_line(
    own_cluster: Cluster, tmp_path: Path, capfd: pytest.CaptureFixture[str]
) -> None:
    own_cluster.begin_worker()
    workers = Workers(store=tmp_path / "store", address=own_cluster.address)
    scheduler = own_cluster.processes[0]
    with pytest.raises(ConfigError, match=r"parallel\.address.*went away"):
        workers.map(only_the_first, tmp_path, [0.0, 1.0, 2.0], lambda *_: scheduler.kill())
    assert len(kept(tmp_path / "store")) == 1
    assert capfd.readouterr().err == ""


def test_workers_of_other_versions_are_refused(
    two_workers: Cluster, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(cluster, "stamp", lambda: "selfmotion 99")
    with pytest.raises(ConfigError, match=r"other versions \(source \w+, selfmotion .*selfmotion 99"):
        Workers(address=two_workers.address).map(work, tmp_path, [2.0])


def test_a_cluster_without_workers_says_so_and_is_not_waited_for_without_end(two_workers: Cluster) -> None:
    assert "no workers yet" in two_workers.said_before_any_worker
    there = f"parallel.address = {two_workers.address}"
    assert two_workers.refused_before_any_worker == f"{there}: no worker came within parallel.wait = 0.05 s"


@pytest.mark.parametrize(
    ("words", "named"),
    [
        ([f"parallel.address={NOWHERE}"], NOWHERE),
        (["parallel.address=somewhere"], "somewhere"),
        ([], "not given"),
    ],
    ids=["unreachable", "malformed", "missing"],
)
def test_no_cluster_is_one_line(
    words: list[str], named: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capfd: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(cluster, "TIMEOUT", 2.0)
    answer = call(monkeypatch, capfd, "+experiment=traj1", "methods=[lsv]", "parallel=dask", *words)
    assert_refused(answer, "parallel.address", named)
    assert list(tmp_path.iterdir()) == []


def test_what_never_answers_is_given_up(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(cluster, "TIMEOUT", 0.2)
    with socket.create_server(("127.0.0.1", 0)) as silent, ThreadPoolExecutor(1) as pool:
        address = f"tcp://127.0.0.1:{silent.getsockname()[1]}"
        with pytest.raises(ConfigError, match=f"parallel.address = {address}: no Dask scheduler there"):
            pool.submit(Workers(address=address).check).result(HUNG)


def test_without_dask_one_line_says_how_to_get_it(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "distributed.core", None)
    with pytest.raises(ConfigError, match=r"pip install '\.\[cluster\]'"):
        Workers(address=NOWHERE).check()


def test_a_killed_run_goes_on_elsewhere(
    two_workers: Cluster, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capfd: pytest.CaptureFixture[str]
) -> None:
    """kill -9 of a run on the cluster, started again here: nothing that was finished is solved again."""
    leave_out_pictures(monkeypatch)
    monkeypatch.chdir(tmp_path)  # robots/ is looked for there first: both runs must find the same file
    sizes = ("configurations=4", "candidates=40", "optimised=6")
    words = ["+experiment=sim1", "timing.steps=14", *(f"method.global.{size}" for size in sizes)]
    there, here = ["parallel=dask", f"parallel.address={two_workers.address}"], ["parallel.workers=1"]

    killed, whole = tmp_path / "killed", tmp_path / "whole"
    run_and_kill(killed, 3, *words, *there, f"hydra.run.dir={killed}", cwd=tmp_path)
    finished = [stored.loads(file.read_bytes()) for file in kept(killed / UNFINISHED)]
    assert call(monkeypatch, capfd, *words, *here, f"hydra.run.dir={killed}").code == 0
    assert call(monkeypatch, capfd, *words, *there, f"hydra.run.dir={whole}").code == 0
    tables = [pd.read_parquet(folder / "trajectories.parquet") for folder in (killed, whole)]
    pd.testing.assert_frame_equal(*tables, check_exact=True)
    # Wall times are never twice the same: those of the kept starts are in the final record.
    log = json.loads((killed / "run.json").read_text(encoding="utf-8"))["solutions"][0]["statistics"]
    times = {solve["wall_time_s"] for start in log["starts"] for solve in start["solves"]}
    starts = [optimum for optimum in finished if len(optimum.q) == log["grids"][0] + 1]
    assert len(starts) == 3
    assert {solve["wall_time_s"] for start in starts for solve in start.solves} <= times
