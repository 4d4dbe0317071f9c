"""Random lines of the Panda as data (lines.csv), and whether its motions touch the arm itself by coal.

Links, meshes and poses are pinocchio's, distances coal's, of the meshes' hulls: nothing here is ours.
"""

from __future__ import annotations

import csv
from collections.abc import Iterator
from functools import cache
from pathlib import Path
from typing import Any

import coal
import numpy as np
import pinocchio as pin

from pipeline.common.arrays import Array
from pipeline.robot.packages import locate

HERE = Path(__file__).parent
WORDS = ("robot=panda", "limits=joint", "timing.duration=4", "timing.steps=40", "path=line", "path.length=0.4")
FOLDER = "package://example-robot-data/robots/panda_description"


def lines() -> Iterator[tuple[str, tuple[str, ...]]]:
    """Names and words of the command line; every start is clear of the arm itself."""
    with (HERE / "lines.csv").open(encoding="utf-8") as file:
        for row in csv.DictReader(file):
            yield row["name"], (*WORDS, f"robot.q_init={row['q_init']}", f"path.direction={row['direction']}")


@cache
def model() -> tuple[Any, Any]:
    """The arm of the package, its fingers closed, and the hulls whose collisions its SRDF does not disable."""
    file, srdf = locate(f"{FOLDER}/urdf/panda.urdf", "urdf"), locate(f"{FOLDER}/srdf/panda.srdf", "srdf")
    whole = pin.buildModelFromUrdf(str(file))
    shares = [str(file.parents[4]), str(file.parents[3].parent)]
    solids = pin.buildGeomFromUrdf(whole, str(file), pin.GeometryType.COLLISION, package_dirs=shares)
    for solid in solids.geometryObjects:
        if isinstance(solid.geometry, coal.BVHModelBase):
            solid.geometry.buildConvexHull(True, "Qt")
            solid.geometry = solid.geometry.convex
    solids.addAllCollisionPairs()
    pin.removeCollisionPairs(whole, solids, str(srdf))
    return whole, solids


def least(q: Array) -> float:
    """The smallest distance [m] between links at q (K, 7); negative where they overlap."""
    whole, solids = model()
    data, apart = whole.createData(), solids.createData()
    found = np.inf
    for one in q:
        pin.computeDistances(whole, data, solids, apart, np.concatenate([one, np.zeros(whole.nq - 7)]))
        found = min(found, *(result.min_distance for result in apart.distanceResults))
    return float(found)
