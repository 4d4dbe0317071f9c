"""An MJCF model as a `Tree`. Included files, default classes and names are resolved here, since Drake's reader takes no
class whose parent alone states a default; Drake then places the frames and weighs bodies that are given by shapes.

A site is a link without mass, so that it can be the end effector. Tendons, sensors and contacts are dropped.
"""

from __future__ import annotations

import xml.etree.ElementTree as ET
from collections.abc import Mapping
from pathlib import Path

from pydrake.multibody.plant import MultibodyPlant

from pipeline.common.errors import RobotError
from pipeline.robot.formats import plant as drake
from pipeline.robot.markup import parse
from pipeline.robot.numbers import Vector, number, numbers
from pipeline.robot.tree import Inertial, Link, Mimic, Tree, moments_of

TURNS = ("quat", "euler", "axisangle", "xyaxes", "zaxis")
COUNTS: dict[str, int | tuple[int, ...]] = {
    **{"pos": 3, "quat": 4, "euler": 3, "axisangle": 4, "xyaxes": 6, "zaxis": 3, "axis": 3, "range": 2, "ref": 1},
    **{"mass": 1, "density": 1, "diaginertia": 3, "fullinertia": 6, "fromto": 6, "armature": 1, "size": (1, 2, 3)},
    **{"gear": (1, 2, 3, 4, 5, 6), "forcerange": 2, "ctrlrange": 2, "actuatorfrcrange": 2},
}
KEPT = {  # what Drake is given
    "compiler": ("angle", "eulerseq", "autolimits"),
    "body": ("name", "pos", *TURNS),
    "joint": ("name", "type", "pos", "axis", "range", "limited", "ref"),
    "freejoint": ("name",),
    "geom": ("type", "size", "fromto", "pos", "mass", "density", *TURNS),
}
ACTUATORS = ("general", "motor", "position", "velocity", "intvelocity", "damper")
REFUSED = {  # settings of <compiler> that change what bodies weigh or where they are, and their harmless values
    "coordinate": ("local",),
    "inertiafromgeom": ("auto", "false"),
    "settotalmass": ("-1",),
    "boundmass": ("0",),
    "boundinertia": ("0",),
    "balanceinertia": ("false",),
    "inertiagrouprange": ("0 5",),
}
DEEPEST = 20  # files within files
INERTIAL = " (inertial)"  # what the axes of a body's <inertial> are called while Drake places them

Classes = Mapping[str, Mapping[str, Mapping[str, str]]]


def read(root: ET.Element, file: Path, end_effector: str) -> Tree:
    """The bodies of a <mujoco> element that carry `end_effector`, from the world on; raises RobotError, one line."""
    tree = Tree(root.get("model") or file.stem, file)
    _include(root, file, tree, 0)
    for compiler in root.findall("compiler"):
        for key, harmless in REFUSED.items():
            if compiler.get(key, harmless[0]) not in harmless:
                raise tree.fail(f"<compiler {key}={compiler.get(key)!r}> is not read; allowed: {', '.join(harmless)}")
    classes = _classes(root)
    tops = [body for world in root.findall("worldbody") for body in world.findall("body")]
    if not tops:
        raise tree.fail("it holds no <body> in its <worldbody>")
    for index, body in enumerate(tops):
        _resolve(body, f"body{index}", "main", classes, tree)
    named = ("body", "site")
    top = next((b for b in tops if any(e.get("name") == end_effector and e.tag in named for e in b.iter())), tops[0])
    if others := [body.get("name", "") for body in tops if body is not top]:
        tree.notes.append(f"{', '.join(others)}: not of this robot, left out")
    links: dict[str, Link] = {}
    flat = ET.Element("mujoco", model="robot")
    for compiler in root.findall("compiler"):
        flat.append(_kept(compiler))
    ET.SubElement(flat, "worldbody").append(_flat(top, links, tree))
    plant, models = drake.made(tree, ET.tostring(flat, encoding="unicode"), "xml", {})
    _weigh(plant, links)
    bodies = {link for link in links if link.endswith(INERTIAL)}
    drake.fill(tree, plant, models, lambda thing: str(thing.name()), links)
    for link in bodies:
        axes = next(one for one in tree.joints.values() if one.child == link)
        inertial = links[link].inertial
        del tree.joints[axes.name], tree.links[link]
        assert inertial is not None
        tree.links[axes.parent].inertial = Inertial(inertial.mass, axes.xyz, axes.rpy, inertial.moments)
    efforts = _efforts(root, classes, tree)
    for element in top.iter("joint"):
        if (joint := tree.joints.get(element.get("name", ""))) is not None:
            joint.armature = float(element.get("armature", "0"))
            joint.limit = {**joint.limit, **efforts.get(joint.name, {})}
    _couple(root, tree)
    return tree


