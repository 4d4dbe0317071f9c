"""The solids of a world: an SDF or a URDF of what stands still, each where it stands, meshes as their hulls.

Drake places the models of an SDF; shapes are read from the file. A model that is not static and has no joints stands
where it is put. What can move, and shapes that are not among those of `shapes.py`, are refused.
"""

from __future__ import annotations

import xml.etree.ElementTree as ET
from collections import Counter
from collections.abc import Iterator
from pathlib import Path

import numpy as np
from scipy.spatial.transform import Rotation

from pipeline.common.arrays import Array
from pipeline.common.errors import RobotError
from pipeline.robot import meshes
from pipeline.robot.formats import sdf, urdf
from pipeline.robot.markup import parse
from pipeline.robot.numbers import Vector, numbers
from pipeline.robot.packages import model_file, resolve
from pipeline.robot.planar import onto
from pipeline.robot.shapes import SIZES, SLAB, Shape
from pipeline.robot.tree import Tree

KEY = "obstacles.file"
ALLOWED = "sphere, box, cylinder, capsule, mesh, plane"
SEPARATOR = "::"  # of names, as in SDF


def read(file: Path) -> tuple[Shape, ...]:
    """The collision shapes in the world, called by their models or links; raises RobotError, one line."""
    if not file.is_file():
        raise RobotError(f"{KEY} = {file}: no such file")
    root = parse(file.read_bytes(), file, KEY)
    readers = {"sdf": _of_sdf, "gazebo": _of_sdf, "robot": _of_urdf}
    if root.tag not in readers:
        raise RobotError(f"{KEY} = {file}: the root element is <{root.tag}>, expected <sdf> or <robot> (URDF)")
    try:
        shapes = tuple(readers[root.tag](root, Tree(file.stem, file)))
    except RobotError as error:
        raise RobotError(str(error).replace("robot.urdf =", f"{KEY} =", 1)) from None
    if not shapes:
        raise RobotError(f"{KEY} = {file}: it holds no <collision>")
    return shapes


def _of_sdf(root: ET.Element, tree: Tree) -> Iterator[Shape]:
    found: dict[str, str] = {}
    tops = sdf.models(root, tree)
    every = [
        (path, element, file)
        for top in tops
        for path, element, file in sdf.scoped(top, tree.file, (_called(top, tree.file),), tree, found)
    ]
    for path, element, _ in every:
        if element.tag == "joint" and element.get("type") != "fixed":
            raise _moves(tree, SEPARATOR.join(path), element.get("type", ""))
    links = [(path, element, file) for path, element, file in every if element.tag == "link"]
    shapes = [(path, shape) for path, element, file in links for shape in _collisions(element, path, file, tree)]
    plant, _ = sdf.placed(root, tree.file, tree, found)
    context, count = plant.CreateDefaultContext(), Counter(path[:-1] for path, _, _ in links)
    for path, shape in shapes:
        model = plant.GetModelInstanceByName(SEPARATOR.join(path[:-1]))
        pose = plant.GetBodyByName(path[-1], model).EvalPoseInWorld(context)
        name = SEPARATOR.join(path if count[path[:-1]] > 1 else path[:-1])
        yield _named(shape, name, pose.rotation().matrix(), pose.translation())


def _called(top: ET.Element, file: Path) -> str:
    """The name of a model, or that which an <include> gives or leaves to its model."""
    if top.tag == "model":
        return top.get("name", "")
    inner = model_file((top.findtext("uri") or "").strip(), file.parent)
    given = (top.findtext("name") or "").strip()
    own = None if given or inner is None else parse(inner.read_bytes(), inner, KEY).find("model")
    return given if own is None else own.get("name", "")


def _collisions(link: ET.Element, path: tuple[str, ...], file: Path, tree: Tree) -> Iterator[Shape]:
    """The shapes of a link, in its frame."""
    for collision in link.findall("collision"):
        own = f"collision '{collision.get('name', '')}' of {SEPARATOR.join(path)}"
        where, place = f"robot.urdf = {tree.file}: {own} has", collision.find("pose")
        if place is not None and place.get("relative_to", "") not in ("", path[-1]):
            raise tree.fail(f"{own} is placed relative to '{place.get('relative_to')}', allowed: its link")
        xyz, rpy = sdf.pose(place, f"{where} the pose")
        turn = Rotation.from_euler("xyz", rpy)
        for solid in collision.iterfind("geometry/*"):
            kind, mesh = solid.tag, ""
            size: Vector = ()
            if kind == "empty":
                continue
            if solid.tag == "plane":
                normal = np.array(numbers(solid.findtext("normal", "0 0 1"), 3, f"{where} the plane's normal"))
                if not normal.any():
                    raise tree.fail(f"{own} is a plane whose normal is zero")
                kind, size, turn = "half_space", SLAB, turn * onto(normal / np.linalg.norm(normal))
            elif solid.tag == "mesh":
                if solid.find("submesh") is not None:
                    raise tree.fail(f"{own} is a <submesh>, which is not read; give it a file of its own")
                uri = (solid.findtext("uri") or "").strip()
                size = numbers(solid.findtext("scale", "1 1 1"), 3, f"{where} the scale")
                mesh = meshes.named(uri, resolve(uri, file.parent))
            elif solid.tag in SIZES:
                for key in SIZES[solid.tag]:
                    count = 3 if solid.tag == "box" else 1
                    size += numbers(solid.findtext(key, ""), count, f"{where} the {solid.tag}'s {key}")
            else:
                raise tree.fail(f"{own} is a <{solid.tag}>; allowed: {ALLOWED}")
            if kind != "mesh" and min(size) <= 0:
                raise tree.fail(f"{own} is a <{solid.tag}> without extent")
            yield Shape(path[-1], kind, size, xyz, tuple(map(float, turn.as_rotvec())), path[-1], mesh)


def _of_urdf(root: ET.Element, tree: Tree) -> Iterator[Shape]:
    tree = urdf.read(root, tree.file, "")
    carrier = tree.carriers()
    tree.root(carrier)
    for joint in tree.joints.values():
        if joint.kind != "fixed":
            raise _moves(tree, joint.name, joint.kind)

    def pose(link: str) -> tuple[Array, Array]:
        if link not in carrier:
            return np.eye(3), np.zeros(3)
        joint = carrier[link]
        rotation, position = pose(joint.parent)
        turn = Rotation.from_euler("xyz", joint.rpy).as_matrix()
        return rotation @ turn, rotation @ np.array(joint.xyz) + position

    for shape in tree.shapes:
        yield _named(shape, str(shape.frame), *pose(str(shape.frame)))


def _named(shape: Shape, name: str, rotation: Array, position: Array) -> Shape:
    moved = shape.moved(rotation, position)
    return Shape(name, moved.kind, moved.size, moved.position, moved.rotation, None, moved.file)


def _moves(tree: Tree, joint: str, kind: str) -> RobotError:
    return tree.fail(f"joint '{joint}' is of type '{kind}': only what stands still can be an obstacle; allowed: fixed")
