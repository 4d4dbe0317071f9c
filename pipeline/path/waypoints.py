"""Way-points and their orientations from a CSV file."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path as File

import numpy as np
import pandas as pd
from scipy.spatial.transform import Rotation

from pipeline.common.arrays import Array
from pipeline.common.errors import PathError

ROLL_PITCH_YAW, QUATERNION = ("roll", "pitch", "yaw"), ("qx", "qy", "qz", "qw")


def read_waypoints(file: str | File, axes: Sequence[str]) -> Array:
    """The way-points (P, m) of a CSV file with one column for each of `axes` [m]; P >= 2, all finite, no repeats."""
    values = _columns(File(file), axes)
    if len(values) < 2:
        raise PathError(f"path.file = {file}: {len(values)} way-point{'s' * (len(values) != 1)}, at least 2 are needed")
    repeated = np.flatnonzero(np.linalg.norm(np.diff(values, axis=0), axis=1) < 1e-12)
    if repeated.size:
        raise PathError(f"path.file = {file}: way-points {repeated[0] + 1} and {repeated[0] + 2} are the same point")
    return values


def read_orientations(file: str | File) -> Rotation | None:
    """The orientations of the same rows: columns roll, pitch, yaw [rad] or qx, qy, qz, qw; None if there are none."""
    header = _table(File(file)).columns
    if set(ROLL_PITCH_YAW) <= set(header):
        return Rotation.from_euler("xyz", _columns(File(file), ROLL_PITCH_YAW))
    if set(QUATERNION) <= set(header):
        values = _columns(File(file), QUATERNION)
        zero = np.flatnonzero(np.linalg.norm(values, axis=1) < 1e-9)
        if zero.size:
            raise PathError(f"path.file = {file}: row {zero[0] + 1} of the data holds a quaternion of length zero")
        return Rotation.from_quat(values)
    return None


def _table(file: File) -> pd.DataFrame:
    if not file.is_file():
        raise PathError(f"path.file = {file}: no such file")
    try:
        table = pd.read_csv(file, skipinitialspace=True, comment="#")
    except (ValueError, OSError) as error:
        raise PathError(f"path.file = {file}: not a CSV table ({str(error).splitlines()[0]})") from None
    if not isinstance(table.index, pd.RangeIndex):
        raise PathError(f"path.file = {file}: the rows of the data hold more values than the header has columns")
    return table


def _columns(file: File, names: Sequence[str]) -> Array:
    table = _table(file)
    missing = [name for name in names if name not in table.columns]
    if missing:
        raise PathError(
            f"path.file = {file}: no column {', '.join(missing)}; the header is {', '.join(map(str, table.columns))}, "
            f"needed are {', '.join(names)}"
        )
    values = table[list(names)].apply(pd.to_numeric, errors="coerce").to_numpy(dtype=float)
    bad = np.flatnonzero(~np.isfinite(values).all(axis=1))
    if bad.size:
        raise PathError(f"path.file = {file}: row {bad[0] + 1} of the data holds a value that is not a finite number")
    return values
