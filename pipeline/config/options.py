"""The groups of `conf/` and their options, by their files: what help and messages offer."""

from __future__ import annotations

from pathlib import Path

import yaml

from pipeline.common.files import shipped

HIDDEN = "_"  # an option that begins so is only there to be inherited from


def chosen() -> dict[str, str]:
    """Every group that conf/config.yaml picks from, and its pick; none of `method`, all of whose options hold."""
    rows = yaml.safe_load((shipped("conf") / "config.yaml").read_text(encoding="utf-8"))["defaults"]
    pairs = [pair for row in rows if isinstance(row, dict) for pair in row.items()]
    return {group: option if isinstance(option, str) else "" for group, option in pairs if " " not in group}


def options(group: str) -> dict[str, str]:
    """The options of a group and what their files say of them: the first line of comment that is not for a machine."""
    files = sorted((shipped("conf") / group).glob("*.yaml"))
    return {file.stem: _says(file) for file in files if not file.stem.startswith(HIDDEN)}


def _says(file: Path) -> str:
    lines = file.read_text(encoding="utf-8").splitlines()
    comments = [line.lstrip("# ") for line in lines if line.startswith("#")]
    return next((line for line in comments if not line.startswith(("@package", "python -m"))), "")
