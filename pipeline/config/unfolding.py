"""A few lines of YAML can stand for billions of values: aliases of aliases, and interpolations of interpolations.

Nothing is made of such a file: its values are counted while it is read, before any alias is copied.
"""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

import yaml
from omegaconf.base import Container
from omegaconf.errors import InterpolationResolutionError

MOST_VALUES = 10_000  # of a file, keys among them, every alias written out; the largest of ours has 1,700
MOST_RESOLVED = 2_000  # interpolations; a configuration of ours has one


class TooMany(yaml.MarkedYAMLError):  # type: ignore[misc]
    """A file of YAML that stands for too many values, or for endlessly many."""


def bound_files() -> None:
    """From now on, a file of YAML that stands for more than MOST_VALUES values is refused while it is read."""
    yaml.SafeLoader.compose_node = _compose_node


def _compose_node(loader: Any, parent: Any, index: Any) -> Any:
    """The next node of the file; `loader.values` counts them, `loader.sizes` says for how many each stands."""
    held = loader.__dict__
    mark = loader.peek_event().start_mark
    if loader.check_event(yaml.AliasEvent):
        node = yaml.composer.Composer.compose_node(loader, parent, index)
        if id(node) not in held["sizes"]:
            raise TooMany(problem="an anchor that holds itself", problem_mark=mark)
        held["values"] += held["sizes"][id(node)]
    else:
        before = held.setdefault("values", 0)
        held["values"] += 1
        node = yaml.composer.Composer.compose_node(loader, parent, index)
        held.setdefault("sizes", {})[id(node)] = held["values"] - before
    if held["values"] > MOST_VALUES:
        raise TooMany(problem=f"more than {MOST_VALUES} values, aliases written out", problem_mark=mark)
    return node


@contextmanager
def bounded(together: bool = False) -> Iterator[None]:
    """Within it, no value takes more than MOST_RESOLVED interpolations, or all values together do not."""
    resolve = Container._resolve_node_interpolation
    count = depth = 0

    def counted(self: Container, *names: Any, **named: Any) -> Any:
        nonlocal count, depth
        count = count + 1 if depth or together else 1
        if count > MOST_RESOLVED:
            raise InterpolationResolutionError(f"more than {MOST_RESOLVED} interpolations, one within the other")
        depth += 1
        try:
            return resolve(self, *names, **named)
        finally:
            depth -= 1

    Container._resolve_node_interpolation = counted  # type: ignore[method-assign]
    try:
        yield
    finally:
        Container._resolve_node_interpolation = resolve  # type: ignore[method-assign]
