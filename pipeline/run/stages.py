"""How long each stage of a run takes."""

from __future__ import annotations

import time
from collections.abc import Iterator
from contextlib import contextmanager

AS_RECORDED = {"studies": "extras", "summary": "tables"}  # run.json called these two so before they had other names


class Stages:
    """seconds: of each stage so far, by its name in run.json."""

    def __init__(self) -> None:
        self.seconds: dict[str, float] = {}

    @contextmanager
    def __call__(self, name: str) -> Iterator[None]:
        """Measure what is done within it."""
        begin = time.perf_counter()
        yield
        self.seconds[AS_RECORDED.get(name, name)] = round(time.perf_counter() - begin, 4)
