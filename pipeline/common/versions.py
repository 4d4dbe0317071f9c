"""What the numbers were made with."""

from __future__ import annotations

import functools
import hashlib
import platform
import sys
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path

DECISIVE = ("selfmotion", "drake", "numpy", "scipy")  # another version of these may give other numbers


SHOWN = (*DECISIVE, "pandas", "rerun-sdk", "hydra-core", "matplotlib")


def versions() -> dict[str, str]:
    """Of Python, the machine, this source and the packages: for the record of a run."""
    machine = f"{platform.system()} {platform.machine()}"
    packages = {package: _of(package) for package in SHOWN}
    return {"python": sys.version.split()[0], "machine": machine, "source": source(), **packages}


@functools.cache
def stamp() -> str:
    """The versions that decide the numbers: results of another stamp are not mixed with ours."""
    return ", ".join([f"source {source()}", *(f"{package} {_of(package)}" for package in DECISIVE)])


@functools.cache
def source() -> str:
    """A digest of this package's own source: a version says little of what is being worked on."""
    package, digest = Path(__file__).resolve().parents[1], hashlib.sha256()
    for file in sorted(package.rglob("*.py")):
        digest.update(f"{file.relative_to(package).as_posix()}\0".encode())
        digest.update(hashlib.sha256(file.read_bytes()).digest())
    return digest.hexdigest()[:16]


def _of(package: str) -> str:
    try:
        return version(package)
    except PackageNotFoundError:
        return "not installed"
