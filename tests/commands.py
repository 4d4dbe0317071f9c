"""The command line within this process and as a process of its own, and what a refusal is."""

from __future__ import annotations

import os
import subprocess
import sys
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import pytest
from hydra.core.global_hydra import GlobalHydra

from pipeline.run import main, session
from tests.support import ROOT
from tests.tasks import HUNG


@dataclass(frozen=True)
class Answer:
    code: int
    out: str
    error: str


Run = Callable[..., Answer]


def call(
    monkeypatch: pytest.MonkeyPatch,
    capfd: pytest.CaptureFixture[str] | None,
    *words: str,
    entry: Callable[[], int] = main.main,
) -> Answer:
    """The command line within this process: no imports to wait for. What it prints is lost without `capfd`."""
    monkeypatch.setenv("HYDRA_FULL_ERROR", "0")  # main() sets it; this puts it back
    monkeypatch.setattr(session, "exit_code", 0)
    monkeypatch.setattr(sys, "argv", ["pipeline", *words])
    GlobalHydra.instance().clear()
    if capfd is not None:
        capfd.readouterr()
    try:
        code = entry()
    except SystemExit as leaving:
        code = int(leaving.code or 0)
    finally:
        GlobalHydra.instance().clear()
    return Answer(code, *(capfd.readouterr() if capfd is not None else ("", "")))


def command(*words: str, folder: Path, module: str = "pipeline") -> Answer:
    """The command line as a process of its own, started in `folder`; `module`: tests.plain where nobody looks at the
    pictures.
    """
    environment = {**os.environ, "PYTHONPATH": str(ROOT), "OMP_NUM_THREADS": "1"}
    done = subprocess.run(
        [sys.executable, "-m", module, *words],
        cwd=folder,
        env=environment,
        capture_output=True,
        text=True,
        timeout=HUNG,
        check=False,
    )
    return Answer(done.returncode, done.stdout, done.stderr)


def assert_refused(answer: Answer, *named: str) -> None:
    lines = answer.error.splitlines()
    assert answer.code == 2, answer
    assert len(lines) == 1, answer.error
    assert lines[0].startswith("error: ")
    assert "Traceback" not in answer.error + answer.out
    assert "Error(" not in lines[0]
    for words in named:
        assert words in lines[0], f"{words!r} is missing in: {lines[0]}"
