"""What a command line asks for without effect: said in a line, or refused where nothing is left of it."""

from __future__ import annotations

import re
from collections.abc import Sequence

from pipeline.build.gcode import is_gcode
from pipeline.common.errors import ConfigError
from pipeline.config.path import WaypointsConfig
from pipeline.config.run import RunConfig

WORD = r"\+{0,2}([a-z_]+)\.([a-z_.]+)=.*"  # key=value of a group


def require_motion(config: RunConfig) -> None:
    """Raise ConfigError where the motion to be exported, or followed by the controller, is of no method that runs."""
    method = config.export.method
    if method not in ("best", "none", *config.methods):
        raise ConfigError(
            f"export.method = {method}: that method does not run (methods = [{','.join(config.methods)}]), so that "
            "there is nothing to export"
        )
    if config.closed_loop.run and method == "none":
        raise ConfigError("closed_loop.run = true: it follows the exported motion, and export.method = none")


def unused(words: Sequence[str], config: RunConfig) -> list[str]:
    """A line for each word of the command line that changes nothing in this run; files are not looked at."""
    lines = []
    for word in words:
        found = re.fullmatch(WORD, word, re.DOTALL)
        why = _why(found.group(1), found.group(2), config) if found else ""
        if why:
            lines.append(f"{word}: without effect, since {why}")
    return lines


def _why(group: str, key: str, config: RunConfig) -> str:
    """Why the key does nothing; empty if it does."""
    first, _, rest = key.partition(".")
    if group == "method" and rest:
        runs = {
            *config.methods,
            *({"global"} if {"pareto", "segments"} & set(config.methods) or config.candidate_study.run else ()),
        }
        return "" if first in runs else f"{first} does not run (methods = [{','.join(config.methods)}])"
    if group in ("closed_loop", "control", "candidate_study", "identification") and first != "run":
        return "" if getattr(config, group).run else f"{group}.run = false"
    gcode = isinstance(config.path, WaypointsConfig) and is_gcode(config.path)
    feeds = ("from_file",) if gcode and config.timing.law == "from_file" else ()
    nothing = {
        "export.rate": ("export.method = none", config.export.method == "none"),
        "timing.duration": ("timing.law = from_file", config.timing.law == "from_file"),
        "timing.ramp": (f"timing.law = {config.timing.law}", config.timing.law not in ("cruise", *feeds)),
        "path.units": ("G20 and G21 say it in G-code", gcode),
        "path.rapid": ("nothing is timed by the feeds of G-code", not feeds),
        "path.orientation_tolerance": ("robot.orientation = none", config.robot.orientation == "none"),
        "robot.pointing": (f"robot.orientation = {config.robot.orientation}", config.robot.orientation != "pointing"),
        "obstacles.margin": ("there are no obstacles", not config.obstacles.any),
        "obstacles.influence": ("there are no obstacles", not config.obstacles.any),
    }
    why, holds = nothing.get(f"{group}.{key}", ("", False))
    return why if holds else ""
