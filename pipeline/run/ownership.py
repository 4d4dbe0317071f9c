"""A result folder has one owner: while a run writes into it, a file `.lock` there names its process and host.

The file is locked by the operating system too, which lets go of it however a process ends: what can be had is stale.
"""

from __future__ import annotations

import fcntl
import json
import os
import socket
from pathlib import Path
from typing import Any

from pipeline.common.errors import OutputError
from pipeline.common.files import sweep_unfinished

LOCK = ".lock"

_held: dict[Path, int] = {}  # the open lock files of this process


def own(folder: Path) -> None:
    """Make `folder` and take it for this process until `release`; raises OutputError if another one has it.

    What a dead owner has left is said, and its half-written files are taken away.
    """
    folder = folder.absolute()
    if folder in _held:
        return
    folder.mkdir(parents=True, exist_ok=True)
    file = folder / LOCK
    lock = _locked(file)
    if lock is None:
        raise OutputError(f"{folder}: in use by {_named(_owner(file))}; wait for its end or choose another folder")
    before, here = _owner(file), socket.gethostname()
    if before and before.get("host") != here:  # not every file system takes locks from one machine to another
        os.close(lock)
        raise OutputError(f"{folder}: in use by {_named(before)}; if that has ended, delete {file}")
    if before:
        print(f"{folder}: taken over from {_named(before)}, which is gone", flush=True)
    os.ftruncate(lock, 0)
    os.pwrite(lock, json.dumps({"process": os.getpid(), "host": here}).encode(), 0)
    _held[folder] = lock
    sweep_unfinished(folder)


def release(folder: Path | None = None) -> None:
    """Give back `folder`, or every folder that this process holds."""
    for mine in list(_held) if folder is None else [folder.absolute()]:
        (mine / LOCK).unlink(missing_ok=True)
        os.close(_held.pop(mine))


def names() -> str:
    """` into` the folders that this process holds, for a message; nothing if it holds none."""
    return f" into {', '.join(map(str, _held))}" if _held else ""


def _locked(file: Path) -> int | None:
    """The lock file, open and locked; None if another process has it."""
    while True:
        lock = os.open(file, os.O_RDWR | os.O_CREAT, 0o644)
        try:
            fcntl.flock(lock, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError:
            os.close(lock)
            return None
        except BaseException:
            os.close(lock)
            raise
        try:
            if os.path.samestat(os.fstat(lock), file.stat()):
                return lock
        except FileNotFoundError:
            pass
        os.close(lock)  # its owner took it away between the two calls


def _owner(file: Path) -> dict[str, Any]:
    try:
        found = json.loads(file.read_text(encoding="utf-8"))
    except (OSError, ValueError):
        return {}
    return found if isinstance(found, dict) else {}


def _named(owner: dict[str, Any]) -> str:
    return f"process {owner.get('process', '?')} on {owner.get('host', '?')}"
