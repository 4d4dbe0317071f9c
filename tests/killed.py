"""The command line, killed as by `kill -9` in the midst of a write: python -m tests.killed FOLDER COUNT WORDS...

COUNT results are kept below a folder of that name before; of the next one half is written. Nothing is drawn.
"""

from __future__ import annotations

import os
import signal
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

from pipeline.common import workers
from pipeline.common.files import write_beside
from pipeline.run.main import run_job
from tests.plain import job
from tests.support import ROOT


def run_and_kill(folder: Path, count: int, *words: str, cwd: Path) -> None:
    """The same from a test: returns when it is dead."""
    environment = {**os.environ, "PYTHONPATH": str(ROOT), "OMP_NUM_THREADS": "1"}
    line = [sys.executable, "-m", "tests.killed", folder.name, str(count), *words]
    done = subprocess.run(line, cwd=cwd, env=environment, stdout=subprocess.DEVNULL, check=False)
    assert done.returncode == -signal.SIGKILL


def _die(unfinished: Path) -> None:
    unfinished.write_bytes(b"half")
    os.kill(os.getpid(), signal.SIGKILL)


def _write_until(folder: str, count: int) -> Callable[[Path, Callable[[Path], Any]], None]:
    written: list[Path] = []

    def write(file: Path, make: Callable[[Path], Any]) -> None:
        write_beside(file, _die if len(written) == count else make)
        written.extend([file] if folder in file.parts else [])

    return write


if __name__ == "__main__":
    name, number, *sys.argv[1:] = sys.argv[1:]
    workers.write_beside = _write_until(name, int(number))
    sys.exit(run_job(job))
