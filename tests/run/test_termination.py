"""SIGTERM leads out of a run once, also through a library's own error, and back to what was there before."""

from __future__ import annotations

import os
import signal
import sys
import time
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from typing import Any
from unittest.mock import Mock

import pytest

from pipeline.run import termination
from pipeline.run.session import Session
from pipeline.run.termination import GRACE, Terminated, terminable
from tests.commands import Run
from tests.endings import SAID


@pytest.fixture(autouse=True)
def before() -> Iterator[object]:
    """The handler that stood before, and stands again."""
    handler = signal.getsignal(signal.SIGTERM)
    yield handler
    signal.signal(signal.SIGTERM, handler)


def test_it_is_raised_once_and_the_end_is_sure(monkeypatch: pytest.MonkeyPatch) -> None:
    timer = Mock()
    monkeypatch.setattr("threading.Timer", timer)
    with pytest.raises(Terminated), terminable():
        signal.raise_signal(signal.SIGTERM)
    assert signal.getsignal(signal.SIGTERM) is signal.SIG_IGN
    timer.assert_called_once_with(GRACE, os._exit, [143])
    timer.return_value.start.assert_called_once_with()


def test_nothing_of_it_stays(before: object) -> None:
    with terminable():
        assert signal.getsignal(signal.SIGTERM) is not before
    assert signal.getsignal(signal.SIGTERM) is before


def test_a_thread_beside_the_main_one_is_left_alone() -> None:
    def within() -> object:
        with terminable():
            return signal.getsignal(signal.SIGTERM)

    with ThreadPoolExecutor(1) as pool:
        assert pool.submit(within).result() is signal.getsignal(signal.SIGTERM)


class Finalised:
    def __del__(self) -> None:
        signal.raise_signal(signal.SIGTERM)


def test_what_a_finaliser_swallows_is_raised_again(staying: None, capsys: pytest.CaptureFixture[str]) -> None:
    before, reached = sys.unraisablehook, []

    def finalise() -> None:
        Finalised()
        time.sleep(10.0)  # where it arrives at the latest
        reached.append("never")

    with pytest.raises(Terminated), terminable():
        finalise()
    assert not reached
    assert capsys.readouterr() == ("", "")
    assert sys.unraisablehook is before


LOADER = """
def create_module():
    signal.raise_signal(signal.SIGTERM)
    reached.append("loaded")
"""


def test_a_compiled_module_is_loaded_to_its_end(staying: None) -> None:
    """What the interpreter's own loader calls is not disturbed; right after it the process is asked to leave."""
    reached: list[str] = []
    loader: dict[str, Any] = {"signal": signal, "reached": reached}
    exec(compile(LOADER, "<frozen importlib._bootstrap_external>", "exec"), loader)

    def load() -> None:
        loader["create_module"]()
        time.sleep(10.0)  # where it arrives at the latest
        reached.append("never")

    with pytest.raises(Terminated), terminable():
        load()
    assert reached == ["loaded"]
    assert signal.getitimer(signal.ITIMER_REAL) == (0.0, 0.0)


@pytest.fixture
def staying(monkeypatch: pytest.MonkeyPatch) -> None:
    """This process ignores being late."""
    monkeypatch.setattr(termination, "GRACE", 1e6)


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
