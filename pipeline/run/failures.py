"""What an error says to a user, in one line, and the exit code: the one place where every kind of them is known."""

from __future__ import annotations

import re
import sys
import traceback
from pathlib import Path

import yaml
from hydra.errors import HydraException
from omegaconf.errors import OmegaConfBaseException

from pipeline.common.errors import InputError
from pipeline.config.unfolding import TooMany
from pipeline.run import ownership
from pipeline.run.refusals import in_one_line
from pipeline.run.termination import CODE, Terminated, insist

HERE = str(Path(__file__).resolve().parents[1])


def leaves(error: BaseException) -> bool:
    """Whether the process was asked to leave: no failure of a run. Raises Terminated where that is hidden."""
    if isinstance(error, Exception):
        insist()
    asked = isinstance(error, SystemExit) and not isinstance(error.code, str)
    return asked or isinstance(error, KeyboardInterrupt | Terminated)


def told(error: BaseException) -> tuple[str, int]:
    """The line and the exit code: 2 for what other input mends, 1 for what nobody foresaw.

    Drake's assertions are SystemExit with a text: they fail in Drake's own code, on numbers that it did not expect.
    """
    match error:
        case InputError():  # one line, whatever separators the input has that it cites
            return _joined(error), 2
        case KeyboardInterrupt():
            return "interrupted", 130
        case Terminated():
            return "terminated; what is finished is kept, start again to go on", CODE
        case SystemExit():
            return f"Drake: {_joined(error.code)}", 1
        case MemoryError():
            return "out of memory: fewer knots (timing.steps), way-points, starts or parallel.workers need less", 1
        case RecursionError():
            return "what is given is nested too deeply", 2
        case HydraException() | OmegaConfBaseException():
            return in_one_line(error), 2
        case TooMany():
            return _joined(error), 2
        case yaml.YAMLError():
            return f"not YAML: {_joined(error)}", 2
        case UnicodeError():
            return f"not UTF-8 text: {_joined(error)}", 2
        case OSError() if error.filename is not None:
            return f"cannot read or write {error.filename!s}: {error.strerror or _joined(error)}", 2
        case OSError() if error.errno is None:  # OmegaConf's, of a file that holds no table
            return f"not a table of keys and values: {_joined(error)}", 2
        case OSError():  # a disk that is full has no name of its own
            return f"cannot write{ownership.names()}: {error.strerror}", 2
        case ValueError() | TypeError() if re.search(r"[/\\](omegaconf|hydra|antlr4)[/\\]", _last(error)):
            # Hydra lets some malformed overrides through to a bare error, as a list of numbers that picks an option.
            return f"{' '.join(sys.argv[1:])}: {_joined(error)}", 2
    return f"{type(error).__name__}: {_joined(error)}", 1


def foreseen(error: BaseException, code: int) -> bool:
    """Whether the line told with this code says it all; other errors are bugs of ours: their traceback is kept."""
    return code != 1 or isinstance(error, MemoryError)


def where(error: BaseException) -> str:
    """The innermost line of this package that an error passed through."""
    own = [frame for frame in traceback.extract_tb(error.__traceback__) if frame.filename.startswith(HERE)]
    return f"{own[-1].filename}:{own[-1].lineno}" if own else _last(error)


def _last(error: BaseException) -> str:
    frames = traceback.extract_tb(error.__traceback__)
    return frames[-1].filename if frames else ""


def _joined(message: object) -> str:
    return " ".join(str(message).split())
