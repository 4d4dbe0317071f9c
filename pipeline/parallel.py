"""One map over workers, with progress and resume. It knows nothing of what it maps.

Results come back in the order of the items, whatever the number of workers. With a `store`, every finished result is
kept under a key made from the function, the shared context and the item, so that a killed run goes on where it was and
never picks up work that belongs to other inputs.
"""

from __future__ import annotations

import hashlib
import os
import pickle
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, TypeVar

from joblib import Parallel, delayed, parallel_config

from pipeline.files import write_beside

Context = TypeVar("Context")
Item = TypeVar("Item")
Result = TypeVar("Result")


@dataclass(frozen=True)
class Workers:
    """How work is spread: `count` local processes (None: all cores), results kept in the folder `store` if given."""

    count: int | None = 1
    store: Path | None = None

    def map(
        self,
        function: Callable[[Context, Item], Result],
        context: Context,
        items: Sequence[Item],
        done: Callable[[int, Result], None] = lambda finished, result: None,
    ) -> list[Result]:
        """function(context, item) for all items; `done(finished, result)` after each, in order."""
        keys = [self._key(function, context, item) for item in items]
        kept = {index: result for index, key in enumerate(keys) if (result := self._load(key)) is not None}
        missing = [index for index in range(len(items)) if index not in kept]
        fresh = iter(self._run(function, context, [(keys[index], items[index]) for index in missing]))
        results = []
        for index in range(len(items)):
            result = kept[index] if index in kept else next(fresh)
            results.append(result)
            done(index + 1, result)
        return results

    def _run(self, function: Any, context: Any, work: list[tuple[str, Any]]) -> Iterator[Any]:
        count = min(self.count or os.cpu_count() or 1, len(work))
        if count <= 1:
            for key, item in work:
                yield _one(function, context, item, self._file(key))
            return
        jobs = (delayed(_one)(function, context, item, self._file(key)) for key, item in work)
        with parallel_config(backend="loky", inner_max_num_threads=1):
            yield from Parallel(n_jobs=count, return_as="generator", batch_size=1)(jobs)

    def _key(self, function: Any, context: Any, item: Any) -> str:
        if self.store is None:
            return ""
        return hashlib.sha256(pickle.dumps((function.__module__, function.__qualname__, context, item))).hexdigest()[
            :32
        ]

    def _file(self, key: str) -> Path | None:
        return None if self.store is None else self.store / f"{key}.pickle"

    def _load(self, key: str) -> Any:
        file = self._file(key)
        if file is None or not file.is_file():
            return None
        return pickle.loads(file.read_bytes())


def _one(function: Any, context: Any, item: Any, file: Path | None) -> Any:
    result = function(context, item)
    if file is not None:
        write_beside(file, lambda unfinished: unfinished.write_bytes(pickle.dumps(result)))
    return result
