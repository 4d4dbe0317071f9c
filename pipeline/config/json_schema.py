"""The JSON schema of a checked dataclass: what messages and help read, and what editors read in conf/schema.json."""

from __future__ import annotations

import re
from collections.abc import Mapping
from typing import Any

Node = Mapping[str, Any]  # a schema, or a part of one

BOUNDS = {"ge": "minimum", "le": "maximum"}  # pydantic's own words stay where a validator comes before the check


def json_schema(cls: type[Any]) -> dict[str, Any]:
    """Without titles and defaults of whole tables; a table that holds only some of the keys of a kind passes."""
    from pydantic import TypeAdapter  # only where a schema is asked for: it takes a tenth of a second to load

    found: dict[str, Any] = _trimmed(TypeAdapter(cls).json_schema())
    return found


def _trimmed(node: Any) -> Any:
    if isinstance(node, list):
        return [_trimmed(entry) for entry in node]
    if not isinstance(node, dict):
        return node
    kept = {}
    for key, value in node.items():
        if key == "properties":
            kept[key] = {name: _trimmed(entry) for name, entry in value.items()}
        elif not (key == "title" or (key == "default" and isinstance(value, dict))):
            kept[BOUNDS.get(key, "anyOf" if key == "oneOf" else key)] = _trimmed(value)
    return kept


def resolved(root: Node, node: Node) -> dict[str, Any]:
    """The node itself: references followed, with `nullable` in place of a union with null."""
    made = dict(node)
    if "$ref" in made:
        target = root["$defs"][made.pop("$ref").rpartition("/")[2]]
        return resolved(root, {**target, **made})
    members = [member for member in made.get("anyOf", ()) if member.get("type") != "null"]
    if len(members) < len(made.get("anyOf", ())):
        made["nullable"] = True
        made["anyOf"] = members
    if len(members) == 1:
        del made["anyOf"]
        return resolved(root, {**members[0], **made})
    return made


def kinds(root: Node, node: Node) -> dict[str, dict[str, Any]]:
    """The tables that a key `kind` chooses from: {kind: table}."""
    tables = [resolved(root, member) for member in node.get("anyOf", ())] if "discriminator" in node else []
    return {table["properties"]["kind"]["const"]: table for table in tables}


def keys(table: Node) -> dict[str, Node]:
    """The keys of a table and their nodes, without the word that only says which kind it is."""
    return {key: node for key, node in table.get("properties", {}).items() if "const" not in node}


def meaning(node: Node) -> tuple[str, str]:
    """The unit and the meaning of a key."""
    found = re.fullmatch(r"(?:\[(.+?)\] ?)?(.*)", node.get("description", "").partition("\n\n")[0], re.S)
    assert found is not None
    return found[1] or "", " ".join(found[2].split())
