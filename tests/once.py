"""Folders that are made once for all test processes that run side by side."""

from __future__ import annotations

import os
from collections.abc import Callable
from pathlib import Path

import pytest

from tests.tasks import wait_until


def made_once(factory: pytest.TempPathFactory, name: str, make: Callable[[Path], object]) -> Path:
    """The folder `name`, filled by `make`: the first process that needs it makes it, the others wait."""
    own = factory.getbasetemp()
    folder = (own.parent if "PYTEST_XDIST_WORKER" in os.environ else own) / name
    made, failed = folder / "made", folder / "failed"
    try:
        folder.mkdir()
    except FileExistsError:
        wait_until(lambda: made.exists() or failed.exists())
    else:
        try:
            make(folder)
            made.touch()
        finally:
            if not made.exists():
                failed.touch()
    assert made.exists(), f"{name} failed in another process"
    return folder
