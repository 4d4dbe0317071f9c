"""An arm's links in a recording: shapes, meshes and their transforms."""

from __future__ import annotations

import logging
import xml.etree.ElementTree as ET
from collections.abc import Iterable, Iterator, Sequence
from contextlib import contextmanager
from functools import cache
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np
import rerun as rr
from rerun.urdf import UrdfTree
from scipy.spatial.transform import Rotation

from pipeline.artifacts.recording.picture import picture
from pipeline.common.arrays import Array
from pipeline.model.arm import Arm

SHAPES = ("Boxes3D", "Cylinders3D", "Capsules3D", "Ellipsoids3D")


_log = logging.getLogger(__name__)


@contextmanager
def strict() -> Iterator[None]:
    """Errors in what is logged raise; by default Rerun drops the data with a warning."""
    before = rr.strict_mode()
    rr.set_strict_mode(True)
    try:
        yield
    finally:
        rr.set_strict_mode(before)


def columns(time: Array) -> list[Any]:
    """The time line: rounded, because Rerun cuts seconds off to whole nanoseconds."""
    return [rr.TimeColumn("time", duration=np.rint(time * 1e9).astype("timedelta64[ns]"))]


def draw_arm(
    recording: Any,
    arm: Arm,
    root: str,
    color: tuple[int, ...],
    time: list[Any],
    q: Array,
    base: tuple[Array, Array] | None = None,
) -> None:
    """The arm's picture at q (K, n) on the time line, below the entity `root`; base: the root link's positions (K, 3)
    and rotations (K, 3, 3) where it moves.
    """
    description = arm.description
    try:
        xml, notes = picture(description)
        for note in notes:
            _note(note)
        if not xml:
            return
        with TemporaryDirectory() as folder:
            file = Path(folder) / "picture.urdf"
            file.write_text(xml, encoding="utf-8")
            tree = UrdfTree.from_file_path(file, entity_path_prefix=root, frame_prefix=f"{root}/")
            chunks = list(tree.stream(include_joint_transforms=False))
        joints = {joint.name: joint for joint in tree.joints()}
        moving = [
            joints[name].compute_transform_columns(column, clamp=False)
            for name, column in zip(description.actuated, q.T, strict=True)
        ]
    except Exception as error:
        _log.warning("%s cannot be drawn (%s): the recording shows stick figures only", description.file, error)
        return
    recording.send_chunks(chunks)
    for entity, shape in _shapes(chunks):
        if shape == "Asset3D":
            recording.log(entity, rr.Asset3D.from_fields(albedo_factor=color), static=True)
        else:
            solid = getattr(rr, shape).from_fields(colors=[color], fill_mode="solid")
            recording.log(entity, solid, static=True)
    stand = rr.Transform3D(
        translation=arm.mounting.base_position,
        quaternion=Rotation.from_euler("xyz", arm.mounting.base_rpy).as_quat(),
        parent_frame="tf#/",
        child_frame=f"{root}/{description.base}",
    )
    # Without it an arm with frames of its own is not shown.
    if base is None:
        recording.log(f"{root}/tf/base", stand, static=True)
    else:
        frames = {"parent_frame": ["tf#/"] * len(q), "child_frame": [f"{root}/{description.base}"] * len(q)}
        turned = Rotation.from_matrix(base[1]).as_quat()
        moved = rr.Transform3D.columns(translation=base[0], quaternion=turned, **frames)
        recording.send_columns(f"{root}/tf/base", time, moved)
    for joint, transform in _rigid(description.xml, description.joints, root):
        recording.log(_transform(root, joint), transform, static=True)
    for joint, columns in zip(description.actuated, moving, strict=True):
        recording.send_columns(_transform(root, joint), time, columns)


@cache
def _note(text: str) -> None:
    """Said once: a run draws the same arm many times."""
    _log.warning("note: %s", text)


def _transform(root: str, joint: str) -> str:
    return rr.new_entity_path([root, "tf", "joints", joint])


def _shapes(chunks: Iterable[Any]) -> set[tuple[str, str]]:
    """The (entity, archetype) pairs that have a colour to set."""
    names = {(c.entity_path, column.split(":")[0]) for c in chunks for column in c.to_record_batch().schema.names}
    return {(entity, shape) for entity, shape in names if shape in (*SHAPES, "Asset3D")}


def _rigid(xml: str, moving: Sequence[str], root: str) -> Iterator[tuple[str, Any]]:
    """The joints that do not move, from the reduced URDF: there, locked ones stand where they are locked."""
    for joint in ET.fromstring(xml).findall("joint"):
        name, origin, parent, child = joint.get("name", ""), *map(joint.find, ("origin", "parent", "child"))
        if name in moving or parent is None or child is None:
            continue
        values = {} if origin is None else origin.attrib
        xyz, rpy = (np.array(values.get(key, "0 0 0").split(), dtype=float) for key in ("xyz", "rpy"))
        yield (
            name,
            rr.Transform3D(
                translation=xyz,
                quaternion=Rotation.from_euler("xyz", rpy).as_quat(),
                parent_frame=f"{root}/{parent.get('link')}",
                child_frame=f"{root}/{child.get('link')}",
            ),
        )
