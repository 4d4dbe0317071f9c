"""Way-points, their orientations and their times from a CSV file. What a file holds is used or refused."""

from __future__ import annotations

import csv
import difflib
import re
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path as File

import numpy as np
import pandas as pd
from scipy.spatial.transform import Rotation

from pipeline.common.arrays import Array
from pipeline.common.errors import PathError

ROLL_PITCH_YAW, QUATERNION, TIME = ("roll", "pitch", "yaw"), ("qx", "qy", "qz", "qw"), "time"
SEGMENT = "segment"
LARGEST = 1e9  # [m], [rad] and [s]
MOST = 100_000  # rows: each becomes a piece of a spline


@dataclass(frozen=True)
class Waypoints:
    """points (P, m) [m], P >= 2; rotations (P) and times (P,) [s], increasing, or None where the file has none.

    begins: the rows at which a tool path begins, 0 alone where the file is one.
    """

    points: Array
    rotations: Rotation | None = None
    times: Array | None = None
    begins: tuple[int, ...] = (0,)


def read_waypoints(file: str | File, axes: Sequence[str]) -> Array:
    """The points (P, m) [m] of `read`, each of which is another than the one before."""
    points = read(file, axes).points
    repeated = np.flatnonzero(np.linalg.norm(np.diff(points, axis=0), axis=1) < 1e-12)
    if repeated.size:
        raise PathError(f"path.file = {file}: {same_point(int(repeated[0]))}")
    return points


def same_point(row: int) -> str:
    """What is wrong with the rows `row` and `row` + 1 of the data, from 0."""
    return f"way-points {row + 1} and {row + 2} are the same point"


def read(file: str | File, axes: Sequence[str]) -> Waypoints:
    """The rows of a CSV file with a column [m] for each of `axes`; it may have roll, pitch, yaw [rad] or qx, qy, qz,
    qw, time [s], and segment, whose value is the same along each of several tool paths. Raises PathError, one line,
    for anything else that it holds.
    """
    table = _table(File(file))
    _check_header(file, [str(name) for name in table.columns], axes)
    points = _numbers(file, table, axes)
    if len(points) < 2:
        raise PathError(f"path.file = {file}: {len(points)} way-point{'s' * (len(points) != 1)}, at least 2 are needed")
    times = _times(file, table) if TIME in table else None
    return Waypoints(points, _rotations(file, table), times, _begins(file, table))


def _begins(file: str | File, table: pd.DataFrame) -> tuple[int, ...]:
    """Where another value stands in the column segment than in the row before."""
    if SEGMENT not in table:
        return (0,)
    labels = table[SEGMENT].fillna("").str.strip().to_numpy()
    begins = np.flatnonzero(np.concatenate([[True], labels[1:] != labels[:-1]]))
    named = labels[begins]
    if len(set(named)) < len(named):
        again = next(name for i, name in enumerate(named) if name in named[:i])
        raise PathError(f"path.file = {file}: segment {again} comes twice; the rows of a segment stand together")
    short = np.flatnonzero(np.diff([*begins, len(labels)]) < 2)
    if short.size:
        raise PathError(f"path.file = {file}: segment {named[short[0]]} has 1 way-point, at least 2 are needed")
    return tuple(map(int, begins))


def _table(file: File) -> pd.DataFrame:
    if not file.is_file():
        raise PathError(f"path.file = {file}: no such file")
    try:
        with file.open(encoding="utf-8-sig", newline="") as opened:
            lines = (line.partition("#")[0] for line in opened)
            header = next(csv.reader((line for line in lines if line.strip()), skipinitialspace=True), [])
        names = [name.strip() for name in header]
        if names and all(re.fullmatch(r"[+-]?[0-9.]+(e[+-]?[0-9]+)?", name) for name in names):
            raise PathError(
                f"path.file = {file}: the first row is {', '.join(names)}; expected a header that names the columns"
            )
        repeated = sorted({name for name in names if names.count(name) > 1})
        if repeated:
            raise PathError(f"path.file = {file}: the header has the column {', '.join(repeated)} twice")
        table = pd.read_csv(file, skipinitialspace=True, comment="#", dtype=str, nrows=MOST + 1, encoding="utf-8-sig")
    except (ValueError, OSError, csv.Error) as error:
        if isinstance(error, PathError):
            raise
        raise PathError(f"path.file = {file}: not a CSV table ({str(error).splitlines()[0]})") from None
    if not isinstance(table.index, pd.RangeIndex):
        raise PathError(f"path.file = {file}: the rows of the data hold more values than the header has columns")
    if len(table) > MOST:
        raise PathError(
            f"path.file = {file}: more than {MOST:,} way-points; a smooth curve needs fewer, so thin them out"
        )
    table.columns = pd.Index(names)
    return table


