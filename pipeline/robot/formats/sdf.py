"""An SDF model as a `Tree`. Drake places its frames; masses and limits are read here, since SDF's own defaults (1 kg
and 1 kg m^2 where nothing is stated) are no robot's. Pictures, meshes and plugins are dropped.

Names are those of links and joints; where nested models use one twice, those below the first come with their models.
"""

from __future__ import annotations

import xml.etree.ElementTree as ET
from collections import Counter
from collections.abc import Iterator, Mapping
from copy import deepcopy
from pathlib import Path
from typing import Any

import numpy as np
from pydrake.multibody.tree import BodyIndex
from scipy.spatial.transform import Rotation

from pipeline.common.errors import RobotError
from pipeline.robot import packages
from pipeline.robot.formats import plant as drake
from pipeline.robot.markup import only, parse
from pipeline.robot.numbers import SPACE, Vector, number, numbers, shown
from pipeline.robot.tree import MOMENTS, ZERO, Inertial, Link, Mimic, Tree

KEPT = {
    *("sdf", "world", "model", "link", "joint", "frame", "pose", "parent", "child", "axis", "axis2", "xyz", "include"),
    *("uri", "name", "placement_frame", "static", "use_parent_model_frame", "thread_pitch", "screw_thread_pitch"),
    *("drake:joint", "drake:parent", "drake:child", "drake:axis"),
}
# What stands at most once in a link or joint, or in those parts of it.
ONCE = {
    **dict.fromkeys(("inertial", "parent", "child", "axis", "pose", "mass", "inertia"), "inertial"),
    **dict.fromkeys(MOMENTS, "inertial/inertia"),
    **dict.fromkeys(("xyz", "limit", "mimic"), "axis"),
    **dict.fromkeys(("lower", "upper", "velocity", "effort"), "axis/limit"),
}
DEEPEST = 20  # files within files


def read(root: ET.Element, file: Path, end_effector: str) -> Tree:
    """The model of an <sdf> element that has the link `end_effector`, else its first; raises RobotError, one line."""
    tree = Tree(file.stem, file)
    found: dict[str, str] = {}
    tops = models(root, tree)
    stated = [{path: element for path, element, _ in scoped(top, file, (), tree, found)} for top in tops]
    wanted = end_effector.rpartition("::")[2]
    chosen = next((i for i, links in enumerate(stated) if any(path[-1] == wanted for path in links)), 0)
    for scope in (root, *root.findall("world")):
        for other in [model for model in scope if model in tops and model is not tops[chosen]]:
            scope.remove(other)
    elements = stated[chosen]
    root = deepcopy(root)
    joints = {path: joint for path, joint in elements.items() if joint.tag == "joint"}
    links = {path: link for path, link in elements.items() if link.tag == "link"}
    plant, made = placed(root, file, tree, found)
    top = plant.GetModelInstanceName(made[0])
    tree.name = top
    bodies = [plant.get_body(BodyIndex(index)) for index in range(plant.num_bodies())]
    instances = list(dict.fromkeys(b.model_instance() for b in bodies if b.index() != plant.world_body().index()))

    def path(thing: Any) -> tuple[str, ...]:
        scope = plant.GetModelInstanceName(thing.model_instance())[len(top) + 2 :]
        return (*(scope.split("::") if scope else ()), thing.name())

    twice = {n for n, count in Counter(p[-1] for p in links).items() if count > 1}

    def name(thing: Any) -> str:
        return "::".join(path(thing)) if thing.name() in twice else str(thing.name())

    said = {}
    for one, element in links.items():
        called = "::".join(one) if one[-1] in twice else one[-1]
        said[called] = _link(element, called, tree)
    drake.fill(tree, plant, instances, name, said)
    for one, element in joints.items():
        _complete(tree, one[-1], element)
    return tree


def models(root: ET.Element, tree: Tree) -> list[ET.Element]:
    """The models of an <sdf> element and of the worlds in it, and the includes of models; raises RobotError if none."""
    tops = [model for scope in (root, *root.findall("world")) for model in scope if model.tag in ("model", "include")]
    if not tops:
        raise tree.fail("the root element is <sdf> and holds no <model>; expected one, or <robot> for a URDF")
    if not root.get("version"):
        raise tree.fail(f"the element <{root.tag}> states no version; write <{root.tag} version='1.9'>")
    return tops


def placed(root: ET.Element, file: Path, tree: Tree, found: Mapping[str, str]) -> tuple[Any, list[Any]]:
    """Drake's plant of the frames of an <sdf> element, which is stripped of all else, and its models."""
    _strip(root)
    _absolute(root, file, tree)
    return drake.made(tree, ET.tostring(root, encoding="unicode"), "sdf", found)


def scoped(
    model: ET.Element, file: Path, scope: tuple[str, ...], tree: Tree, found: dict[str, str], depth: int = 0
) -> Iterator[tuple[tuple[str, ...], ET.Element, Path]]:
    """Links and joints as written, by their paths in the top model, those of included files too, and the file of each;
    their numbers checked.

    found: gets the folders of the packages that are named.
    """
    if depth > DEEPEST:
        raise tree.fail(f"files that include one another, more than {DEEPEST} deep")
    if model.tag == "include":
        uri = _text(model, "uri")
        inner = packages.model_file(uri, file.parent)
        if inner is None:
            return
        found |= packages.named_folder(uri, file.parent)
        for element in parse(inner.read_bytes(), inner).findall("model"):
            yield from scoped(element, inner, scope, tree, found, depth + 1)
        return
    for child in model:
        called = child.get("name", "") or _text(child, "name")
        if child.tag in ("link", "joint"):
            where = f"robot.urdf = {tree.file}: {child.tag} '{child.get('name')}' has"
            _refuse_twice(child, where)
            _check_poses(child, where)
            yield (*scope, called), child, file
        elif child.tag in ("model", "include"):
            merged = child.get("merge", "false") in ("true", "1")
            yield from scoped(child, file, scope if merged else (*scope, called), tree, found, depth + 1)


