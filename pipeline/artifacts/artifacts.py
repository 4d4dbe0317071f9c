"""What a run leaves in its folder, in the order in which it is written."""

from __future__ import annotations

from pipeline.artifacts import motion_files, record, summary
from pipeline.artifacts.figures import figures
from pipeline.artifacts.recording import recording
from pipeline.artifacts.report import Artifact

# The recording opens with a figure, and run.json comes last: it says that a run is finished.
ARTIFACTS: tuple[Artifact, ...] = (
    summary.write,
    figures.write,
    motion_files.write,
    recording.write,
    record.write,
)


def name(artifact: Artifact) -> str:
    """What it is called: its module below this package, such as `figures`."""
    return artifact.__module__.removeprefix(f"{__package__}.").partition(".")[0]
