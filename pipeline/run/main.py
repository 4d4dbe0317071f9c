"""The command line: `python -m pipeline [group=option] [key=value] ...`. Exit code 0: every method confirmed.

1: a method failed or its motion was not confirmed (the summary says which and why). 2: bad input, one line on stderr.
"""

from __future__ import annotations

import os
import re
import sys
import traceback
from collections.abc import Callable, Collection, Sequence
from pathlib import Path

import hydra
from hydra.core.hydra_config import HydraConfig
from hydra.errors import HydraException
from hydra.types import RunMode
from omegaconf import DictConfig
from omegaconf.errors import OmegaConfBaseException

from pipeline.common.errors import InputError, OutputError
from pipeline.common.files import shipped
from pipeline.config.as_written import keep_as_written
from pipeline.run import completion, session
from pipeline.run.refusals import in_one_line, refuse

CONF = str(shipped("conf"))


def job(values: DictConfig) -> int:
    """One run, alone or within a sweep. A run of a sweep never raises, so that the others go on."""
    from pipeline.artifacts import sweep
    from pipeline.config.compose import checked
    from pipeline.run import resume
    from pipeline.run.run import run
    from pipeline.run.unused import unused

    hydra_values = HydraConfig.get()
    folder, sweeping = Path(hydra_values.runtime.output_dir), hydra_values.mode is RunMode.MULTIRUN
    try:
        config = checked(values)
        done = resume.finished(folder, config) if sweeping and config.sweep.resume else None
        if done is not None:
            print(f"{folder.name}: finished before, skipped (sweep.resume)", flush=True)
            return done
        if sweeping:
            resume.forget(folder)
        for line in unused(hydra_values.overrides.task, config):
            print(f"warning: {line}", file=sys.stderr)
        code = run(config, folder)
    except InputError as error:
        print(f"error: {error}", file=sys.stderr)
        sweep.write_failure(folder, str(error))
        code = 2
    except Exception as error:
        if not sweeping:
            raise
        print(f"error: {folder.name}: {sweep.write_crash(folder, error)}", file=sys.stderr)
        code = 1
    session.exit_code = max(session.exit_code, code)
    return code


def main() -> int:
    """Runs and sweeps."""
    return run_job(job)


def run_job(
    job: Callable[[DictConfig], int],
    overrides: Sequence[str] = (),
    command: str = "python -m pipeline",
    asks_for: Collection[str] = (),
) -> int:
    """Parse the command line, do the job, and turn every foreseeable error into one line; `overrides` come before it.

    command: what the user calls, and asks_for: the keys and groups that it reads, none for all of them, for its help.
    """
    asked = sys.argv[1:]
    if {"--help", "-h"} & set(asked):
        return _help(command, asks_for)
    if completion.installs(asked):
        print(completion.BASH)
        return 0
    if not completion.completes(asked):
        sys.argv[1:1] = overrides
    # Hydra then hands its errors to us instead of printing pages and leaving with 1.
    os.environ["HYDRA_FULL_ERROR"] = "1"
    try:
        refuse(asked)
        keep_as_written()
        hydra.main(version_base="1.3", config_path=CONF, config_name="config")(job)()
    except InputError as error:
        return _complain(str(error))
    except (HydraException, OmegaConfBaseException) as error:
        return _complain(in_one_line(error))
    except OSError as error:
        return _complain(str(OutputError(f"cannot write {error.filename!s}: {error.strerror}")))
    except ValueError as error:
        # Hydra lets some malformed overrides through to a bare ValueError; any other one is a bug of ours.
        if not re.search(r"[/\\](omegaconf|hydra)[/\\]", traceback.extract_tb(error.__traceback__)[-1].filename):
            raise
        return _complain(f"{' '.join(sys.argv[1:])}: {in_one_line(error)}")
    except KeyboardInterrupt:
        return _complain("interrupted", 130)
    return session.exit_code


def _help(command: str, asks_for: Collection[str]) -> int:
    from pipeline.run import usage

    try:
        print(usage.text(command, asks_for), flush=True)
    except BrokenPipeError:  # read by `head` or a pager that was left
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
    return 0


def _complain(message: str, code: int = 2) -> int:
    print(f"error: {message}", file=sys.stderr)
    return code
