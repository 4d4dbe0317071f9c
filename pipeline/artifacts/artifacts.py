"""What a run leaves in its folder, in the order in which it is written."""

from __future__ import annotations

from importlib import import_module

from pipeline.artifacts.report import Artifact

# Modules of this package. The recording opens with a figure, and run.json comes last: it says that a run is finished.
ARTIFACTS = ("summary", "figures.figures", "motion_files", "recording.recording", "record")


def writer(artifact: str) -> Artifact:
    """What writes it, loaded only now: figures and recordings bring the heaviest libraries of all."""
    write: Artifact = import_module(f"{__package__}.{artifact}").write
    return write


def name(artifact: str) -> str:
    """What it is called, such as `figures`."""
    return artifact.partition(".")[0]
