"""The path of a file of G-code: its moves, how its corners are passed, and the law that its feeds give."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np

from pipeline.common.arrays import Array
from pipeline.common.errors import PathError
from pipeline.config.path import TimingConfig, WaypointsConfig
from pipeline.path.curves import Arc
from pipeline.path.gcode import SUFFIXES, Move, read
from pipeline.path.moves import joined
from pipeline.path.through import Through, through
from pipeline.path.timing import Feeds
from pipeline.robot.packages import find

NEGLIGIBLE = 1e-9  # of the length


def is_gcode(path: WaypointsConfig) -> bool:
    return Path(path.file).suffix.lower() in SUFFIXES


def moves_of(path: WaypointsConfig, axes: Sequence[str], here: Array) -> tuple[Through, tuple[Move, ...], list[str]]:
    """The path through the moves of path.file, these moves, and what there is to say of them."""
    moves, left_out = read(find(path.file, "path.file"), axes)
    if path.relative:
        by = here - moves[0].piece.start
        moves = tuple(replace(move, piece=replace(move.piece, start=move.piece.start + by)) for move in moves)
    notes = [f"{', '.join(left_out)} of the file move no arm and are left out"] if left_out else []
    if path.corners == "spline":
        found = _smooth(path, moves)
    else:
        found = joined([move.piece for move in moves], path.blend if path.corners == "blend" else None)
    distance, before = found.departure
    if distance > NEGLIGIBLE * found.geometry.length:
        notes.append(f"it leaves the moves of the file by up to {distance:.3g} m, after line {moves[before - 1].line}")
    if found.closer:
        lines = _lines(moves, [corner - 1 for corner in found.closer])
        notes.append(f"the moves of {lines} are too short for path.blend: the path keeps closer to their ends")
    if found.stops:
        notes.append(f"the path comes to rest after {_lines(moves, [stop - 1 for stop in found.stops])}")
    return found, moves, notes


def feeds(path: WaypointsConfig, timing: TimingConfig, found: Through, moves: Sequence[Move]) -> Feeds:
    """Every move at its feed, rapids at path.rapid, and timing.ramp of the time to get to speed."""
    speeds = []
    for move in moves:
        if move.feed is None and not move.rapid:
            raise PathError(
                f"path.file = {path.file}: line {move.line}: no feed F so far, and timing.law = from_file asks for it"
            )
        speeds.append(path.rapid if move.rapid or move.feed is None else move.feed)
    spans, length = np.diff(found.marks) / np.array(speeds), found.geometry.length
    return Feeds(tuple((found.marks / length).tolist()), tuple(spans.tolist()), found.stops, timing.ramp)


def _smooth(path: WaypointsConfig, moves: Sequence[Move]) -> Through:
    """A smooth curve through the ends of straight moves."""
    bent = next((move.line for move in moves if isinstance(move.piece, Arc)), None)
    if bent is not None:
        raise PathError(
            f"path.file = {path.file}: line {bent}: an arc, which path.corners = spline, a smooth curve through the "
            "ends of all moves, would not keep; set path.corners to blend or stop"
        )
    points = [moves[0].piece.start, *(move.piece.sample(np.array([move.piece.length]))[0][0] for move in moves)]
    return through(np.array(points), None)


def _lines(moves: Sequence[Move], which: Sequence[int]) -> str:
    shown = ", ".join(str(moves[i].line) for i in which[:8]) + ", ..." * (len(which) > 8)
    return f"line{'s' * (len(which) > 1)} {shown}"
