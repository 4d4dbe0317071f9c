"""Shared by the tests of the command line."""

from __future__ import annotations

from functools import partial
from pathlib import Path

import pytest

from tests.commands import Run, call


@pytest.fixture
def run(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capfd: pytest.CaptureFixture[str]) -> Run:
    """Call the command line in an empty folder; results would go to `outputs/` there."""
    monkeypatch.chdir(tmp_path)
    return partial(call, monkeypatch, capfd)
