"""The command line: `python -m pipeline [group=option] [key=value] ...`. Exit code 0: every method confirmed.

1: a method failed or its motion was not confirmed (the summary says which and why). 2: bad input, one line on stderr.
"""

from __future__ import annotations

import os
import sys
from collections.abc import Callable, Collection, Sequence
from pathlib import Path
from typing import Any

import hydra
from hydra.core.hydra_config import HydraConfig
from hydra.types import RunMode
from omegaconf import DictConfig, OmegaConf

from pipeline.common.errors import OutputError
from pipeline.common.files import shipped
from pipeline.config.as_written import keep_as_written
from pipeline.config.unfolding import bound_files, bounded
from pipeline.run import completion, own_robot, ownership, session
from pipeline.run.failures import foreseen, leaves, told, where
from pipeline.run.refusals import refuse
from pipeline.run.termination import terminable

CONF = str(shipped("conf"))


def job(values: DictConfig) -> int:
    """One run, alone or within a sweep. An error is a line, and a row in the sweep's table; the other runs go on."""
    from pipeline.artifacts import sweep
    from pipeline.config.compose import checked
    from pipeline.run import resume
    from pipeline.run.run import run
    from pipeline.run.unused import unused

    hydra_values = HydraConfig.get()
    folder, sweeping = Path(hydra_values.runtime.output_dir), hydra_values.mode is RunMode.MULTIRUN
    try:
        ownership.own(folder)
    except OutputError as error:  # nothing is written into what is another's
        print(f"error: {error}", file=sys.stderr)
        session.exit_code = 2
        return 2
    try:
        config = checked(values)
        done = resume.finished(folder, config) if sweeping and config.sweep.resume else None
        if done is not None:
            print(f"{folder.name}: finished before, skipped (sweep.resume)", flush=True)
            return done
        resume.forget(folder)
        for line in unused(hydra_values.overrides.task, config):
            print(f"warning: {line}", file=sys.stderr)
        code = run(config, folder)
    except BaseException as error:
        if leaves(error):
            raise
        line, code = told(error)
        if not foreseen(error, code):
            sweep.write_traceback(folder, error)
            line += " (see error.txt)"
        print(f"error: {f'{folder.name}: ' if sweeping and code != 2 else ''}{line}", file=sys.stderr)
        if sweeping or code == 2:
            sweep.write_failure(folder, line, "bad input" if code == 2 else "error")
    finally:
        ownership.release(folder)
    session.exit_code = max(session.exit_code, code)
    return code


def answer(values: DictConfig) -> int | float | list[float]:
    """The job, with what a sweeper hears of it: the exit code, or the numbers that `sweep.objective` chooses."""
    code, asked = job(values), OmegaConf.select(values, "sweep.objective")
    if asked is None or HydraConfig.get().mode is not RunMode.MULTIRUN:
        return code
    from pipeline.run.objective import numbers

    def listed(value: Any) -> list[str]:
        """A word or a list of them; of an enumeration the name alone."""
        several = [value] if not OmegaConf.is_list(value) else list(value)
        return [getattr(one, "name", str(one)) for one in several]

    folder, goals = Path(HydraConfig.get().runtime.output_dir), HydraConfig.get().sweeper.get("direction", "minimize")
    found = numbers(folder, listed(asked), listed(goals))
    return found[0] if len(found) == 1 else found


def main() -> int:
    """Runs and sweeps."""
    return run_job(answer)


def run_job(
    job: Callable[[DictConfig], object],
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
    completes = completion.completes(asked)
    # Hydra then hands its errors to us instead of printing pages and leaving with 1.
    os.environ["HYDRA_FULL_ERROR"] = "1"
    try:
        with terminable(), bounded():
            refuse(asked)
            if not completes:
                words, line = own_robot.words(asked)
                sys.argv[1:1] = [*overrides, *words]
                if line:
                    print(line, flush=True)
            keep_as_written()
            bound_files()
            hydra.main(version_base="1.3", config_path=CONF, config_name="config")(job)()
    except BaseException as error:
        if isinstance(error, SystemExit) and not isinstance(error.code, str):
            raise  # somebody has said why
        line, code = told(error)
        return _complain(line if foreseen(error, code) else f"{line} ({where(error)})", code)
    finally:
        ownership.release()
    return session.exit_code


def _help(command: str, asks_for: Collection[str]) -> int:
    from pipeline.run import usage

    try:
        print(usage.text(command, asks_for), flush=True)
    except BrokenPipeError:  # read by `head` or a pager that was left
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
    return 0


def _complain(message: str, code: int) -> int:
    print(f"error: {message}", file=sys.stderr)
    return code
