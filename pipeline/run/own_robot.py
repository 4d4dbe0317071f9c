"""A robot file of the user's own: `robot.urdf=arm.urdf` takes nothing from the robot whose option stands there."""

from __future__ import annotations

import json
from collections.abc import Sequence
from pathlib import Path

import yaml
from hydra.core.override_parser.overrides_parser import OverridesParser
from hydra.core.override_parser.types import Override
from hydra.errors import HydraException

from pipeline.common.errors import InputError
from pipeline.common.files import shipped

# What else belongs to one arm alone; where nobody says it, what conf/robot/_common.yaml does.
BELONGS = ("limits", "srdf", "collision", "tool", "locked", "armature", "offset", "offset_rpy", "base")


def words(asked: Sequence[str]) -> tuple[list[str], str]:
    """What holds for the robot file that the command line names, as overrides to stand before its own, and one line
    that says so; nothing where it names none, sweeps over several, or cannot be read (the run then says why). Raises
    RobotError for a file of several arms where no word says which.
    """
    given = {word.key_or_group: word for word in _parsed(asked)}
    urdf = given.get("robot.urdf")
    if urdf is None or urdf.is_sweep_override() or not isinstance(urdf.value(), str) or "robot" in given:
        return [], ""
    from pipeline.robot import guess
    from pipeline.robot.packages import find

    def asks(key: str) -> str | None:
        word = given.get(f"robot.{key}")
        return str(word.value()) if word is not None and isinstance(word.value(), str) else None

    try:
        file = find(str(urdf.value()))
        tip, flat = guess.read(file, asks("base"), asks("end_effector"))
    except guess.SeveralArmsError:
        raise
    except (InputError, OSError):
        return [], ""
    task = "[x,y]" if flat else "[x,y,z]"
    own = {"name": f'"{_name(file)}"', "end_effector": f'"{tip}"', "task": task, "q_init": "null"}
    common = yaml.safe_load((shipped("conf") / "robot" / "_common.yaml").read_text(encoding="utf-8"))
    own |= {key: json.dumps(common[key]) for key in BELONGS}
    own = {key: value for key, value in own.items() if f"robot.{key}" not in given}
    said = {
        "end_effector": f"end_effector={tip} (its last link)",
        "task": f"task={task}" + (" (it moves in a plane)" if flat else ""),
        "q_init": "q_init=null (sought for a path in the world, else the middle of the joints' ranges)",
    }
    taken = [line for key, line in said.items() if key in own]
    line = f"note: {file.name} says no more, so robot.{', robot.'.join(taken)}" if taken else ""
    return [f"robot.{key}={value}" for key, value in own.items()], line


def _name(file: Path) -> str:
    """The robot's, from its file: letters that a folder may have."""
    return (
        "".join(letter if letter.isalnum() or letter in "_-" else "_" for letter in file.stem)[:100].strip("-") or "arm"
    )


def _parsed(asked: Sequence[str]) -> list[Override]:
    """The overrides on the command line that can be read; flags and what is malformed is Hydra's to refuse."""
    parser, found = OverridesParser.create(), []
    for word in asked:
        if word.startswith("-") or "=" not in word:
            continue
        try:
            found.append(parser.parse_override(word))
        except HydraException:
            continue
    return found
