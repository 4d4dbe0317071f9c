"""What a run leaves in its folder, in the order in which it is written."""

from __future__ import annotations

from importlib import import_module
from pathlib import Path

from pipeline.artifacts.report import Report

# Modules of this package. The recording opens with a figure, and run.json comes last: it says that a run is finished.
ARTIFACTS = ("summary", "motion_files", "page.page", "figures.figures", "recording.recording", "animation", "record")


def name(artifact: str) -> str:
    """What it is called, such as `figures`."""
    return artifact.partition(".")[0]


def write(artifact: str, report: Report, folder: Path) -> None:
    """Write it into `folder`. Its module is imported here: nobody waits for a plot library before the verdict."""
    import_module(f"{__package__}.{artifact}").write(report, folder)
