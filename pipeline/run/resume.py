"""Whether a folder holds the finished run of a configuration, so that a sweep that is started again can skip it."""

from __future__ import annotations

import hashlib
import json
from dataclasses import asdict
from pathlib import Path
from typing import Any

from pipeline.common.errors import OutputError
from pipeline.common.versions import DECISIVE, versions
from pipeline.config.documents import FOLDER
from pipeline.config.path import WaypointsConfig
from pipeline.config.run import RunConfig
from pipeline.robot import formats
from pipeline.robot.packages import find

WITHOUT_EFFECT = ("parallel", "sweep")  # groups that change no result


def inputs(config: RunConfig) -> dict[str, str]:
    """Digests of the files that the configuration names, and of those that they include: they can change while their
    names do not.
    """
    robot = find(config.robot.urdf)
    files = {"robot.urdf": robot}
    files |= {f"robot.urdf: {name}": file for name, file in formats.files(robot).items() if file != robot}
    if config.obstacles.file is not None:
        world = find(config.obstacles.file, "obstacles.file")
        files |= {f"obstacles.file: {name}": file for name, file in formats.files(world).items()}
    if isinstance(config.path, WaypointsConfig):
        files["path.file"] = find(config.path.file, "path.file")
    limits = {"limits.file": config.limits.file, "robot.limits": config.robot.limits}
    files |= {key: find(name, key) for key, name in limits.items() if name is not None}
    if config.identification.run:
        files |= {f"conf/reproduction/{name}.yaml": FOLDER / f"{name}.yaml" for name in config.identification.documents}
    return {key: hashlib.sha256(file.read_bytes()).hexdigest() for key, file in files.items()}


def finished(folder: Path, config: RunConfig) -> int | None:
    """The exit code of the run in `folder` if it is finished and would be the same now, else None."""
    try:
        record = _record(folder)
        now = {**versions(), "config": asdict(config), "inputs": inputs(config)}
        same = all(_plain(record[key]) == _plain(now[key]) for key in ("source", *DECISIVE, "config", "inputs"))
        return int(record["exit_code"]) if same else None
    except (OSError, ValueError, KeyError):
        return None


def refuse_another(folder: Path, config: RunConfig) -> None:
    """Raise OutputError if `folder` holds the finished run of another configuration, which would be lost."""
    try:
        held = _record(folder)["config"]
    except (OSError, ValueError, KeyError):
        return
    if _plain(held) != _plain(asdict(config)):
        raise OutputError(
            f"{folder}: holds the finished run of another configuration; choose another folder or delete this one"
        )


def _record(folder: Path) -> Any:
    return json.loads((folder / "run.json").read_text(encoding="utf-8"))


def forget(folder: Path) -> None:
    """Take away what says that a run is finished, before it is run again."""
    for name in ("run.json", "summary.csv", "error.txt"):
        (folder / name).unlink(missing_ok=True)


def _plain(value: Any) -> Any:
    """As it reads back from JSON, without what has no effect."""
    if isinstance(value, dict):
        value = {key: entry for key, entry in value.items() if key not in WITHOUT_EFFECT}
    return json.loads(json.dumps(value, default=str))
