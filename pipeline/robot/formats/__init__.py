"""Robot files of each kind, told apart by what they hold and not by their names, as one `Tree`."""

from __future__ import annotations

import os
from pathlib import Path

from pipeline.common.errors import RobotError
from pipeline.robot import packages
from pipeline.robot.formats import mjcf, sdf, urdf
from pipeline.robot.markup import parse
from pipeline.robot.tree import Tree

READERS = {"robot": urdf.read, "sdf": sdf.read, "gazebo": sdf.read, "mujoco": mjcf.read}


def load(file: Path, end_effector: str) -> Tree:
    """What `file` says; of several models in a world, the one that has the link `end_effector`. Raises RobotError."""
    if file.is_dir():
        raise RobotError(f"robot.urdf = {file}: a folder; give the file in it")
    if not file.is_file():
        raise RobotError(f"robot.urdf = {file}: no such file")
    try:
        data = file.read_bytes()
    except OSError as error:
        raise RobotError(f"robot.urdf = {file}: {error.strerror}") from None
    root = parse(data, file)
    if root.tag not in READERS:
        allowed = "<robot> (URDF), <sdf> or <mujoco>"
        raise RobotError(f"robot.urdf = {file}: the root element is <{root.tag}>, expected {allowed}")
    return READERS[root.tag](root, file, end_effector)


def files(file: Path) -> dict[str, Path]:
    """All files that `file` is read from, itself first: what it includes, and what that includes, by their places from
    its folder. One that is not there is left out.
    """
    found: dict[str, Path] = {}
    left = [file]
    while left:
        one = left.pop()
        name = os.path.relpath(one, file.parent)
        if name in found or not one.is_file():
            continue
        found[name] = one
        for include in parse(one.read_bytes(), one).iter("include"):
            if (text := include.get("file")) is not None:
                left.append(one.parent / text)
            elif (inner := packages.model_file((include.findtext("uri") or "").strip(), one.parent)) is not None:
                left.append(inner)
    return found
