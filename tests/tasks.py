"""What the tests give to workers, here and elsewhere; a call leaves a file. Workers import this: it imports little."""

from __future__ import annotations

import os
import signal
import time
import uuid
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

HUNG = 1800.0  # [s]: whatever a test waits for comes much sooner, on a busy machine too


def wait_until(ready: Callable[[], bool], pause: float = 0.01) -> None:
    until = time.monotonic() + HUNG
    while not ready():
        if time.monotonic() > until:
            raise TimeoutError(f"waited {HUNG:g} s in vain")
        time.sleep(pause)


@dataclass(frozen=True)
class Context:
    folder: Path
    factor: float = 1.0


def multiply(context: Context, item: float) -> float:
    (context.folder / f"{item!r}.{uuid.uuid4().hex}.call").touch()
    return context.factor * item


def calls(folder: Path) -> list[float]:
    return sorted(float(file.name.rsplit(".", 2)[0]) for file in folder.glob("*.call"))


def kept(store: Path) -> list[Path]:
    """What is finished there: a hidden file is one that was begun."""
    return sorted(store.glob("[!.]*.result"))


def in_pairs(context: Context, item: float) -> float:
    """An even item is ready after the odd one that follows it: this needs two workers."""
    if item % 2 == 0:
        wait_until(lambda: item + 1 in calls(context.folder))
    return multiply(context, item)


def nothing(context: Context, item: float) -> None:
    multiply(context, item)


def fail_at_three(context: Context, item: float) -> float:
    if item == 3 and not (context.folder / "mended").exists():
        raise RuntimeError("three")
    return multiply(context, item)


# --- on a cluster: a file when it begins and another when it ends, with the process that did it -----------------------


def done_by(folder: Path, what: str) -> list[tuple[float, int]]:
    parts = [file.name.split(".") for file in folder.glob(f"*.{what}")]
    return sorted((float(item), int(process)) for item, process, _ in parts)


def work(folder: Path, item: float) -> float:
    (folder / f"{item:g}.{os.getpid()}.begun").touch()
    if item == 13:
        raise ZeroDivisionError("thirteen")
    (folder / f"{item:g}.{os.getpid()}.ended").touch()
    return item / 3


def first_is_last(folder: Path, item: float) -> float:
    """Item 0 is ready only after one that another worker did."""
    if item == 0:
        wait_until(lambda: len(done_by(folder, "ended")) > 0)
    return work(folder, item)


def fail_late(folder: Path, item: float) -> float:
    """Item 13 fails once two others are kept in the folder's store."""
    if item == 13:
        wait_until(lambda: len(kept(folder / "store")) >= 2)
    return work(folder, item)


def only_the_first(folder: Path, item: float) -> float:
    """Whatever follows item 0 goes on until its worker is ended."""
    if item != 0:
        wait_until(lambda: False)
    return work(folder, item)


def die_at_the_second(folder: Path, item: float) -> float:
    """The process named in the file `victim` ends at its second item, by SIGKILL; the others begin after that."""
    own, death = os.getpid(), folder / "death"
    if int((folder / "victim").read_text(encoding="utf-8")) != own:
        wait_until(death.exists)
    elif own in {process for _, process in done_by(folder, "ended")}:
        (folder / f"{item:g}.{own}.begun").touch()
        death.touch()
        os.kill(own, signal.SIGKILL)
    return work(folder, item)


def threads(folder: Path, item: int) -> tuple[int, int, float, float]:
    """The number of threads that libraries may use, the process, and when it began and ended.

    The pause gives others time to come in between: on a busy machine they may not, and less is seen.
    """
    import numpy as np
    from threadpoolctl import threadpool_info

    begin = time.monotonic()
    np.linalg.inv(np.eye(200))
    time.sleep(0.05)
    return max(pool["num_threads"] for pool in threadpool_info()), os.getpid(), begin, time.monotonic()


def die_once(context: Context, item: float) -> float:
    """Item 3 ends its process by SIGKILL, as the system does for want of memory; the second time only if it must."""
    if item == 3 and ((context.folder / "always").exists() or not (context.folder / "died").exists()):
        (context.folder / "died").touch()
        os.kill(os.getpid(), signal.SIGKILL)
    return multiply(context, item)
