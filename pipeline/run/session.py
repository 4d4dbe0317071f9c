"""What Hydra calls around a run or a sweep: check before anything is written, collect the sweep's table at the end."""

from __future__ import annotations

import math
import sys
import uuid
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Any

from hydra.core.override_parser.overrides_parser import OverridesParser
from hydra.core.override_parser.types import ChoiceSweep, Override, RangeSweep
from hydra.core.utils import JobReturn
from hydra.experimental.callback import Callback
from omegaconf import DictConfig, OmegaConf

from pipeline.common.errors import ConfigError, OutputError
from pipeline.run import ownership
from pipeline.run.failures import foreseen, leaves, told, where

if TYPE_CHECKING:
    from pipeline.config.run import RunConfig

MARK = ".sweep"  # in a run's folder: which start of a sweep it belongs to
MOST_RUNS = 10_000  # of a sweep: each has a folder
SHARED = "two runs of the sweep share it; hydra.sweep.subdir must tell them apart, as ${hydra:job.num} does"

exit_code = 0  # of the process: 0 all confirmed, 1 a method failed, 2 bad input


class Session(Callback):
    """Hydra's hooks. Hydra swallows exceptions of a callback, so bad input ends the process here."""

    def __init__(self) -> None:
        self.sweep = ""  # a launcher takes this object along to the processes of its runs

    def on_run_start(self, config: DictConfig, **_: Any) -> None:
        """Refuse bad input before Hydra makes the output folder; then the folder is this process's."""
        from pipeline.config.compose import checked
        from pipeline.run import resume

        with _refusing():
            folder = _given(config, "hydra.run.dir")
            asked = checked(config)
            print(f"{asked.name}: preparing", flush=True)  # what follows loads Drake
            self.check(asked)
            resume.refuse_another(folder, asked)
            ownership.own(folder)

    def check(self, asked: RunConfig) -> None:
        """Raise InputError if the job cannot be done. The problem that is built for this is kept for the run."""
        from pipeline.common.workers import Workers
        from pipeline.run.state import keep
        from pipeline.run.unused import require_motion

        require_motion(asked)
        if asked.artifacts.animation == "mp4":
            self.require_ffmpeg()
        keep(asked)
        Workers(address=asked.parallel.address).check()

    def require_ffmpeg(self) -> None:
        """Raise ConfigError where there is none: not after the run."""
        from pipeline.artifacts.animation import ffmpeg

        if ffmpeg() is None:
            raise ConfigError("artifacts.animation = mp4: needs ffmpeg: pip install '.[film]'; gif needs none")

    def on_multirun_start(self, config: DictConfig, **_: Any) -> None:
        self.sweep = uuid.uuid4().hex
        with _refusing():
            folder = _given(config, "hydra.sweep.dir")
            _refuse_jobs(config)
            ownership.own(folder)

    def on_job_start(self, config: DictConfig, **_: Any) -> None:
        """Mark the folders of this sweep: others may lie beside them from an earlier one."""
        if not self.sweep:
            return
        mark = Path(config.hydra.runtime.output_dir) / MARK
        with _refusing():
            if mark.is_file() and mark.read_text(encoding="utf-8") == self.sweep:
                raise OutputError(f"{mark.parent}: {SHARED}")
            mark.write_text(self.sweep, encoding="utf-8")

    def on_job_end(self, config: DictConfig, job_return: JobReturn, **_: Any) -> None:
        """Hydra keeps what every job of a sweep returns to its end: not the whole configuration too."""
        job_return.cfg = job_return.hydra_cfg = None

    def on_multirun_end(self, config: DictConfig, **_: Any) -> None:
        """Put the summaries of all runs of the sweep into one table; the worst of their exit codes is the sweep's."""
        from pipeline.artifacts import sweep

        global exit_code
        exit_code = 1  # if anything below fails
        folder = Path(config.hydra.sweep.dir)
        marks = [file for file in folder.rglob(MARK) if file.read_text(encoding="utf-8") == self.sweep]
        runs = [mark.parent for mark in marks]
        with _refusing():
            sweep.write(folder, runs)
            if any((run / "report.html").is_file() for run in runs):
                from pipeline.artifacts.page import several  # where nobody wrote a page, nobody waits for its template

                ordered = sweep.in_order(runs)
                several.write(folder, f"Sweep {folder.name}", ordered, [run.name for run in ordered])
        exit_code = max(map(sweep.exit_code, runs), default=0)


@contextmanager
def _refusing() -> Iterator[None]:
    """Say what was raised and end the process."""
    try:
        yield
    except BaseException as error:
        if leaves(error):
            raise
        line, code = told(error)
        print(f"error: {line if foreseen(error, code) else f'{line} ({where(error)})'}", file=sys.stderr)
        raise SystemExit(code) from None


def _given(config: DictConfig, key: str) -> Path:
    """The folder that a key of Hydra names."""
    folder = str(OmegaConf.select(config, key) or "").strip()
    if not folder:
        raise ConfigError(f"{key}: empty; a folder for the results, such as outputs/mine")
    return Path(folder)


def _refuse_jobs(config: DictConfig) -> None:
    """Raise ConfigError for runs of a sweep that would share a folder, and for a `name` that cannot be a folder's."""
    from pipeline.config.fields import as_name

    # Unresolved: an interpolation that fails is the fault of its job alone.
    asked = OmegaConf.to_container(config.hydra.overrides.task, resolve=False)
    words = OverridesParser.create().parse_overrides([str(word) for word in asked or ()])
    template = str(OmegaConf.to_container(config.hydra.sweep, resolve=False)["subdir"])  # type: ignore[index,call-overload]
    if "${" not in template and any(word.is_sweep_override() for word in words):
        raise ConfigError(f"hydra.sweep.subdir = {template}: {SHARED}")
    runs = math.prod(map(_values, words))
    if not runs <= MOST_RUNS:  # a range to or by nan too
        raise ConfigError(f"{' '.join(map(str, asked or ()))}: {runs:.3g} runs; a sweep has at most {MOST_RUNS}")
    for word in words:
        if word.key_or_group != "name":
            continue
        values = word.sweep_string_iterator() if word.is_sweep_override() else [word.get_value_element_as_str()]
        for value in values:
            try:
                as_name(str(value).strip("'\""))
            except ValueError as error:
                raise ConfigError(f"name = {value}: {error}") from None


def _values(word: Override) -> float:
    """How many values a word of the command line gives: counted, not made."""
    value = word.value()
    if isinstance(value, RangeSweep):
        start, stop, step = (float(part or 0) for part in (value.start, value.stop, value.step))
        count = (stop - start) / step if step else math.inf
        return 0.0 if count < 0 else count
    return len(value.list) if isinstance(value, ChoiceSweep) else 1
