"""One map over workers: order, progress, resume. The functions leave a file per call, so that calls can be counted."""

from __future__ import annotations

import json
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from pipeline.build.problem import prepare
from pipeline.common import kept as stored
from pipeline.common import versions
from pipeline.common import workers as workers_module
from pipeline.common.errors import WorkerError
from pipeline.common.workers import Workers
from pipeline.config import run as config
from pipeline.methods import method
from pipeline.methods.global_planner.planner import global_planner
from pipeline.problem.solution import Status
from pipeline.run.run import UNFINISHED
from tests.commands import call
from tests.killed import run_and_kill
from tests.support import RUN_FILES
from tests.tasks import Context, calls, die_once, fail_at_three, in_pairs, kept, multiply, nothing


@pytest.mark.parametrize("count", [1, 2, 8])
def test_results_and_progress_come_in_the_order_of_the_items(tmp_path: Path, count: int) -> None:
    said: list[tuple[int, float]] = []
    items = [0.0, 1.0, 2.0, 3.0]
    function = multiply if count == 1 else in_pairs
    results = Workers(count).map(function, Context(tmp_path, 2.0), items, lambda *step: said.append(step))
    assert results == [0.0, 2.0, 4.0, 6.0]
    assert said == [(1, 0.0), (2, 2.0), (3, 4.0), (4, 6.0)]
    assert calls(tmp_path) == items


@pytest.mark.parametrize("count", [1, 2, None])
def test_no_items_no_calls(tmp_path: Path, count: int | None) -> None:
    assert Workers(count, tmp_path / "store").map(multiply, Context(tmp_path), []) == []
    assert calls(tmp_path) == []


@pytest.mark.slow
@pytest.mark.parametrize("count", [1, 2])
def test_a_second_map_takes_what_is_kept(tmp_path: Path, count: int) -> None:
    workers, context = Workers(count, tmp_path / "store"), Context(tmp_path, 3.0)
    assert workers.map(multiply, context, [1.0, 2.0]) == [3.0, 6.0]
    said: list[tuple[int, float]] = []
    assert workers.map(multiply, context, [2.0, 5.0, 1.0], lambda *step: said.append(step)) == [6.0, 15.0, 3.0]
    assert calls(tmp_path) == [1.0, 2.0, 5.0]
    assert said == [(1, 6.0), (2, 15.0), (3, 3.0)]  # what is kept counts as done


def test_without_a_store_nothing_is_kept(tmp_path: Path) -> None:
    for _ in range(2):
        Workers(1).map(multiply, Context(tmp_path), [1.0])
    assert calls(tmp_path) == [1.0, 1.0]


@pytest.mark.parametrize("change", ["function", "context", "item", "store", "versions"])
def test_other_work_is_done_again(tmp_path: Path, change: str, monkeypatch: pytest.MonkeyPatch) -> None:
    context = Context(tmp_path)
    Workers(1, tmp_path / "store").map(multiply, context, [1.0])
    function = fail_at_three if change == "function" else multiply
    context = Context(tmp_path, 2.0) if change == "context" else context
    item = 1.0 + 1e-15 if change == "item" else 1.0
    store = tmp_path / ("other" if change == "store" else "store")
    if change == "versions":
        monkeypatch.setattr(workers_module, "stamp", lambda: "selfmotion 99")
    assert Workers(1, store).map(function, context, [item]) == [context.factor * item]
    assert len(calls(tmp_path)) == 2


def test_a_result_that_is_nothing_is_kept_too(tmp_path: Path) -> None:
    workers = Workers(1, tmp_path / "store")
    for _ in range(2):
        assert workers.map(nothing, Context(tmp_path), [1.0]) == [None]
    assert calls(tmp_path) == [1.0]


