"""Where `package://name/...` lies: in ROS's package paths, or in an installed Python package that ships robots."""

from __future__ import annotations

import importlib.util
import os
import site
import sys
import sysconfig
from collections.abc import Iterator
from pathlib import Path
from pathlib import Path as File

from pipeline.common.errors import RobotError
from pipeline.common.files import shipped

PREFIX = "package://"


# Packages on the package index that ship robots, by the name that their URDFs use, and how to get them.
KNOWN = {"example-robot-data": "pip install 'selfmotion[robots]'"}


def resolve(uri: str, beside: Path | None = None) -> Path | None:
    """The file of a `package://`, `file://` or plain name, which may be relative to the folder `beside`; None if unknown."""
    if uri.startswith("file://"):
        return Path(uri.removeprefix("file://"))
    if not uri.startswith(PREFIX):
        path = Path(uri).expanduser()
        return beside / path if beside is not None and not path.is_absolute() else path
    name, _, rest = uri.removeprefix(PREFIX).partition("/")
    for folder in _folders(name, beside):
        if (folder / rest).exists():
            return folder / rest
    return None


def locate(uri: str, key: str) -> Path:
    """The file of a `package://` name; raises RobotError that says how to make the package known."""
    found = resolve(uri)
    if found is None:
        name, _, rest = uri.removeprefix(PREFIX).partition("/")
        if any(folder.exists() for folder in _folders(name, None)):
            raise RobotError(f"{key} = {uri}: package {name} is there, but holds no {rest}")
        hint = KNOWN.get(name, "set ROS_PACKAGE_PATH or AMENT_PREFIX_PATH, or install it")
        raise RobotError(f"{key} = {uri}: no package {name} was found; {hint}")
    return found


def _folders(name: str, beside: Path | None) -> Iterator[Path]:
    """Folders that may be package `name`, the likeliest first."""
    for parent in () if beside is None else (beside, *beside.parents):  # a package's own files know it by its folder
        if parent.name == name:
            yield parent
    for root in os.environ.get("ROS_PACKAGE_PATH", "").split(os.pathsep):
        if root:
            yield from (Path(root), Path(root) / name) if Path(root).name == name else (Path(root) / name,)
    for root in os.environ.get("AMENT_PREFIX_PATH", "").split(os.pathsep):
        if root:
            yield Path(root) / "share" / name
    roots = dict.fromkeys(
        [sysconfig.get_path("purelib"), *site.getsitepackages(), site.getusersitepackages(), *sys.path]
    )
    for root in roots:
        yield Path(root) / "cmeel.prefix" / "share" / name
    yield Path(sys.prefix) / "share" / name
    module = name.replace("-", "_")
    if module.isidentifier():
        try:
            spec = importlib.util.find_spec(module)
        except ValueError:  # a module without a spec, such as __main__
            return
        for location in (spec.submodule_search_locations or []) if spec is not None else []:
            yield Path(location)


def find(name: str) -> File:
    """A robot description by package:// name, absolute path, or path relative to the working directory or the project."""
    if name.startswith(PREFIX):
        return locate(name, "robot.urdf")
    given = File(name).expanduser()
    if not given.is_absolute() and not given.is_file() and (ours := shipped(name)).is_file():
        return ours
    return given.absolute()  # kept results are found again from any working directory
