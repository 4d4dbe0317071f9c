"""The convex hulls of mesh files: STL, OBJ, PLY, OFF, GLB by trimesh, COLLADA (DAE) by pycollada."""

from __future__ import annotations

from functools import lru_cache
from pathlib import Path

import numpy as np
from scipy.spatial import ConvexHull, QhullError

from pipeline.common.arrays import Array
from pipeline.common.errors import RobotError

KEPT = 256  # hulls: those of several arms


def named(written: str, found: Path | None) -> str:
    """What a mesh is known by: its file, or where none was found its name as it is written."""
    return written if found is None else str(found.absolute())


@lru_cache(KEPT)
def hull(file: str) -> Array:
    """The corners (V, 3) [m] of the convex hull of a mesh file; raises RobotError, one line, which names the file."""
    path = Path(file)
    if not path.is_file():
        raise RobotError(f"the mesh {file} was not found")
    try:
        points = _collada(path) if path.suffix.lower() == ".dae" else _triangles(path)
    except Exception as error:  # readers of six formats raise what they like
        raise RobotError(f"the mesh {file} cannot be read ({' '.join(str(error).split())[:200]})") from None
    if not points.size or not np.isfinite(points).all():
        raise RobotError(f"the mesh {file} holds no triangles")
    try:
        corners = points[ConvexHull(points).vertices]
    except QhullError:
        raise RobotError(f"the mesh {file} is flat: it has no volume") from None
    corners.flags.writeable = False
    return np.asarray(corners)


def _triangles(path: Path) -> Array:
    """The points (V, 3) that a file's triangles have, its nodes where they stand."""
    import trimesh  # a tenth of a second that only a run with meshes pays

    mesh = trimesh.load_scene(path, process=False).to_mesh()
    return np.asarray(mesh.vertices[np.unique(mesh.faces)], dtype=float)


def _collada(path: Path) -> Array:
    """The same of a COLLADA document, in metres. Several meshes may share one list of points.

    Its <up_axis> is left alone, as ROS does: arms say Y_UP there and draw with z up (TIAGo's centres of mass show it).
    """
    import collada

    document = collada.Collada(str(path), ignore=[collada.common.DaeUnsupportedError, collada.common.DaeBrokenRefError])
    parts = [
        primitive.vertex[np.unique(primitive.vertex_index)]
        for geometry in document.scene.objects("geometry")
        for primitive in geometry.primitives()
        if primitive.vertex_index is not None and len(primitive.vertex_index)
    ]
    points = np.concatenate(parts) if parts else np.empty((0, 3))
    unit = document.assetInfo.unitmeter
    return np.asarray(points if unit is None else points * unit, dtype=float)
