"""The picture of an arm for a viewer: its URDF with meshes that are there, by absolute names, and not too many bytes.

A mesh that is missing, or whose package is not known, is left out and noted; where a link's collision shapes can stand
in, they do. Big pictures (over LARGE bytes of meshes) give way to simpler ones: a recording holds one per motion.
"""

from __future__ import annotations

import xml.etree.ElementTree as ET
from pathlib import Path

from pipeline.robot.description import Description
from pipeline.robot.markup import parse
from pipeline.robot.packages import resolve

LARGE = 4_000_000  # bytes of meshes


SHOWN = (".stl", ".obj", ".dae", ".glb", ".gltf")


def picture(description: Description) -> tuple[str, list[str]]:
    """A URDF with visuals only, and one note for all that is missing; its links and joints have the file's names."""
    if description.file.suffix == ".sdf":
        return "", ["an SDF file's pictures are not drawn"]
    root = parse(description.file.read_bytes(), description.file)
    if root.tag != "robot":
        return "", [f"the pictures of a file with <{root.tag}> are not drawn"]
    _drop_foreign(root)
    _split_planar(root, description)
    parents = {parent.get("link") for parent in root.iterfind("joint/parent")}
    if "world" in parents - {link.get("name") for link in root.findall("link")}:
        root.insert(0, ET.Element("link", name="world"))
    missing: list[str] = []
    large = _resolve(root, "visual", description.file.parent, missing) > LARGE
    if large:
        large = _simplify(root) > LARGE
    _resolve(root, "collision", description.file.parent, [])
    for link in root.findall("link"):
        solids = [e for e in link.findall("collision") if e.find("geometry") is not None]
        if solids and (large or link.find("visual") is None):
            for visual in link.findall("visual"):
                link.remove(visual)
            for solid in solids:
                solid.tag = "visual"
        for collision in link.findall("collision"):
            link.remove(collision)
    if not missing:
        return ET.tostring(root, encoding="unicode"), []
    count = f"{len(missing)} meshes" if len(missing) > 1 else "1 mesh"
    named = missing[0] + ", ..." * (len(missing) > 1)
    note = f"{count} of {description.file.name} not found, drawn without ({named})"
    return ET.tostring(root, encoding="unicode"), [note]


def _split_planar(root: ET.Element, description: Description) -> None:
    """Put the three joints that a planar one is read as, and the links between them, in its place."""
    reduced = ET.fromstring(description.xml)
    for planar in [joint for joint in root.findall("joint") if joint.get("type") == "planar"]:
        root.remove(planar)
        own = {f"{planar.get('name')}_{axis}" for axis in ("x", "y", "yaw")}
        named = {"joint": own, "link": {f"{name}_link" for name in own}}
        for part in reduced:
            if part.get("name") in named.get(part.tag, ()):
                if part.get("type") == "prismatic":
                    ET.SubElement(part, "limit", lower="-1e9", upper="1e9", velocity="1e9", effort="1e9")
                root.append(part)


def _drop_foreign(root: ET.Element) -> None:
    """Take out simulators' blocks, which may use prefixes that are bound nowhere."""
    for child in list(root):
        if child.tag not in ("link", "joint", "material"):
            root.remove(child)
    for parent in list(root.iter()):
        for child in [child for child in parent if ":" in child.tag]:
            parent.remove(child)


def _simplify(root: ET.Element) -> int:
    """Take meshes/collision/<name>.stl for meshes/visual/<name>.*, where a package has both. Bytes in all."""
    size = 0
    for mesh in root.iterfind("link/visual/geometry/mesh"):
        file = Path(mesh.get("filename", ""))
        simple = file.parent.parent / "collision" / f"{file.stem}.stl"
        if file.parent.name == "visual" and simple.is_file():
            mesh.set("filename", str(simple))
            file = simple
        size += file.stat().st_size
    return size


def _resolve(root: ET.Element, tag: str, folder: Path, missing: list[str]) -> int:
    """Give the meshes of all elements `tag` their absolute names; those without a file go. Bytes in all."""
    size = 0
    for link in root.findall("link"):
        for element in link.findall(tag):
            mesh = element.find("geometry/mesh")
            if mesh is None:
                continue
            name = mesh.get("filename", "")
            file = resolve(name, folder)
            if file is None or not file.is_file() or file.suffix.lower() not in SHOWN:
                missing.append(name)
                link.remove(element)
                continue
            mesh.set("filename", str(file.resolve()))
            size += file.stat().st_size
    return size
