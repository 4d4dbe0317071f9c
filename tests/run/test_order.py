"""What a run does before what: its verdict comes before figures and recording, and before their libraries."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import pytest

from pipeline.artifacts.report import Artifact, Report
from pipeline.run import run
from tests.support import composed

SAID = "import sys, pipeline.run.run; print(sorted({'matplotlib', 'rerun', 'scipy.stats'} & set(sys.modules)))"


def test_the_verdict_is_said_before_anything_is_written(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    said = []

    def writer(artifact: str) -> Artifact:
        def write(report: Report, folder: Path) -> None:
            said.append(capsys.readouterr().out)

        return write

    monkeypatch.setattr(run, "writer", writer)
    run.run(composed("+experiment=traj1", "methods=[inertia_weighted]", "timing.steps=6"), tmp_path)
    assert "inertia_weighted" in said[0]
    assert "energy [J s]" in said[0]
    assert not any(said[1:])
    assert str(tmp_path) in capsys.readouterr().out.replace("\n", "")


@pytest.mark.slow
def test_the_heavy_libraries_are_loaded_by_what_draws() -> None:
    """A process of its own: in this one they are long loaded."""
    folder = str(Path(run.__file__).parents[2])
    done = subprocess.run([sys.executable, "-c", SAID], cwd=folder, capture_output=True, text=True, check=True)
    assert done.stdout.strip() == "[]"