@pytest.mark.slow
@pytest.mark.parametrize("count", [1, 2])
def test_what_was_finished_before_an_error_is_kept(tmp_path: Path, count: int) -> None:
    workers, context = Workers(count, tmp_path / "store"), Context(tmp_path)
    with pytest.raises(RuntimeError, match="three"):
        workers.map(fail_at_three, context, [1.0, 2.0, 3.0, 4.0])
    before = calls(tmp_path)
    assert before[:2] == [1.0, 2.0]
    (tmp_path / "mended").touch()
    assert workers.map(fail_at_three, context, [1.0, 2.0, 3.0, 4.0]) == [1.0, 2.0, 3.0, 4.0]
    assert calls(tmp_path)[:2] == [1.0, 2.0]  # not called again


def spoilt(content: bytes, how: str) -> bytes:
    if how == "empty":
        return b""
    if how == "truncated":
        return content[: len(content) // 2]
    if how == "foreign":
        return b"something else\n" * 10
    at = content.index(np.float64(7.5).tobytes())  # one bit within the numbers: still a good array
    return content[:at] + bytes([content[at] ^ 1]) + content[at + 1 :]


def row(context: Context, item: float) -> np.ndarray:
    multiply(context, item)
    return np.full(4, 1.5 * item)


@pytest.mark.parametrize("how", ["empty", "truncated", "foreign", "one bit"])
def test_a_spoilt_store_is_not_trusted(tmp_path: Path, how: str) -> None:
    """What cannot be read, or is not what was written, is computed again: neither a crash nor another number."""
    workers, context = Workers(1, tmp_path / "store"), Context(tmp_path)
    workers.map(row, context, [5.0])
    (file,) = (tmp_path / "store").iterdir()
    file.write_bytes(spoilt(file.read_bytes(), how))
    (again,) = workers.map(row, context, [5.0])
    np.testing.assert_array_equal(again, np.full(4, 7.5))
    assert len(calls(tmp_path)) == 2
    (third,) = workers.map(row, context, [5.0])  # and it is whole again
    np.testing.assert_array_equal(third, np.full(4, 7.5))
    assert len(calls(tmp_path)) == 2


def test_an_unfinished_file_is_no_result(tmp_path: Path) -> None:
    workers, context = Workers(1, tmp_path / "store"), Context(tmp_path)
    workers.map(multiply, context, [5.0])
    (file,) = (tmp_path / "store").iterdir()
    file.rename(file.with_name(f".123.{file.name}"))
    workers.map(multiply, context, [5.0])
    assert len(calls(tmp_path)) == 2


# Solves that are spread over workers: those of IPOPT, from the paper's starts.
ALONE = {"starts": "population", "solver": "ipopt", "coarse_steps": 12}
SIM1 = {
    "boundary": {"kind": "free"},
    "path": {"kind": "line", "length": 0.4},
    "timing": {"duration": 1.0, "steps": 26},
    "method": {"global": {"configurations": 4, "candidates": 40, "optimised": 6, **ALONE}},
}


@pytest.mark.slow
@pytest.mark.parametrize("store", [False, True])
def test_the_planner_gives_the_same_with_one_worker_and_two(tmp_path: Path, store: bool) -> None:
    asked = config.check(SIM1)
    problem = prepare(asked)
    solved = [
        global_planner(
            problem, asked.method.global_, method.Context(1, Workers(count, tmp_path / str(count) if store else None))
        )
        for count in (1, 2)
    ]
    assert len(solved[0]) == len(solved[1])
    for one, two in zip(*solved, strict=True):
        np.testing.assert_array_equal(one.trajectory.q, two.trajectory.q)
        assert one.statistics["starts_in_basin"] == two.statistics["starts_in_basin"]


def test_the_planner_starts_from_what_is_kept(tmp_path: Path) -> None:
    """Also from another process's files: keys do not depend on what this one has done with its objects."""
    asked = config.check(SIM1)
    workers = Workers(1, tmp_path)
    first = global_planner(prepare(asked), asked.method.global_, method.Context(1, workers))
    kept = {file: file.stat().st_mtime_ns for file in tmp_path.iterdir()}
    problem = prepare(asked)
    problem.task.arm.mass_matrix(np.zeros((20, 3)))  # has built its plants
    second = global_planner(problem, asked.method.global_, method.Context(1, workers))
    assert {file: file.stat().st_mtime_ns for file in tmp_path.iterdir()} == kept
    np.testing.assert_array_equal(first[0].trajectory.q, second[0].trajectory.q)


@pytest.mark.slow
def test_a_killed_run_goes_on(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capfd: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)  # robots/ is looked for there first: both runs must find the same file
    words = [
        *("+experiment=sim1", "timing.steps=26", "parallel.workers=1"),
        *(f"method.global.{key}" for key in ("configurations=4", "candidates=40", "optimised=6")),
    ]

    killed = tmp_path / "killed"
    run_and_kill(killed, 3, *words, f"hydra.run.dir={killed}", cwd=tmp_path)
    finished = [stored.loads(file.read_bytes()) for file in kept(killed / UNFINISHED)]
    assert not list(killed.glob("*.csv"))
    assert not list(killed.glob("*.parquet"))
    assert not list(killed.glob("*.rrd"))

    assert call(monkeypatch, capfd, *words, f"hydra.run.dir={killed}").code == 0
    assert not (killed / UNFINISHED).exists()
    assert {file.name for file in killed.iterdir()} == RUN_FILES
    # The same as without the interruption.
    undisturbed = config.check(SIM1)
    whole = global_planner(prepare(undisturbed), undisturbed.method.global_)
    motions = pd.read_parquet(killed / "trajectories.parquet").groupby("optimum")
    assert len(motions) == len(whole)
    for (_, part), solution in zip(motions, whole, strict=True):
        np.testing.assert_array_equal(part[["q_1", "q_2", "q_3"]], solution.trajectory.q)
    # The finished starts were not solved again: their wall times, never twice the same, are in the final record.
    log = json.loads((killed / "run.json").read_text(encoding="utf-8"))["solutions"][0]["statistics"]["starts"]
    times = {solve["wall_time_s"] for start in log for solve in start["solves"]}
    assert len(finished) == 3 < len(log)
    for optimum in finished:
        payload = optimum if hasattr(optimum, "solves") else optimum[-1]
        assert {solve["wall_time_s"] for solve in payload.solves} <= times


@pytest.mark.slow
def test_a_killed_worker_process_is_replaced_once(tmp_path: Path) -> None:
    """What was finished is not done again; what kills its process every time is one line."""
    workers = Workers(2, tmp_path / "store")
    assert workers.map(die_once, Context(tmp_path), [1.0, 2.0, 3.0]) == [1.0, 2.0, 3.0]
    (tmp_path / "always").touch()
    with pytest.raises(WorkerError, match=r"^parallel\.workers = 2: .*killed twice"):
        workers.map(die_once, Context(tmp_path, 2.0), [3.0, 4.0])


@dataclass(frozen=True)
class Unsure:
    final: bool


def unsure(context: Context, item: float) -> Unsure:
    multiply(context, item)
    return Unsure(final=False)


def test_what_a_clock_has_stopped_is_not_kept(tmp_path: Path) -> None:
    for _ in range(2):
        Workers(1, tmp_path / "store").map(unsure, Context(tmp_path), [1.0])
    assert calls(tmp_path) == [1.0, 1.0]


def test_a_solve_that_met_its_max_time_is_stopped_and_never_kept(tmp_path: Path) -> None:
    solver = {"configurations": 2, "candidates": 20, "optimised": 1, **ALONE}
    asked = config.check({**SIM1, "method": {"global": {**solver, "max_time": 1e-9}}})
    (solution,) = global_planner(prepare(asked), asked.method.global_, method.Context(1, Workers(1, tmp_path)))
    assert solution.status is Status.NOT_CONVERGED
    assert "stopped at max_time" in str(solution.statistics)
    assert list(tmp_path.iterdir()) == []


def test_other_source_is_other_work(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(versions, "source", lambda: "another")
    assert "source another" in versions.stamp.__wrapped__()
    assert versions.versions()["source"] == "another"


def test_a_worker_of_a_pool_that_was_started_again_takes_what_is_kept(tmp_path: Path) -> None:
    for _ in range(2):
        assert workers_module._in_a_worker(multiply, Context(tmp_path, 2.0), 4.0, tmp_path / "four.result") == 8.0
    assert calls(tmp_path) == [4.0]
