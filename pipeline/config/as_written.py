"""Numbers of YAML files are what they look like: 010 is not 8, and 1:30 is not 90."""

from __future__ import annotations

import re
from typing import Any

import yaml

INT, FLOAT = "tag:yaml.org,2002:int", "tag:yaml.org,2002:float"
OTHER_BASE = re.compile(r"[-+]?0[0-9_]+|.*:.*")  # octal and sexagesimal numbers of YAML 1.1


def keep_as_written() -> None:
    """From now on, text that YAML 1.1 reads to base 8 or 60 stays text, for the schema to refuse with its key."""
    for tag, construct in ((INT, yaml.SafeLoader.construct_yaml_int), (FLOAT, yaml.SafeLoader.construct_yaml_float)):
        yaml.SafeLoader.add_constructor(tag, _unless_of_other_base(construct))


def _unless_of_other_base(construct: Any) -> Any:
    def number(loader: Any, node: Any) -> Any:
        text = loader.construct_scalar(node)
        return text if OTHER_BASE.fullmatch(text) else construct(loader, node)

    return number
