"""A planar joint as the three that say the same: along two directions of its plane, then about its normal."""

from __future__ import annotations

import numpy as np
from scipy.spatial.transform import Rotation

from pipeline.robot.tree import ZERO, Joint, Link, Tree


def split_planar(tree: Tree) -> None:
    """Put joints <name>_x, <name>_y and <name>_yaw in the place of every planar joint, with links that have no mass.

    x and y are those of the joint's frame where its axis is z; else they are turned with z onto the axis.
    """
    for planar in [joint for joint in tree.joints.values() if joint.kind == "planar"]:
        size = float(np.linalg.norm(planar.axis))
        if size == 0.0:
            raise tree.fail(f"joint '{planar.name}' has an axis of zeros, expected the normal of its plane")
        turn = onto(np.array(planar.axis) / size)
        del tree.joints[planar.name]
        xyz, rpy, parent = planar.xyz, planar.rpy, planar.parent
        for suffix, kind, axis in (("x", "prismatic", 0), ("y", "prismatic", 1), ("yaw", "continuous", 2)):
            name = f"{planar.name}_{suffix}"
            child = planar.child if suffix == "yaw" else f"{name}_link"
            if suffix != "yaw":
                tree.add_link(Link(child))
            direction = tuple(turn.apply(np.eye(3)[axis]).tolist())
            tree.add_joint(Joint(name, kind, parent, child, xyz, rpy, direction))
            xyz, rpy, parent = ZERO, ZERO, child
        tree.notes.append(f"the planar joint {planar.name} is {planar.name}_x, {planar.name}_y and {planar.name}_yaw")
        if planar.limit:
            tree.notes.append(f"the limits of the planar joint {planar.name} are not used: they name no direction")


def onto(normal: np.ndarray) -> Rotation:
    """The shortest turn that takes z to `normal`; about x where it is half a turn."""
    axis = np.cross([0.0, 0.0, 1.0], normal)
    size = float(np.linalg.norm(axis))
    if size < 1e-12:
        return Rotation.from_rotvec([0.0 if normal[2] > 0 else np.pi, 0.0, 0.0])
    return Rotation.from_rotvec(axis / size * np.arctan2(size, normal[2]))