def _check_header(file: str | File, header: Sequence[str], axes: Sequence[str]) -> None:
    missing = [name for name in axes if name not in header]
    if missing:
        raise PathError(
            f"path.file = {file}: no column {', '.join(missing)}; the header is {', '.join(header)}, needed are "
            f"{', '.join(axes)}"
        )
    both = [any(name in header for name in kind) for kind in (ROLL_PITCH_YAW, QUATERNION)]
    if all(both):
        raise PathError(
            f"path.file = {file}: orientations of two kinds, {', '.join(ROLL_PITCH_YAW)} and {', '.join(QUATERNION)}; "
            "one is enough"
        )
    for kind, there in zip((ROLL_PITCH_YAW, QUATERNION), both, strict=True):
        lacking = [name for name in kind if name not in header]
        if there and lacking:
            only = ", ".join(name for name in kind if name in header)
            raise PathError(
                f"path.file = {file}: an orientation needs the columns {', '.join(kind)}; the header has {only}, and "
                f"no {', '.join(lacking)}"
            )
    known = (*axes, *ROLL_PITCH_YAW, *QUATERNION, TIME, SEGMENT)
    unknown = [name for name in header if name not in known]
    if unknown:
        close = difflib.get_close_matches(unknown[0].lower(), known, n=1, cutoff=0.75)
        hint = f"did you mean {close[0]}? " if close else ""
        named = ", ".join(name or "(no name)" for name in unknown)
        raise PathError(
            f"path.file = {file}: column{'s' * (len(unknown) > 1)} {named} not understood; {hint}needed are "
            f"{', '.join(axes)}; beside them there may be {', '.join(ROLL_PITCH_YAW)} or {', '.join(QUATERNION)}, "
            f"{TIME} and {SEGMENT}"
        )


def _numbers(file: str | File, table: pd.DataFrame, names: Sequence[str]) -> Array:
    values = table[list(names)].apply(pd.to_numeric, errors="coerce").to_numpy(dtype=float)
    bad = np.flatnonzero(~(np.abs(values) <= LARGEST).all(axis=1))
    if bad.size:
        raise PathError(
            f"path.file = {file}: row {bad[0] + 1} of the data holds a value that is not a finite number of at most "
            f"{LARGEST:g} in size"
        )
    return values


def _rotations(file: str | File, table: pd.DataFrame) -> Rotation | None:
    if ROLL_PITCH_YAW[0] in table:
        return Rotation.from_euler("xyz", _numbers(file, table, ROLL_PITCH_YAW))
    if QUATERNION[0] not in table:
        return None
    values = _numbers(file, table, QUATERNION)
    zero = np.flatnonzero(np.linalg.norm(values, axis=1) < 1e-9)
    if zero.size:
        raise PathError(f"path.file = {file}: row {zero[0] + 1} of the data holds a quaternion of length zero")
    return Rotation.from_quat(values)


def _times(file: str | File, table: pd.DataFrame) -> Array:
    times: Array = _numbers(file, table, [TIME])[:, 0]
    back = np.flatnonzero(np.diff(times) <= 0)
    if back.size:
        row = back[0] + 1
        raise PathError(
            f"path.file = {file}: time does not increase from row {row} to row {row + 1} of the data "
            f"({times[row - 1]:g} s, {times[row]:g} s)"
        )
    return times
