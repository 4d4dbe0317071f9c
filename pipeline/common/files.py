"""Files that are whole or not there."""

from __future__ import annotations

import os
import re
from collections.abc import Callable
from pathlib import Path
from typing import Any

UNFINISHED = re.compile(r"\.\d+\..+")  # the process that writes it, and the name that it will have


def write_beside(file: Path, write: Callable[[Path], Any]) -> None:
    """Let `write` make a file beside `file`, then rename: a killed run leaves no half file under a final name."""
    file.parent.mkdir(parents=True, exist_ok=True)
    unfinished = file.with_name(f".{os.getpid()}.{file.name}")
    try:
        write(unfinished)
        os.replace(unfinished, file)
    except OSError as error:  # a full disk has no name of its own
        raise OSError(error.errno, error.strerror or str(error), str(file)) from error
    finally:
        unfinished.unlink(missing_ok=True)


def sweep_unfinished(folder: Path) -> None:
    """Take away what dead processes left half-written in `folder` and below it; nobody else may be writing there."""
    for place, _, names in os.walk(folder):
        for name in names:
            if UNFINISHED.fullmatch(name):
                Path(place, name).unlink(missing_ok=True)


def shipped(name: str) -> Path:
    """What travels with the package, such as `conf` or `robots/planar3r.urdf`: in it, or beside it in a checkout."""
    package = Path(__file__).resolve().parents[1]
    inside = package / name
    return inside if inside.exists() else package.parent / name
