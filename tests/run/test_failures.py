"""What an error says: a disk that is full, files of a configuration that hold something else, endless sweeps."""

from __future__ import annotations

import linecache
import resource
from collections.abc import Iterator
from contextlib import contextmanager
from functools import partial
from pathlib import Path

import pytest

from pipeline.common import kept
from pipeline.common.errors import InputError
from pipeline.run.failures import foreseen, leaves, told, where
from pipeline.run.termination import Terminated
from tests.commands import Run, assert_refused, call
from tests.reports import leave_out_pictures

LSV = ("methods=[lsv]", "timing.steps=6", "method.lsv.dt=0.1", "path.length=0.05", "path.tolerance=0.01")


@pytest.fixture
def run(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capfd: pytest.CaptureFixture[str]) -> Run:
    leave_out_pictures(monkeypatch)
    monkeypatch.chdir(tmp_path)
    return partial(call, monkeypatch, capfd)


@contextmanager
def room(size: int) -> Iterator[None]:
    """Within it no file can grow beyond so many bytes: the system answers as it does where the disk is full."""
    _, most = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (size, most))
    try:
        yield
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, (most, most))


@pytest.mark.slow
@pytest.mark.parametrize(("size", "named"), [(2_000, "out"), (9_000, "out/trajectories.parquet")])
def test_a_full_disk_is_one_line_that_says_where(size: int, named: str, run: Run, tmp_path: Path) -> None:
    """By Hydra, whose error has no name, and by an artifact."""
    with room(size):
        answer = run(*LSV, "hydra.run.dir=out")
    assert_refused(answer, f"{tmp_path / named}: ", "File too large" if named == "out" else "")
    assert not (tmp_path / "out" / "run.json").exists()
    assert not [file for file in tmp_path.rglob(".*") if file.name != ".hydra"]
    assert run(*LSV, "hydra.run.dir=out").code == 0
    assert (tmp_path / "out" / "run.json").exists()


FILES = {
    "syntax": (b"path: [1", "not YAML: "),
    "encoding": (b"name: \xff\xfe", "not UTF-8 text: "),
    "depth": (b"a: " + b"[" * 500, "nested too deeply"),
    "itself": (b"a: &x [*x]", "an anchor that holds itself"),
    "twice": (b"name: a\nname: b", "not YAML: "),
    "code": (b"name: !!python/object/apply:os.system ['touch ran']", "not YAML: "),
    "nul": (b"a: \0", "not YAML: "),
    "word": (b"3", "not a table of keys and values: "),
}


@pytest.mark.parametrize("case", FILES)
def test_a_file_of_a_configuration_that_holds_something_else(case: str, run: Run, tmp_path: Path) -> None:
    content, line = FILES[case]
    (tmp_path / "mine" / "experiment").mkdir(parents=True)
    (tmp_path / "mine" / "experiment" / "bad.yaml").write_bytes(content)
    assert_refused(run("--config-dir=mine", "+experiment=bad", "methods=[lsv]"), line)
    assert [file.name for file in tmp_path.iterdir()] == ["mine"]


@pytest.mark.slow
@pytest.mark.parametrize(
    "words",
    [
        ["seed=range(1000000000)"],
        ["seed=shuffle(range(0,1000000))"],
        ["path.length=range(0,1,0)"],
        ["path.length=range(0,1,nan)"],
        ["path.length=range(0,inf)"],
        ["seed=range(200)", "path.length=range(0,1,0.01)"],
    ],
)
def test_a_sweep_without_end_is_refused_before_it_is_made(words: list[str], run: Run, tmp_path: Path) -> None:
    assert_refused(run("-m", *LSV[:3], *words), "runs; a sweep has at most 10000")
    assert not list(tmp_path.rglob("summary.csv"))


def test_what_nobody_foresaw_is_no_bad_input() -> None:
    assert told(RuntimeError("a\n bug")) == ("RuntimeError: a bug", 1)
    assert told(ValueError("ours")) == ("ValueError: ours", 1)
    assert told(KeyboardInterrupt()) == ("interrupted", 130)
    assert told(Terminated())[1] == 143
    assert told(SystemExit("abort\n at a.cc")) == ("Drake: abort at a.cc", 1)


def test_bad_input_is_one_line_whatever_separators_it_cites() -> None:
    """As a header of way-points with the separator of records, found by the fuzz test."""
    for separator in ("\x1e", "\u2028", "\x85", "\n"):
        assert told(InputError(f"the header is a{separator}b")) == ("the header is a b", 2)


def test_who_was_asked_to_leave_has_not_failed() -> None:
    asked = (SystemExit(3), SystemExit(), KeyboardInterrupt(), Terminated())
    assert all(leaves(error) for error in asked)
    assert not any(leaves(error) for error in (SystemExit("abort"), RuntimeError(), MemoryError()))


def test_a_bug_of_ours_keeps_its_traceback_and_its_innermost_line() -> None:
    assert foreseen(MemoryError(), 1)
    assert foreseen(InputError("bad"), 2)
    assert not foreseen(RuntimeError("a bug"), 1)
    with pytest.raises(TypeError) as caught:
        kept.dumps([object()])
    file, _, line = where(caught.value).rpartition(":")
    assert "raise TypeError" in linecache.getline(file, int(line))