def _include(element: ET.Element, file: Path, tree: Tree, depth: int) -> None:
    """Put what included files hold in the place of <include>."""
    if depth > DEEPEST:
        raise tree.fail(f"files that include one another, more than {DEEPEST} deep")
    for index in reversed(range(len(element))):
        child = element[index]
        if child.tag != "include":
            _include(child, file, tree, depth)
            continue
        inner = file.parent / child.get("file", "")
        if not inner.is_file():
            raise tree.fail(f"the included file '{child.get('file', '')}' was not found")
        inside = parse(inner.read_bytes(), inner)
        _include(inside, inner, tree, depth + 1)
        element[index : index + 1] = list(inside)


def _classes(root: ET.Element) -> Classes:
    """What each default class states of each tag, with what it has from the classes around it."""
    classes: dict[str, dict[str, dict[str, str]]] = {"main": {}}

    def add(default: ET.Element, name: str, outer: Mapping[str, Mapping[str, str]]) -> None:
        own = {tag: dict(values) for tag, values in outer.items()}
        for child in default:
            if child.tag != "default":
                # One set of defaults serves all actuators, whatever they are called.
                tag = "general" if child.tag in ACTUATORS else child.tag
                own[tag] = _over(own.get(tag, {}), child)
        classes[name] = own
        for child in default.findall("default"):
            add(child, child.get("class", ""), own)

    for default in root.findall("default"):
        add(default, default.get("class", "main"), classes["main"])
    return classes


def _over(defaults: Mapping[str, str], element: ET.Element) -> dict[str, str]:
    """An element's attributes over its defaults: one way to state an orientation takes the place of another."""
    replaced = TURNS if any(turn in element.attrib for turn in TURNS) else ()
    return {**{key: value for key, value in defaults.items() if key not in replaced}, **element.attrib}


def _stated(element: ET.Element, outer: str, classes: Classes, tree: Tree) -> dict[str, str]:
    """The attributes of an element with those of its class, its numbers checked."""
    name = element.get("class", outer)
    if name not in classes:
        raise tree.fail(f"<{element.tag}> '{element.get('name', '')}' is of class '{name}', which no <default> states")
    tag = "general" if element.tag in ACTUATORS else element.tag
    stated = _over(classes[name].get(tag, {}), element)
    for key in COUNTS.keys() & stated.keys():
        numbers(
            stated[key],
            COUNTS[key],
            f"robot.urdf = {tree.file}: {element.tag} '{stated.get('name', '')}' has the {key}",
        )
    return stated


def _resolve(body: ET.Element, fallback: str, outer: str, classes: Classes, tree: Tree) -> None:
    """Give a body, its joints and sites names, and all that is in it the attributes of its class."""
    name = body.attrib.setdefault("name", fallback)
    _stated(body, outer, {outer: {}, body.get("class", outer): {}}, tree)
    inner = body.get("childclass", outer)
    for index, child in enumerate(body):
        if child.tag == "body":
            _resolve(child, f"{name}_{index}", inner, classes, tree)
        elif child.tag in ("joint", "freejoint", "geom", "site", "inertial"):
            if child.tag in ("joint", "freejoint", "site"):
                child.attrib.setdefault("name", f"{name}_{child.tag}{index}")
            child.attrib |= _stated(child, inner, classes, tree)
        elif child.tag in ("frame", "replicate", "attach", "composite", "flexcomp"):
            raise tree.fail(f"body '{name}' holds a <{child.tag}>, which is not read; write out what it stands for")


def _kept(element: ET.Element) -> ET.Element:
    return ET.Element(element.tag, {key: element.attrib[key] for key in KEPT[element.tag] if key in element.attrib})


def _flat(body: ET.Element, links: dict[str, Link], tree: Tree) -> ET.Element:
    """The body as Drake is given it; `links` gets what the file says of it and of its inertial's axes and sites."""
    made, inertial = _kept(body), body.find("inertial")
    link = links[made.attrib["name"]] = Link(made.attrib["name"], solid=body.find("geom") is not None)
    for child in body:
        if child.tag in ("joint", "freejoint"):
            made.append(_kept(child))
        elif child.tag == "body":
            made.append(_flat(child, links, tree))
        elif child.tag == "site":
            made.append(_place(child, child.attrib["name"]))
            links[child.attrib["name"]] = Link(child.attrib["name"])
        elif child.tag == "geom" and inertial is None and _weighs(child):
            made.append(_kept(child))
            if child.get("type") == "mesh" or "mesh" in child.attrib or child.get("shellinertia") == "true":
                link.unknown = "its mass is that of a mesh or of a shell, which is not computed; give it an <inertial>"
                made.remove(made[-1])
    if inertial is not None:
        name = f"{link.name}{INERTIAL}"
        made.append(_place(inertial, name))
        links[name] = Link(name, _inertial(inertial, f"robot.urdf = {tree.file}: body '{link.name}' has"))
    return made


