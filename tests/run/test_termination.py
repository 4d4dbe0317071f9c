"""SIGTERM that a library turns into an error of its own still ends the run with 143."""

from __future__ import annotations

import os
import signal
import time
from collections.abc import Iterator

import pytest

from pipeline.run import termination
from pipeline.run.session import Session
from tests.commands import Run
from tests.endings import SAID


@pytest.fixture
def staying(monkeypatch: pytest.MonkeyPatch) -> Iterator[None]:
    """This process ignores being late, and listens to SIGTERM again afterwards."""
    monkeypatch.setattr(termination, "GRACE", 1e6)
    before = signal.getsignal(signal.SIGTERM)
    yield
    signal.signal(signal.SIGTERM, before)


def test_while_a_compiled_module_loads(staying: None, monkeypatch: pytest.MonkeyPatch, run: Run) -> None:
    def loads(*_: object) -> None:
        try:
            os.kill(os.getpid(), signal.SIGTERM)
            time.sleep(0.01)  # where it arrives at the latest
        except termination.Terminated as error:
            raise ImportError("initialization failed") from error

    monkeypatch.setattr(Session, "check", loads)
    answer = run("methods=[lsv]")
    assert (answer.code, answer.error) == (143, SAID)
