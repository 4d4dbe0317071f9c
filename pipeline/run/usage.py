"""`--help`: groups with their options, keys with unit, default and meaning, all from conf/ and the checked schema."""

from __future__ import annotations

import textwrap
from collections.abc import Collection, Iterator, Mapping
from typing import Any

from pipeline.config.json_schema import Node, json_schema, keys, kinds, meaning, resolved
from pipeline.config.options import chosen, options
from pipeline.config.run import RunConfig

WIDTH, COLUMN = 80, 30

USAGE = """selfmotion: optimal redundancy resolution for robot arms

{command} [+experiment=NAME] [GROUP=OPTION] [KEY=VALUE] ...
{command} -m KEY=VALUE,VALUE ...       a sweep: one run for each
{command} --cfg job ...                print what would be run
{command} -sc install=bash             completion by TAB: eval "$(...)"
{command} --hydra-help                 the flags of Hydra

A list is written 'KEY=[a,b]', nothing KEY=null. SI units; an angle is in rad
where its key does not say [deg].
"""


def text(command: str, asks_for: Collection[str] = ()) -> str:
    """The whole of it, or of the keys and groups that the command asks for, in lines of at most 80 characters."""
    schema = json_schema(RunConfig)
    tables = {name: node for name, node in keys(schema).items() if name in asks_for or not asks_for}
    groups = chosen()
    lines = [USAGE.format(command=command), *([] if asks_for else [*_options("+experiment", "experiment"), ""])]
    plain = {key: node for key, node in tables.items() if not _is_table(schema, node)}
    lines += ["Keys", *_keys(plain, ""), ""]
    for name, node in tables.items():
        if name in plain:
            continue
        lines += [name if groups.get(name) else f"{name}: {_about(resolved(schema, node))}"]
        if groups.get(name):
            lines += _options(name, name, groups[name])
        lines += [*_table(schema, name, node), ""]
    return "\n".join(line for block in lines for line in _fitted(block))


def _is_table(schema: Node, node: Node) -> bool:
    full = resolved(schema, node)
    return bool(kinds(schema, full)) or "properties" in full


def _about(node: Node) -> str:
    """What a table is for: the first line of its docstring, without the words that name the group."""
    says = meaning(node)[1].partition(": ")
    return says[2] if says[0].startswith("Group `") else says[0] + says[1] + says[2]


def _options(word: str, group: str, default: str = "") -> list[str]:
    rows = []
    for option, says in options(group).items():
        rows += _row(f"{word}={option}", f"{says} (default)" if option == default else says)
    return rows


def _table(schema: Node, where: str, node: Node) -> Iterator[str]:
    """The keys of a table, of those that its kinds share first."""
    full = resolved(schema, node)
    choice = kinds(schema, full)
    if not choice:
        leaves = {key: one for key, one in keys(full).items() if not _is_table(schema, one)}
        yield from _keys(leaves, f"{where}.")
        files = options(where)
        for key, one in keys(full).items():
            if key not in leaves:
                inner = resolved(schema, one)
                yield f"\n{where}.{key}: {files.get(key) or _about(inner)}"
                yield from _keys({k: n for k, n in keys(inner).items() if not _is_table(schema, n)}, f"{where}.{key}.")
        return
    shared = set.intersection(*(set(keys(table)) for table in choice.values()))
    first = next(iter(choice.values()))
    yield from _keys({key: one for key, one in keys(first).items() if key in shared}, f"{where}.")
    for kind, table in choice.items():
        own = {key: one for key, one in keys(table).items() if key not in shared}
        if own:
            yield f"with {where}={kind}"
            yield from _keys(own, f"{where}.")


def _keys(nodes: Mapping[str, Node], where: str) -> Iterator[str]:
    for key, node in nodes.items():
        unit, says = meaning(node)
        words = node.get("enum") or node.get("items", {}).get("enum") or ()
        says = f"{says} ({', '.join(words)})" if words else says
        default = node.get("default", {} if node.get("type") == "object" else None)
        yield from _row(f"{where}{key}={_shown(default)}", f"[{unit}] {says}" if unit else says)


def _shown(value: Any) -> str:
    if isinstance(value, list):
        return f"[{','.join(map(_shown, value))}]"
    if value is None or isinstance(value, bool):
        return {None: "null", True: "true", False: "false"}[value]
    return f"{value:g}" if isinstance(value, float) else str(value)


def _row(left: str, right: str) -> list[str]:
    """Two columns; what is too long for the first has a line to itself."""
    body = textwrap.wrap(right, WIDTH - COLUMN, break_long_words=False) or [""]
    if len(left) + 4 > COLUMN:
        return [f"  {left}", *(f"{'':{COLUMN}}{line}" for line in body)]
    return [f"  {left:{COLUMN - 2}}{body[0]}", *(f"{'':{COLUMN}}{line}" for line in body[1:])]


def _fitted(block: str) -> list[str]:
    return [
        line for part in block.split("\n") for line in (textwrap.wrap(part, WIDTH) if len(part) > WIDTH else [part])
    ]
