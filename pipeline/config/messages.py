"""One line for a bad value: the key, the value, what is allowed with its unit, what the key means, the closest name."""

from __future__ import annotations

import difflib
from collections.abc import Iterable, Mapping, Sequence
from typing import TYPE_CHECKING, Any

from pipeline.config.json_schema import Node, keys, kinds, meaning, resolved
from pipeline.config.renamed import renamed

if TYPE_CHECKING:  # a key that Hydra refuses is told without loading pydantic
    from pydantic import ValidationError

UNKNOWN = ("unexpected_keyword_argument", "invalid_key")
BOUNDS = (("minimum", ">="), ("exclusiveMinimum", ">"), ("maximum", "<="), ("exclusiveMaximum", "<"))
LONGEST = 100  # of a value that is shown


def in_one_line(error: ValidationError, schema: Node, where: str = "") -> str:
    """The first error in a line; `where` is the key of the whole."""
    found = error.errors(include_url=False)[0]
    steps, value = found["loc"], found["input"]
    if found["type"] in UNKNOWN:
        key, table = _place(schema, steps[:-1], where, within=True)
        return unknown_key(_joined(key, str(steps[-1])), list(keys(table)))
    if found["type"] == "unexpected_positional_argument":
        return f"{where}: {len(keys(schema))} values at most, in the order {', '.join(keys(schema))}"
    key, node = _place(schema, steps, where)
    if found["type"] == "value_error":
        return f"{key} = {shown(value)}: {found['ctx']['error']}"
    choice = kinds(schema, node)
    if choice and isinstance(value, Mapping):
        key, value = _joined(key, "kind"), value.get("kind")
        return f"{key} = {shown(value)}: {_hint(value, choice)}allowed: {', '.join(choice)}"
    about = "" if _speaks_for_itself(schema, node) else f" ({meaning(node)[1]})"
    return f"{key} = {shown(value)}: {_hint(value, _words(node))}{_allowed(schema, node)}{about}"


def _words(node: Node) -> list[Any]:
    """The words that may stand there, alone or beside other things."""
    return [word for one in (node, *node.get("anyOf", ())) for word in one.get("enum", ())]


def unknown_key(key: str, allowed: Iterable[str]) -> str:
    """The line for a key that there is not: its new name, or the closest one and all that may stand there."""
    now = renamed(key)
    if now is not None:
        return f"{key}: {now}"
    allowed = sorted(allowed)
    hint = next(filter(None, (_hint(part, allowed) for part in reversed(key.split(".")))), "")
    return f"{key}: unknown key; {hint}allowed: {', '.join(allowed)}"


def unknown_option(group: str, option: str, allowed: Sequence[str]) -> str:
    """The line for an option that a group does not have."""
    return f"{group} = {option}: no such option; {_hint(option, allowed)}allowed: {', '.join(allowed) or 'see conf/'}"


def _speaks_for_itself(schema: Node, node: Node) -> bool:
    """Whether what is allowed says what the key means: words, or a table of keys."""
    words = "enum" in node or "enum" in resolved(schema, node.get("items", {}))
    return words or node.get("type") == "object" or not meaning(node)[1]


def _hint(word: Any, allowed: Iterable[str]) -> str:
    close = difflib.get_close_matches(word, list(allowed), n=1) if isinstance(word, str) else []
    return f"did you mean {close[0]}? " if close else ""


def shown(value: Any) -> str:
    """A value as a user writes it, shortened."""
    if value is None or isinstance(value, bool):
        return {None: "null", True: "true", False: "false"}[value]
    text = repr(value) if isinstance(value, str) else str(list(value) if isinstance(value, tuple) else value)
    return text if len(text) <= LONGEST else f"{text[: LONGEST - 4]} ..."


def _joined(key: str, name: str) -> str:
    return f"{key}.{name}" if key else name


def _place(schema: Node, steps: Sequence[int | str], where: str, within: bool = False) -> tuple[str, dict[str, Any]]:
    """The key that pydantic's steps lead to, as a user writes it, and its node.

    A value that fits no member of a union is told of all of them, unless its keys are asked for (`within`).
    """
    key, node = where, resolved(schema, schema)
    for position, step in enumerate(steps):
        about = {"description": node.get("description", "")}
        if "anyOf" in node:  # the step says which member, it is no part of the key
            member = kinds(schema, node).get(str(step)) or _member(schema, node, step)
            if within or position < len(steps) - 1:
                node = resolved(schema, {**about, **member})
        elif isinstance(step, int):
            node = resolved(schema, {**about, **node.get("items", {})})
            key += "" if "enum" in node else f"[{step}]"
        else:
            key = _joined(key, step)
            other = {**about, **(node.get("additionalProperties") or {})}
            node = resolved(schema, node.get("properties", {}).get(step, other))
    return key, node


def _member(schema: Node, node: Node, kind: int | str) -> dict[str, Any]:
    """The member of a union that has a type of JSON."""
    members = [resolved(schema, member) for member in node["anyOf"]]
    return next((member for member in members if member.get("type") == kind), {})


def _allowed(schema: Node, node: Node) -> str:
    unit, _ = meaning(node)
    if "enum" in node:
        return f"allowed: {', '.join([*node['enum'], *(['null'] if node.get('nullable') else [])])}"
    if kinds(schema, node):
        return f"must be a table of keys and values with a kind: {', '.join(kinds(schema, node))}"
    members = [resolved(schema, member) for member in node.get("anyOf", [node])]
    nouns = [_noun(schema, member, unit) for member in members]
    return f"must be {' or '.join([*nouns, *(['null'] if node.get('nullable') else [])])}"


def _noun(schema: Node, node: Node, unit: str) -> str:
    unit = f" {unit}" if unit else ""
    match node.get("type"):
        case "string" if "enum" in node or "const" in node:
            return ", ".join(node.get("enum", [node.get("const")]))
        case "number":
            return f"a number{_bounds(node)}{unit}"
        case "integer":
            return f"a whole number{_bounds(node)}{unit}"
        case "boolean":
            return "true or false"
        case "array":
            return _list(resolved(schema, node.get("items", {})), node, unit)
        case "object":
            return "a table of keys and values"
        case _:
            return "text"


def _list(item: Node, node: Node, unit: str) -> str:
    if "enum" in item:
        return f"a list of {'at least one' if node.get('minItems') else 'any'} of: {', '.join(item['enum'])}"
    word = {"number": "numbers", "integer": "whole numbers", "array": "lists", "string": "words"}
    size = f" {node['minItems']}" if node.get("minItems") and node.get("minItems") == node.get("maxItems") else ""
    return f"a list of{size} {word.get(str(item.get('type')), 'tables')}{_bounds(item)}{unit}"


def _bounds(node: Node) -> str:
    bounds = [f"{sign} {node[word]:g}" for word, sign in BOUNDS if word in node]
    return f" {' and '.join(bounds)}" if bounds else ""
