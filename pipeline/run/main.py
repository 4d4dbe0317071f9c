"""The command line: `python -m pipeline [group=option] [key=value] ...`. Exit code 0: every method confirmed.

1: a method failed or its motion was not confirmed (the summary says which and why). 2: bad input, one line on stderr.
"""

from __future__ import annotations

import os
import re
import sys
import traceback
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any

import hydra
from hydra.core.hydra_config import HydraConfig
from hydra.errors import HydraException, MissingConfigException, OverrideParseException
from hydra.types import RunMode
from omegaconf import DictConfig
from omegaconf.errors import OmegaConfBaseException

from pipeline.common.errors import InputError, OutputError
from pipeline.common.files import shipped
from pipeline.config.compose import checked
from pipeline.config.fields import unknown_key
from pipeline.config.run import RunConfig
from pipeline.run import session

CONF = str(shipped("conf"))


def job(values: DictConfig) -> int:
    """One run, alone or within a sweep. A run of a sweep never raises, so that the others go on."""
    from pipeline.artifacts import sweep
    from pipeline.run import resume, run

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
        code = run.run_and_write(config, folder)
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


def run_job(job: Callable[[DictConfig], int], overrides: Sequence[str] = ()) -> int:
    """Parse the command line, do the job, and turn every foreseeable error into one line; `overrides` come before it."""
    sys.argv[1:1] = overrides
    for word in sys.argv[1:]:
        if _deletes_an_option(word):
            return _complain(f"{word}: options cannot be deleted, only entries of tables; give it another value")
    # Hydra then hands its errors to us instead of printing pages and leaving with 1.
    os.environ["HYDRA_FULL_ERROR"] = "1"
    try:
        hydra.main(version_base="1.3", config_path=CONF, config_name="config")(job)()
    except InputError as error:
        return _complain(str(error))
    except (HydraException, OmegaConfBaseException) as error:
        return _complain(_in_one_line(error))
    except OSError as error:
        return _complain(str(OutputError(f"cannot write {error.filename!s}: {error.strerror}")))
    except ValueError as error:
        # Hydra lets some malformed overrides through to a bare ValueError; any other one is a bug of ours.
        if not re.search(r"[/\\](omegaconf|hydra)[/\\]", traceback.extract_tb(error.__traceback__)[-1].filename):
            raise
        return _complain(f"{' '.join(sys.argv[1:])}: {_in_one_line(error)}")
    except KeyboardInterrupt:
        return _complain("interrupted", 130)
    return session.exit_code


def _deletes_an_option(word: str) -> bool:
    """Whether `~key` would take the default in place of what the files say, without a word."""
    found = re.fullmatch(r"~(\w[\w./]*)(@.*)?(=.*)?", word)
    if found is None:
        return False
    first, *rest = found.group(1).replace("/", ".").split(".")
    value: Any = RunConfig()
    if not hasattr(value, first):
        return False
    for part in (first, *rest):
        if value is None or isinstance(value, Mapping):
            return False  # an entry of a table, such as robot.locked
        value = getattr(value, part, value)
    return True


def _complain(message: str, code: int = 2) -> int:
    print(f"error: {message}", file=sys.stderr)
    return code


def _in_one_line(error: Exception) -> str:
    """Name the key and the allowed values of a composition error."""
    if isinstance(error, MissingConfigException) and error.missing_cfg_file:
        group, _, option = error.missing_cfg_file.rpartition("/")
        allowed = ", ".join(sorted(error.options or []))
        return f"{group or 'config'} = {option}: no such option; allowed: {allowed or 'see conf/'}"
    message = str(error.__cause__ or error)
    if isinstance(error, OverrideParseException):
        message = f"in {' '.join(sys.argv[1:])}: {error}"
    unknown = re.search(r"Could not (?:override|append to config\.?[^']*|find) '([^']+)'", str(error))
    if unknown:
        return str(unknown_key(unknown.group(1), _keys_beside(unknown.group(1))))
    return " ".join(line.strip() for line in message.splitlines() if line.strip() and not line.startswith("See http"))


def _keys_beside(key: str) -> list[str]:
    """The keys that may stand where `key` does not: those of the composed configuration at the same place."""
    from hydra import compose, initialize_config_dir
    from hydra.core.global_hydra import GlobalHydra
    from omegaconf import OmegaConf

    groups = [
        word for word in sys.argv[1:] if re.fullmatch(r"\+?[a-z_/]+=[\w,]+", word) and "." not in word.split("=")[0]
    ]
    GlobalHydra.instance().clear()
    with initialize_config_dir(CONF, version_base="1.3"):
        try:
            composed = compose("config", overrides=[word for word in groups if word.split("=")[0] != key])
        except (HydraException, OmegaConfBaseException):
            composed = compose("config")
    parent, _, _ = key.rpartition(".")
    while parent:
        there = OmegaConf.select(composed, parent)
        if isinstance(there, DictConfig):
            return [str(name) for name in there if name != "kind"]
        parent = parent.rpartition(".")[0]
    return [str(name) for name in composed]
