"""Problems as data: the YAML files of a folder, our own and CppFlow's, as words of the command line.

Ours: `about`, a sentence; `words`, a list of words as on the command line; a path.file is sought beside the file too.
CppFlow's (Morgan et al. 2024): robot, path_name, offsets and boxes; the poses of the path, with quaternions w, x, y, z,
are rows of a CSV file in `paths/` beside the folder or in it. Every pose is moved by path_xyz_offset and turned by
path_R_offset in its own frame.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import yaml
from scipy.spatial.transform import Rotation

from pipeline.common.errors import ConfigError

ROBOTS = {"panda": ("robot=panda", "robot.end_effector=panda_hand")}  # of CppFlow's, whose descriptions are here
SPEED = 0.1  # [m/s] at which the paths of others are run through, which say none
COMMON = (
    *("robot.orientation=full", "robot.q_init=null", "path=waypoints", "limits=joint", "boundary.rest=[]"),
    *("boundary=free", "objective=velocity_norm", "timing=constant_speed"),
)


@dataclass(frozen=True)
class Case:
    """A problem: its name, a sentence about it, and the words that state it."""

    name: str
    about: str
    words: tuple[str, ...]


def cases(folder: Path, made: Path) -> list[Case]:
    """Those of `folder`, by name; into `made` go the paths that have to be written anew. Raises ConfigError."""
    files = sorted(folder.glob("*.yaml")) if folder.is_dir() else []
    if not files:
        raise ConfigError(f"{folder}: no folder with problems, which are .yaml files")
    return [_case(file, made) for file in files]


def _case(file: Path, made: Path) -> Case:
    try:
        content = yaml.safe_load(file.read_text(encoding="utf-8"))
    except (OSError, ValueError, yaml.YAMLError) as error:
        raise ConfigError(f"{file}: not a YAML file ({str(error).splitlines()[0]})") from None
    if isinstance(content, dict) and "path_name" in content:
        return _of_cppflow(file, content, made)
    words = content.get("words") if isinstance(content, dict) else None
    if not isinstance(words, list) or not all(isinstance(word, str) for word in words):
        raise ConfigError(f"{file}: needs words: a list of words as on the command line (or CppFlow's path_name)")
    return Case(file.stem, str(content.get("about", "")), tuple(_beside(word, file.parent) for word in words))


def _beside(word: str, folder: Path) -> str:
    key, _, name = word.partition("=")
    return f"{key}={folder / name}" if key == "path.file" and (folder / name).is_file() else word


def _of_cppflow(file: Path, content: Mapping[str, Any], made: Path) -> Case:
    robot, frame = content.get("robot"), content.get("path_offset_frame", "world")
    if robot not in ROBOTS:
        raise ConfigError(f"{file}: robot {robot} is not known here; known are {', '.join(ROBOTS)}")
    if frame != "world":
        raise ConfigError(f"{file}: path_offset_frame = {frame}; only world is read")
    poses = _poses(file, f"{content['path_name']}.csv")
    points = poses[:, :3] + np.array(content.get("path_xyz_offset", (0.0, 0.0, 0.0)), dtype=float)
    offset = Rotation.from_matrix(np.array(content.get("path_R_offset", np.eye(3)), dtype=float))
    turned = (Rotation.from_quat(poses[:, [4, 5, 6, 3]]) * offset).as_quat()
    made.mkdir(parents=True, exist_ok=True)
    path = made / f"{file.stem}.csv"
    columns = ["x", "y", "z", "qx", "qy", "qz", "qw"]
    pd.DataFrame(np.hstack([points, turned]), columns=columns).to_csv(path, index=False)
    length = float(np.linalg.norm(np.diff(points, axis=0), axis=1).sum())
    words = [*ROBOTS[robot], *COMMON, f"path.file={path}", f"timing.duration={max(length / SPEED, 1.0):.4g}"]
    if shapes := _boxes(content):
        words.append(f"+obstacles.shapes={{{', '.join(shapes)}}}")
    return Case(file.stem, "CppFlow's", tuple(words))


def _poses(file: Path, name: str) -> np.ndarray[Any, np.dtype[np.float64]]:
    for folder in (file.parent / "paths", file.parent.parent / "paths", file.parent):
        if (folder / name).is_file():
            return pd.read_csv(folder / name).to_numpy(dtype=float)[:, 1:8]
    raise ConfigError(f"{file}: its path {name} is neither in {file.parent / 'paths'} nor in a folder paths beside it")


def _boxes(content: Mapping[str, Any]) -> list[str]:
    moved = np.array(content.get("obstacle_xyz_offset", (0.0, 0.0, 0.0)), dtype=float)
    shapes = []
    for number, entries in enumerate(content.get("obstacles") or []):
        own = {key: float(value) for entry in entries for key, value in entry.items()}
        center = [own[axis] + move for axis, move in zip("xyz", moved, strict=True)]
        size, rpy = [own[f"size_{axis}"] for axis in "xyz"], [own.get(axis, 0.0) for axis in ("roll", "pitch", "yaw")]
        numbers = (", ".join(f"{value:.9g}" for value in values) for values in (center, size, rpy))
        where, large, turned = numbers
        shapes.append(f"box{number + 1}: {{kind: box, center: [{where}], size: [{large}], rpy: [{turned}]}}")
    return shapes
