"""The paths of the problems in this folder: python -m tests.suite.problems.make_paths."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np

from pipeline.common.arrays import Array

FOLDER = Path(__file__).parent


def save(name: str, points: Array, segment: Sequence[str] = ()) -> None:
    """Rows x, y, z [m], and the tool path that each belongs to where there are several."""
    rows = [",".join(f"{value:.6f}" for value in point) for point in points]
    rows = [f"{row},{label}" for row, label in zip(rows, segment, strict=True)] if segment else rows
    head = "x,y,z,segment" if segment else "x,y,z"
    (FOLDER / f"{name}.csv").write_text("\n".join([head, *rows]) + "\n", encoding="utf-8")


def spiral(count: int) -> Array:
    """Five turns in the plane z = 0.3 m, from 0.03 to 0.15 m about (0.42, 0), way-points evenly spaced."""
    share = np.linspace(0.0, 1.0, 20_001)
    radius, angle = 0.03 + 0.12 * share, 10 * np.pi * share
    points = np.column_stack([0.42 + radius * np.cos(angle), radius * np.sin(angle), np.full_like(share, 0.3)])
    s = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(points, axis=0), axis=1))])
    return np.column_stack([np.interp(np.linspace(0.0, s[-1], count), s, column) for column in points.T])


def wave(count: int) -> Array:
    """A weld with a weave: 0.4 m along y, 8 mm to both sides."""
    y = np.linspace(-0.2, 0.2, count)
    return np.column_stack([0.45 + 0.008 * np.sin(2 * np.pi * y / 0.05), y, np.full_like(y, 0.25)])


def letters() -> tuple[Array, list[str]]:
    """L and T in the plane z = 0.25 m, in three strokes."""
    strokes = {
        "l": [(0.50, 0.10), (0.40, 0.10), (0.40, 0.04)],
        "t1": [(0.50, -0.02), (0.50, -0.10)],
        "t2": [(0.50, -0.06), (0.40, -0.06)],
    }
    points = np.array([(x, y, 0.25) for stroke in strokes.values() for x, y in stroke])
    return points, [name for name, stroke in strokes.items() for _ in stroke]


def main() -> None:
    """Write all of them."""
    save("spiral300", spiral(300))
    save("spiral2000", spiral(2000))
    save("weave", wave(321))
    save("letters", *letters())


if __name__ == "__main__":
    main()