def _place(element: ET.Element, name: str) -> ET.Element:
    """A body without mass where an <inertial> or <site> has its axes."""
    return ET.Element("body", {"name": name, **{k: element.attrib[k] for k in ("pos", *TURNS) if k in element.attrib}})


def _weighs(geom: ET.Element) -> bool:
    heavy = geom.get("mass", geom.get("density", "1000"))
    return float(heavy) > 0.0 and geom.get("type") not in ("plane", "hfield")


def _inertial(inertial: ET.Element, where: str) -> Inertial:
    moments: Vector = (0.0,) * 6
    if "fullinertia" in inertial.attrib:
        if turned := [turn for turn in TURNS if turn in inertial.attrib]:
            raise RobotError(
                f"{where} the fullinertia and a {turned[0]} of its axes, which MuJoCo refuses; give one of them"
            )
        moments = numbers(inertial.attrib["fullinertia"], 6, f"{where} the fullinertia")
    elif "diaginertia" in inertial.attrib:
        moments = (*numbers(inertial.attrib["diaginertia"], 3, f"{where} the diaginertia"), 0.0, 0.0, 0.0)
    return Inertial(number(inertial.get("mass", ""), f"{where} the mass"), moments=moments)


def _weigh(plant: MultibodyPlant, links: Mapping[str, Link]) -> None:
    """Give the links without an <inertial> what Drake makes of their shapes."""
    for link in links.values():
        body = plant.GetBodyByName(link.name)
        if body.default_mass() > 0.0 and f"{link.name}{INERTIAL}" not in links:
            center = body.default_com()
            about = body.default_spatial_inertia().Shift(center).CalcRotationalInertia().CopyToFullMatrix3()
            link.inertial = Inertial(body.default_mass(), tuple(center.tolist()), moments=moments_of(about))


def _efforts(root: ET.Element, classes: Classes, tree: Tree) -> dict[str, dict[str, str]]:
    """The largest force or torque that actuators, or joints themselves, allow at each joint."""
    most: dict[str, float] = {}
    for section in root.findall("actuator"):
        for actuator in section:
            if actuator.tag not in ACTUATORS or "joint" not in actuator.attrib:
                continue
            stated = _stated(actuator, "main", classes, tree)
            gear = abs(float(stated.get("gear", "1").split()[0]))
            largest = _largest(stated, "forcerange", "forcelimited")
            if actuator.tag == "motor" and largest is None:
                largest = _largest(stated, "ctrlrange", "ctrllimited")
            if largest is not None:
                most[stated["joint"]] = most.get(stated["joint"], 0.0) + gear * largest
    for joint in root.iter("joint"):
        largest = _largest(joint.attrib, "actuatorfrcrange", "actuatorfrclimited")
        name = joint.get("name", "")
        if largest is not None:
            most[name] = min(most.get(name, largest), largest)
    return {name: {"effort": repr(value)} for name, value in most.items()}


def _largest(stated: Mapping[str, str], key: str, limited: str) -> float | None:
    """The larger end of a range in absolute value; None where there is none, which MuJoCo also writes as 0 0."""
    if key not in stated or stated.get(limited) == "false":
        return None
    return max(abs(float(word)) for word in stated[key].split()) or None


def _couple(root: ET.Element, tree: Tree) -> None:
    """<equality><joint>: joint1 = p0 + p1 joint2 + ...; with one joint alone it stands at p0."""
    for element in root.iterfind("equality/joint"):
        name, leader = element.get("joint1", ""), element.get("joint2", "")
        where = f"robot.urdf = {tree.file}: the equality of joint '{name}' has the polycoef"
        factors = (*numbers(element.get("polycoef", "0 1 0 0 0"), (1, 2, 3, 4, 5), where), 0.0, 0.0, 0.0, 0.0)[:5]
        if name not in tree.joints or element.get("active") == "false":
            continue
        if any(factors[2:]) or not leader:
            raise tree.fail(f"the equality of joint '{name}' is no straight line from another joint, which is not read")
        tree.joints[name].mimic = Mimic(leader, factors[1], factors[0])
