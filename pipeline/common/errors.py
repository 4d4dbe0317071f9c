"""The errors a user can cause; each message is one line: what is wrong, where, what is allowed."""

from __future__ import annotations


class InputError(ValueError):
    """Base of all errors that a different input mends. The command line prints it and exits with 2."""


class ConfigError(InputError):
    """A configuration key or value is not allowed; the message names the key and what is."""


class RobotError(InputError):
    """A robot description cannot be used; the message names the file, link or joint."""


class PathError(InputError):
    """A path or its timing cannot be used; the message says where along the path and by how much."""


class OutputError(InputError):
    """The results cannot be written; the message names the folder."""


class WorkerError(InputError):
    """The machine ended the processes that do the work; the message says what needs less of it."""
