"""conf/schema.json is current, and says of every key what it means, in which unit."""

from __future__ import annotations

import re
from collections.abc import Iterator
from typing import Any

import pytest
import yaml

from pipeline.config import __main__ as written
from pipeline.config.documents import Document
from pipeline.config.json_schema import json_schema, keys, kinds, meaning, resolved
from pipeline.config.run import RunConfig
from tests.support import ROOT

SCHEMA = json_schema(RunConfig)
UNIT = re.compile(r"#\s*\[([^\],]+)\]")  # in a comment of conf/


def leaves(root: dict[str, Any], node: dict[str, Any], where: str = "") -> Iterator[tuple[str, dict[str, Any]]]:
    """Every key that holds a value, with its node; of a choice between kinds those of all."""
    full = resolved(root, node)
    for table in kinds(root, full).values() or [full]:
        for key, one in keys(table).items():
            inner = resolved(root, one)
            if kinds(root, inner) or "properties" in inner:
                yield from leaves(root, one, f"{where}.{key}".lstrip("."))
            else:
                yield f"{where}.{key}".lstrip("."), inner


LEAVES = [*leaves(SCHEMA, SCHEMA)]


def test_the_file_is_current() -> None:
    """`make schema` writes it."""
    assert (written.FILE.parent / "config.yaml").is_file()
    assert written.FILE.read_text(encoding="utf-8") == written.text()


def test_every_key_says_what_it_means() -> None:
    assert len(LEAVES) > 120
    assert [key for key, node in LEAVES if not meaning(node)[1]] == []
    document = json_schema(Document)
    assert [key for key, node in leaves(document, document) if not meaning(node)[1]] == []


def test_units_are_those_of_the_files() -> None:
    """What a comment in conf/ says of a key and what the schema says of it are the same unit."""
    said = {}
    for file in sorted((ROOT / "conf").glob("*/*.yaml")):
        group, lines = file.parent.name, file.read_text(encoding="utf-8").splitlines()
        if group in ("experiment", "reproduction"):
            continue
        where = f"{group}.{file.stem}" if group == "method" else group
        for line in lines:
            unit = UNIT.search(line)
            if unit and re.match(r"[a-z]\w*:", line):
                said[f"{where}.{line.partition(':')[0]}"] = unit[1]
    units = {key: meaning(node)[0] for key, node in LEAVES}
    assert len(said) > 35
    assert {key: units[key] for key in said} == said


def test_bounds_and_words_are_there() -> None:
    nodes = dict(LEAVES)
    word, number = (resolved(SCHEMA, member) for member in nodes["timing.duration"]["anyOf"])
    assert (word["const"], number["exclusiveMinimum"]) == ("shortest", 0)
    assert (nodes["timing.steps"]["minimum"], nodes["timing.steps"]["maximum"]) == (2, 100_000)
    laws = ["raised_cosine", "constant_speed", "quintic", "cruise", "optimal", "from_file"]
    assert nodes["timing.law"]["enum"] == laws
    assert nodes["parallel.workers"]["nullable"]


@pytest.mark.parametrize("file", sorted((ROOT / "conf" / "experiment").glob("*.yaml")), ids=lambda file: file.stem)
def test_an_editor_finds_every_key_of_an_experiment(file: Any) -> None:
    """All tables of the schema are closed: a key that is not in it is marked."""
    root = written.schema()
    pending = [(root, yaml.safe_load(file.read_text(encoding="utf-8")))]
    while pending:
        node, values = pending.pop()
        full = resolved(root, node)
        tables = list(kinds(root, full).values()) or [full]
        if not any("properties" in table for table in tables):
            continue
        assert all(table["additionalProperties"] is False for table in tables)
        fitting = [table for table in tables if set(values) <= set(table["properties"])]
        assert fitting, set(values)
        pending += [(fitting[0]["properties"][key], one) for key, one in values.items() if isinstance(one, dict)]
