"""The XML of robot files: as ROS and Drake read it, without namespaces, so that a prefix need not be bound."""

from __future__ import annotations

import xml.etree.ElementTree as ET
from pathlib import Path
from xml.parsers import expat

from pipeline.common.errors import RobotError

DEEPEST = 100  # elements within elements: no robot has more, and what walks the tree is recursive


def parse(data: bytes, file: Path, key: str = "robot.urdf") -> ET.Element:
    """The root element of `data`; raises RobotError, one line, which names `key` and `file`."""
    builder, depth = ET.TreeBuilder(), 0
    parser = expat.ParserCreate()
    parser.buffer_text = True

    def start(tag: str, attributes: dict[str, str]) -> None:
        nonlocal depth
        depth += 1
        if depth > DEEPEST:
            raise RobotError(f"{key} = {file}: more than {DEEPEST} elements within one another")
        builder.start(tag, attributes)

    def end(tag: str) -> None:
        nonlocal depth
        depth -= 1
        builder.end(tag)

    parser.StartElementHandler = start
    parser.EndElementHandler = end
    parser.CharacterDataHandler = builder.data
    try:
        parser.Parse(data.lstrip(b" \t\r\n"), True)
    except (expat.ExpatError, LookupError, ValueError) as error:  # ValueError: an encoding of several bytes
        raise RobotError(f"{key} = {file}: not well-formed XML ({error})") from None
    return builder.close()


def only(element: ET.Element, tag: str, where: str) -> ET.Element | None:
    """The one element of a tag, or None; raises RobotError for several that say different things."""
    found = element.findall(tag)
    if len({ET.tostring(one).strip() for one in found}) > 1:
        raise RobotError(f"{where} {len(found)} different <{tag}>; one is enough")
    return found[0] if found else None
