"""What Hydra calls around a run or a sweep: check before anything is written, collect the sweep's table at the end."""

from __future__ import annotations

import sys
import uuid
from pathlib import Path
from typing import TYPE_CHECKING, Any

from hydra.experimental.callback import Callback
from omegaconf import DictConfig

from pipeline.common.errors import InputError

if TYPE_CHECKING:
    from pipeline.config.run import RunConfig

MARK = ".sweep"  # in a run's folder: which start of a sweep it belongs to


exit_code = 0  # of the process: 0 all confirmed, 1 a method failed, 2 bad input


class Session(Callback):
    """Hydra's hooks. Hydra swallows exceptions of a callback, so bad input ends the process here."""

    def __init__(self) -> None:
        self.sweep = ""  # a launcher takes this object along to the processes of its runs

    def on_run_start(self, config: DictConfig, **_: Any) -> None:
        """Refuse bad input before Hydra makes the output folder."""
        from pipeline.config.compose import checked

        try:
            self.check(checked(config))
        except InputError as error:
            print(f"error: {error}", file=sys.stderr)
            raise SystemExit(2) from None

    def check(self, asked: RunConfig) -> None:
        """Raise InputError if the job cannot be done. The problem that is built for this is kept for the run."""
        from pipeline.common.workers import Workers
        from pipeline.run.state import keep
        from pipeline.run.unused import require_motion

        require_motion(asked)
        keep(asked)
        Workers(address=asked.parallel.address).check()

    def on_multirun_start(self, config: DictConfig, **_: Any) -> None:
        self.sweep = uuid.uuid4().hex

    def on_job_start(self, config: DictConfig, **_: Any) -> None:
        """Mark the folders of this sweep: others may lie beside them from an earlier one."""
        if self.sweep:
            (Path(config.hydra.runtime.output_dir) / MARK).write_text(self.sweep, encoding="utf-8")

    def on_multirun_end(self, config: DictConfig, **_: Any) -> None:
        """Put the summaries of all runs of the sweep into one table; the worst of their exit codes is the sweep's."""
        from pipeline.artifacts import sweep

        global exit_code
        exit_code = 1  # if anything below fails
        folder = Path(config.hydra.sweep.dir)
        marks = [file for file in folder.rglob(MARK) if file.read_text(encoding="utf-8") == self.sweep]
        runs = [mark.parent for mark in marks]
        try:
            sweep.write(folder, runs)
        except OSError as error:
            print(f"error: cannot write {error.filename!s}: {error.strerror}", file=sys.stderr)
            raise SystemExit(2) from None
        exit_code = max(map(sweep.exit_code, runs), default=0)