def _strip(element: ET.Element) -> None:
    for child in list(element):
        if child.tag in KEPT and not (child.tag == "axis" and element.get("type") == "fixed"):
            _strip(child)
        else:
            element.remove(child)


def _absolute(root: ET.Element, file: Path, tree: Tree) -> None:
    """Give included models the absolute names of their files."""
    for include in list(root.iter("include")):
        uri = include.find("uri")
        inner = packages.model_file(_text(include, "uri"), file.parent)
        if inner is None or uri is None:
            raise tree.fail(f"the included model {_text(include, 'uri') or 'without a uri'} was not found")
        uri.text = inner.absolute().as_uri()


def _link(element: ET.Element, name: str, tree: Tree) -> Link:
    link = Link(name, solid=element.find("visual") is not None or element.find("collision") is not None)
    inertial = element.find("inertial")
    if inertial is None:
        return link
    where = f"robot.urdf = {tree.file}: link '{name}' has"
    mass, inertia = inertial.find("mass"), inertial.find("inertia")
    stated = {key: inertia.findtext(key) for key in MOMENTS} if inertia is not None else {}
    missing = [key for key in ("ixx", "iyy", "izz") if stated.get(key) is None]
    if inertial.get("auto", "false") in ("true", "1"):
        link.unknown = "its inertia is to be computed from shapes (auto), which is not done; state mass and inertia"
    elif mass is None:
        link.unknown = "no <mass> in its <inertial>, and SDF's default of 1 kg is nobody's; state it"
    elif missing and number(mass.text or "", f"{where} the mass") > 0.0:
        named = "<inertia>" if inertia is None else ", ".join(f"<{key}>" for key in missing)
        link.unknown = f"no {named} in its <inertial>, and SDF's default of 1 kg m^2 is nobody's; state it"
    written = {key: "0" if stated.get(key) is None else stated[key] for key in MOMENTS}
    moments = tuple(number(text or "", f"{where} the inertia {key}") for key, text in written.items())
    place = pose(inertial.find("pose"), f"{where} in its inertial the pose")
    link.inertial = Inertial(0.0 if mass is None else number(mass.text or "", f"{where} the mass"), *place, moments)
    return link


def pose(element: ET.Element | None, where: str) -> tuple[Vector, Vector]:
    """xyz [m] and rpy [rad] of a <pose>; raises RobotError, which begins with `where`, for what is none."""
    text = "" if element is None else element.text or ""
    if element is None or not text.strip(SPACE):
        return ZERO, ZERO
    quaternion = element.get("rotation_format") == "quat_xyzw"
    values = numbers(text, 7 if quaternion else 6, where)
    if quaternion:
        if not any(values[3:]):
            raise RobotError(f"{where} '{shown(text)}', expected a quaternion that is not zero")
        return values[:3], tuple(Rotation.from_quat(values[3:]).as_euler("xyz").tolist())
    turn = np.deg2rad(values[3:]) if element.get("degrees") in ("true", "1") else np.array(values[3:])
    return values[:3], tuple(turn.tolist())


def _refuse_twice(element: ET.Element, where: str) -> None:
    """Of several elements that say different things Drake would take the first."""
    for tag, inner in ONCE.items():
        for holder in [element, *element.iterfind(inner)]:
            only(holder, tag, where)


def _check_poses(element: ET.Element, where: str) -> None:
    """What Drake is to read of a link or joint: its own pose and its axis."""
    pose(element.find("pose"), f"{where} the pose")
    for axis in element.findall("axis"):
        text = axis.findtext("xyz")
        if text is not None and element.get("type") != "fixed":
            numbers(text, 3, f"{where} in its axis the xyz")


def _complete(tree: Tree, name: str, element: ET.Element) -> None:
    """Give a joint what Drake does not keep: its limits as stated, and what it mimics."""
    joint, axis = tree.joints.get(name), element.find("axis")
    if joint is None or axis is None:
        return
    written = {key: axis.findtext(f"limit/{key}") for key in ("lower", "upper", "velocity", "effort")}
    joint.limit = {key: text for key, text in written.items() if text is not None}
    for key in ("velocity", "effort"):  # SDF has negative ones for none
        if (
            written[key] is not None
            and number(joint.limit[key], f"robot.urdf = {tree.file}: joint '{name}' has the {key} limit", infinite=True)
            < 0.0
        ):
            joint.limit = {k: text for k, text in joint.limit.items() if k != key}
    mimic = axis.find("mimic")
    if mimic is not None:
        where = f"robot.urdf = {tree.file}: joint '{name}' has in its mimic the"
        factor, offset, reference = (
            number(mimic.findtext(key, default), f"{where} {key}")
            for key, default in (("multiplier", "1"), ("offset", "0"), ("reference", "0"))
        )
        joint.mimic = Mimic(mimic.get("joint", ""), factor, offset - factor * reference)


def _text(element: ET.Element, tag: str) -> str:
    return (element.findtext(tag) or "").strip()
