"""A recording as a file that is whole or not there, and that leaves no thread behind."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import rerun as rr
from rerun.chunk import RrdReader

from pipeline.artifacts.recording.arm import strict
from pipeline.common.files import write_beside


def record(file: Path, name: str, layout: Any, fill: Callable[[Any], None]) -> None:
    """Write the recording `file` (.rrd) with the blueprint `layout` of what `fill` logs, or raise and leave nothing.

    A viewer keeps one layout for all recordings of a `name`, that of the first that it opens.
    """

    def write(unfinished: Path) -> None:
        _stream(unfinished, name, layout, fill)
        # Rerun keeps every stream and its threads until it is told that nobody has it any more.
        rr.bindings.flush_and_cleanup_orphaned_recordings()
        RrdReader(unfinished).store()  # raises without the footer: a disk that is full at the very end goes unreported

    write_beside(file, write)


def _stream(file: Path, name: str, layout: Any, fill: Callable[[Any], None]) -> None:
    log, streams = layout._log_to_stream, []

    def remember(stream: Any) -> None:
        streams.append(stream)
        log(stream)

    # Rerun makes a stream of its own for the blueprint, which holds itself alive until it is disconnected.
    layout._log_to_stream = remember
    try:
        with strict(), rr.RecordingStream(f"selfmotion {name}") as recording:
            recording.save(file, default_blueprint=layout)
            fill(recording)
    finally:
        del layout._log_to_stream
        for stream in streams:
            stream.disconnect()
