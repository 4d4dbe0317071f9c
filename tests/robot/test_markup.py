from __future__ import annotations

from pathlib import Path

import pytest

from pipeline.common.errors import RobotError
from pipeline.robot.markup import parse

FILE = Path("arm.urdf")


def test_prefixes_need_no_meaning() -> None:
    root = parse(
        b'\n <robot xmlns="http://www.ros.org"><sensor:camera name="c"/><link name="a">text</link></robot>', FILE
    )
    assert [root.tag, *(child.tag for child in root)] == ["robot", "sensor:camera", "link"]
    assert root[1].text == "text"


@pytest.mark.parametrize(
    "data",
    [b"", b"<robot>", b"<robot/><robot/>", b'<?xml version="1.0" encoding="none"?><r/>', b"\xff\xfe\x00",
     b'<a b="1" b="2"/>',     b"<a>&nothing;</a>", b"<a>\xff</a>", b"<a>" * 5000 + b"</a>" * 5000],
)  # fmt: skip
def test_what_is_no_document_is_one_line(data: bytes) -> None:
    with pytest.raises(RobotError, match=r"^robot\.urdf = arm\.urdf: ") as caught:
        parse(data, FILE)
    assert "\n" not in str(caught.value)


def test_entities_do_not_grow_without_end() -> None:
    """A billion words out of a few hundred bytes."""
    entities = "".join(f'<!ENTITY e{i} "{f"&e{i - 1};" * 10 if i else "word"}">' for i in range(10))
    with pytest.raises(RobotError, match="not well-formed"):
        parse(f"<!DOCTYPE r [{entities}]><r>&e9;</r>".encode(), FILE)
