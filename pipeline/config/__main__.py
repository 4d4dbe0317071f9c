"""`python -m pipeline.config`: write conf/schema.json, by which an editor checks and completes the files of conf/."""

from __future__ import annotations

import json
from typing import Any

from pipeline.common.files import shipped, write_beside
from pipeline.config.json_schema import json_schema
from pipeline.config.run import RunConfig

FILE = shipped("conf") / "schema.json"


def schema() -> dict[str, Any]:
    """That of conf/config.yaml and of an experiment: the whole configuration, and what Hydra reads of the file."""
    found = json_schema(RunConfig)
    own = {"defaults": {"type": "array", "description": "what it inherits and picks"}, "hydra": {"type": "object"}}
    return {"$schema": "https://json-schema.org/draft/2020-12/schema", **found, "properties": found["properties"] | own}


def text() -> str:
    """The file as it is written."""
    return json.dumps(schema(), indent=1, ensure_ascii=False) + "\n"


if __name__ == "__main__":
    write_beside(FILE, lambda file: file.write_text(text(), encoding="utf-8"))
