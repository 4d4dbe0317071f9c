"""Where `package://name/...` and `model://name/...` lie: in ROS's or Gazebo's paths, or in a Python package."""

from __future__ import annotations

import importlib.util
import os
import re
import site
import sys
import sysconfig
from collections.abc import Iterator
from pathlib import Path
from urllib.parse import unquote, urlsplit

from pipeline.common.errors import RobotError
from pipeline.common.files import shipped
from pipeline.robot.markup import parse

SCHEMES = ("package://", "model://")
ROS = ("ROS_PACKAGE_PATH",)
GAZEBO = ("GZ_SIM_RESOURCE_PATH", "IGN_GAZEBO_RESOURCE_PATH", "GAZEBO_MODEL_PATH", "SDF_PATH")


# Packages on the package index that ship robots, by the name that their URDFs use, and how to get them.
KNOWN = {"example-robot-data": "pip install 'selfmotion[robots]'"}


def resolve(uri: str, beside: Path | None = None) -> Path | None:
    """The file of a `package://`, `model://`, `file://` or plain name; None if unknown.

    A plain name may be relative to the folder `beside`.
    """
    if uri.startswith("file:"):
        return Path(unquote(urlsplit(uri).path))
    if not uri.startswith(SCHEMES):
        path = Path(uri).expanduser()
        return beside / path if beside is not None and not path.is_absolute() else path
    name, rest = _parts(uri)
    for folder in _folders(name, beside):
        if (folder / rest).exists():
            return folder / rest
    return None


def locate(uri: str, key: str) -> Path:
    """The file of a `package://` or `model://` name; raises RobotError that says how to make the package known."""
    found = resolve(uri)
    if found is None:
        name, rest = _parts(uri)
        if any(folder.exists() for folder in _folders(name, None)):
            raise RobotError(f"{key} = {uri}: package {name} is there, but holds no {rest}")
        hint = "set GZ_SIM_RESOURCE_PATH or GAZEBO_MODEL_PATH"
        if uri.startswith("package://"):
            hint = KNOWN.get(name, "set ROS_PACKAGE_PATH or AMENT_PREFIX_PATH, or install it")
        raise RobotError(f"{key} = {uri}: no package {name} was found; {hint}")
    return found


def model_file(uri: str, beside: Path | None = None) -> Path | None:
    """The SDF file that a model's name leads to: itself, or the one that the model.config of its folder names."""
    found = resolve(uri, beside)
    if found is None or found.is_file():
        return found
    config = found / "model.config"
    if config.is_file():
        named = [(e.get("version", ""), (e.text or "").strip()) for e in parse(config.read_bytes(), config).iter("sdf")]
        newest = max(named, key=lambda one: [int(part) for part in re.findall("[0-9]+", one[0])], default=("", ""))[1]
        if newest and (found / newest).is_file():
            return found / newest
    return found / "model.sdf" if (found / "model.sdf").is_file() else None


def named_folder(uri: str, beside: Path | None = None) -> dict[str, str]:
    """The package that a name begins with, and its folder; empty if it names none, or one that is not known."""
    name = _parts(uri)[0] if uri.startswith(SCHEMES) else ""
    folder = next((folder for folder in _folders(name, beside) if folder.is_dir()), None) if name else None
    return {} if folder is None else {name: str(folder)}


def _parts(uri: str) -> tuple[str, str]:
    """The package and the rest of a `package://` or `model://` name."""
    name, _, rest = uri.partition("://")[2].partition("/")
    return name, rest


def _folders(name: str, beside: Path | None) -> Iterator[Path]:
    """Folders that may be package `name`, the likeliest first."""
    for parent in () if beside is None else (beside, *beside.parents):  # a package's own files know it by its folder
        if parent.name == name:
            yield parent
    for root in _listed(*ROS, *GAZEBO):
        yield from (Path(root), Path(root) / name) if Path(root).name == name else (Path(root) / name,)
    for root in _listed("AMENT_PREFIX_PATH"):
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


def _listed(*variables: str) -> list[str]:
    """The folders in variables of the environment."""
    return [root for variable in variables for root in os.environ.get(variable, "").split(os.pathsep) if root]


def find(name: str, key: str = "robot.urdf") -> Path:
    """The file that `key` names: by package://, model:// or file:// name, or by a path.

    A path may be relative to the working directory or to the project.
    """
    if name.startswith(SCHEMES):
        return model_file(name) or locate(name, key)
    given = Path(unquote(urlsplit(name).path)) if name.startswith("file:") else Path(name).expanduser()
    if not given.is_absolute() and not given.is_file() and (ours := shipped(name)).is_file():
        return ours
    return given.absolute()  # kept results are found again from any working directory
