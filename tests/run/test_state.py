"""The problem of a run is prepared once, and never from an earlier state of its files."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import pytest

from pipeline.config.run import RunConfig
from pipeline.problem.problem import Problem
from pipeline.run import state
from tests.commands import call
from tests.reports import leave_out_pictures
from tests.support import composed

SMALL = ("methods=[lsv]", "timing.duration=1", "timing.steps=10", "path.length=0.1", "parallel.workers=1")


@pytest.fixture
def prepared(monkeypatch: pytest.MonkeyPatch) -> list[RunConfig]:
    """The configurations that problems are prepared of, as it happens."""
    asked: list[RunConfig] = []
    prepare: Callable[[RunConfig], Problem] = state.prepare

    def counted(config: RunConfig) -> Problem:
        asked.append(config)
        return prepare(config)

    monkeypatch.setattr(state, "prepare", counted)
    monkeypatch.setattr(state, "_kept", [])
    return asked


@pytest.mark.slow
def test_a_run_prepares_its_problem_once(
    prepared: list[RunConfig], tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capfd: pytest.CaptureFixture[str]
) -> None:
    """And every run of a sweep its own."""
    leave_out_pictures(monkeypatch)
    monkeypatch.chdir(tmp_path)
    assert call(monkeypatch, capfd, *SMALL, "hydra.run.dir=one").code == 0
    assert len(prepared) == 1
    assert call(monkeypatch, capfd, "-m", *SMALL, "seed=1,2", "hydra.sweep.dir=all").code == 0
    assert [config.seed for config in prepared] == [1, 1, 2]


def test_what_was_kept_is_used_once_and_for_its_configuration_only(prepared: list[RunConfig]) -> None:
    config, other = composed(*SMALL), composed(*SMALL, "path.length=0.15")
    state.keep(config)
    first = state.state(composed(*SMALL))
    assert len(prepared) == 1
    assert state.state(config) is not first  # its files may be others by now
    state.keep(config)
    assert state.state(other).reference.geometry.length == 0.15
    assert state.state(config) is not first
    assert len(prepared) == 5
