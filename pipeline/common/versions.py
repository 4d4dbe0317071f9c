"""What the numbers were made with."""

from __future__ import annotations

import functools
import platform
import sys
from importlib.metadata import PackageNotFoundError, version

DECISIVE = ("selfmotion", "drake", "numpy", "scipy")  # another version of these may give other numbers


SHOWN = (*DECISIVE, "pandas", "rerun-sdk", "hydra-core", "matplotlib")


def versions() -> dict[str, str]:
    """Of Python, the machine and the packages: for the record of a run."""
    machine = f"{platform.system()} {platform.machine()}"
    return {"python": sys.version.split()[0], "machine": machine, **{package: _of(package) for package in SHOWN}}


@functools.cache
def stamp() -> str:
    """The versions that decide the numbers: results of another stamp are not mixed with ours."""
    return ", ".join(f"{package} {_of(package)}" for package in DECISIVE)


def _of(package: str) -> str:
    try:
        return version(package)
    except PackageNotFoundError:
        return "not installed"
