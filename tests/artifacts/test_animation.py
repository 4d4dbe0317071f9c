"""The film of a run."""

from __future__ import annotations

import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from pipeline.artifacts import animation
from pipeline.config.run import ArtifactsConfig
from tests.reports import report_of, three_motions


@pytest.mark.slow
def test_the_film_moves(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(animation, "PER_SECOND", 3)  # six frames
    monkeypatch.setattr(animation, "DPI", 40)
    report = three_motions()
    asked = replace(report.motions.config, artifacts=ArtifactsConfig(animation="gif"))
    made = report_of(report.motions.problem, report.motions.evaluations, settings=asked)
    animation.write(made, tmp_path)
    with Image.open(tmp_path / "animation.gif") as film:
        frames = []
        for number in range(getattr(film, "n_frames", 1)):
            film.seek(number)
            frames.append(np.asarray(film.convert("RGB")).astype(int))
    assert len(frames) == 6
    assert (np.abs(frames[0] - frames[-1]).max(axis=2) > 60).sum() > 20
    assert len({frame.tobytes() for frame in frames}) >= 5  # as many as there are knots


def test_none_is_made_that_nobody_asked_for(tmp_path: Path) -> None:
    animation.write(three_motions(), tmp_path)
    assert list(tmp_path.iterdir()) == []


def test_the_program_that_makes_a_film(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    """The system's, else the one that a package brings."""
    monkeypatch.setattr(animation.shutil, "which", lambda _: "/somewhere/ffmpeg")
    assert animation.ffmpeg() == "/somewhere/ffmpeg"
    monkeypatch.setattr(animation.shutil, "which", lambda _: None)
    assert Path(str(animation.ffmpeg())).is_file()
    monkeypatch.setitem(sys.modules, "imageio_ffmpeg", None)
    assert animation.ffmpeg() is None
