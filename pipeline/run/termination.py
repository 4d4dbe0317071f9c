"""SIGTERM ends a run within two seconds, with exit code 143 and everything that is finished kept."""

from __future__ import annotations

import os
import signal
import sys
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from types import FrameType

CODE = 128 + signal.SIGTERM
SOON = 0.02  # [s] until it is tried again, where it cannot be raised
GRACE = 1.0  # [s] to leave in order; workers leave by themselves when this process is gone


class Terminated(BaseException):
    """Somebody has asked the process to end."""


@contextmanager
def terminable() -> Iterator[None]:
    """Within it, SIGTERM raises Terminated in the main thread, and ends the process where that takes too long."""
    if threading.current_thread() is not threading.main_thread():
        yield
        return

    def leave(number: int, frame: FrameType | None) -> None:
        signal.signal(signal.SIGTERM, signal.SIG_IGN)  # once is enough
        last = threading.Timer(GRACE, os._exit, [CODE])
        last.daemon = True
        last.start()
        go(number, frame)

    def go(_: int, frame: FrameType | None) -> None:
        if _loads(frame):
            again()
        else:
            raise Terminated

    def again() -> None:
        signal.signal(signal.SIGALRM, go)
        signal.setitimer(signal.ITIMER_REAL, SOON)

    def unraisable(lost: sys.UnraisableHookArgs) -> None:
        """The interpreter drops what is raised in a finaliser or in a weak reference's callback."""
        if issubclass(lost.exc_type, Terminated):
            again()
        else:
            drop(lost)

    drop, sys.unraisablehook = sys.unraisablehook, unraisable
    before = signal.signal(signal.SIGTERM, leave)
    try:
        yield
    except Exception:
        insist()
        raise
    finally:
        sys.unraisablehook = drop
        if signal.getsignal(signal.SIGTERM) is leave:
            signal.signal(signal.SIGTERM, before)
        signal.setitimer(signal.ITIMER_REAL, 0.0)


def insist() -> None:
    """Raise Terminated again where a library has made another error of it: compiled modules do, while they load."""
    if signal.getsignal(signal.SIGTERM) is signal.SIG_IGN:
        raise Terminated from None


def _loads(frame: FrameType | None) -> bool:
    """Whether a compiled module is being loaded: what is raised there it prints, and makes an ImportError of."""
    while frame is not None:
        if frame.f_code.co_name == "create_module" and "importlib" in frame.f_code.co_filename:
            return True
        frame = frame.f_back
    return False
