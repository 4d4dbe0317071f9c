"""One map over workers, with progress and resume. It knows nothing of what it maps.

Results come back in the order of the items, whatever the workers: processes here, or those of a running Dask cluster.
With a `store`, every finished result is kept under a key made from the function, the shared context, the item and the
versions in use, so that a killed run goes on where it was and never picks up work that belongs to other inputs.
"""

from __future__ import annotations

import hashlib
import multiprocessing
import pickle
from collections.abc import Callable, Generator, Sequence
from contextlib import closing
from dataclasses import dataclass
from pathlib import Path
from typing import Any, TypeVar

import joblib
from joblib import Parallel, delayed, parallel_config

from pipeline.common.files import write_beside
from pipeline.common.versions import stamp

Context = TypeVar("Context")


Item = TypeVar("Item")


Result = TypeVar("Result")


_DIGEST = hashlib.sha256().digest_size


@dataclass(frozen=True)
class Workers:
    """How work is spread: `count` processes here (None: all cores), or the Dask cluster of the scheduler at `address`.

    Finished results are kept in the folder `store` if given.
    """

    count: int | None = 1
    store: Path | None = None
    address: str | None = None

    def check(self) -> None:
        """Raise ConfigError if there is no cluster where one should be."""
        if self.address is not None:
            from pipeline.common import cluster

            cluster.check(self.address)

    def map(
        self,
        function: Callable[[Context, Item], Result],
        context: Context,
        items: Sequence[Item],
        done: Callable[[int, Result], None] = lambda finished, result: None,
    ) -> list[Result]:
        """function(context, item) for all items; `done(finished, result)` after each, in order."""
        files = [self._file(function, context, item) for item in items]
        kept = {index: result for index, file in enumerate(files) for result in _load(file)}
        missing = [index for index in range(len(items)) if index not in kept]
        work = [(files[index], items[index]) for index in missing]
        results = []
        with closing(self._run(function, context, work)) as fresh:
            for index in range(len(items)):
                result = kept[index] if index in kept else next(fresh)
                results.append(result)
                done(index + 1, result)
        return results

    def _run(self, function: Any, context: Any, work: list[tuple[Path | None, Any]]) -> Generator[Any, None, None]:
        if self.address is not None and work:
            return _on_cluster(self.address, function, context, work)
        return _here(min(self._count(), len(work)), function, context, work)

    def _count(self) -> int:
        """`count`; as many as this process may use if None, but one in a process that is itself one of many."""
        return self.count or (1 if multiprocessing.parent_process() else joblib.cpu_count())

    def _file(self, function: Any, context: Any, item: Any) -> Path | None:
        if self.store is None:
            return None
        # joblib's hash, because equal objects need not have equal pickles.
        key = joblib.hash((stamp(), function.__module__, function.__qualname__, context, item), hash_name="sha1")
        return self.store / f"{key}.pickle"


def _here(count: int, function: Any, context: Any, work: list[tuple[Path | None, Any]]) -> Generator[Any, None, None]:
    if count <= 1:
        for file, item in work:
            yield _one(function, context, item, file)
        return
    jobs = (delayed(_one)(function, context, item, file) for file, item in work)
    with parallel_config(backend="loky", inner_max_num_threads=1):
        yield from Parallel(n_jobs=count, return_as="generator", batch_size=1)(jobs)


def _one(function: Any, context: Any, item: Any, file: Path | None) -> Any:
    result = function(context, item)
    if file is not None:
        _keep(file, pickle.dumps(result))
    return result


def _on_cluster(
    address: str, function: Any, context: Any, work: list[tuple[Path | None, Any]]
) -> Generator[Any, None, None]:
    """Results are kept here, as they finish: a cluster need not share our files."""
    from pipeline.common import cluster

    waiting: dict[int, bytes] = {}
    following = 0
    with closing(cluster.run(address, function, context, [item for _, item in work])) as finished:
        for index, content in finished:
            file = work[index][0]
            if file is not None:
                _keep(file, content)
            waiting[index] = content
            while following in waiting:
                yield pickle.loads(waiting.pop(following))
                following += 1


def _keep(file: Path, content: bytes) -> None:
    """A pickle and its digest behind it."""
    whole = content + hashlib.sha256(content).digest()
    write_beside(file, lambda unfinished: unfinished.write_bytes(whole))


def _load(file: Path | None) -> list[Any]:
    """The result in `file`; none if it is not there, or not what was written."""
    if file is None or not file.is_file():
        return []
    try:
        whole = file.read_bytes()
        content, digest = whole[:-_DIGEST], whole[-_DIGEST:]
        return [pickle.loads(content)] if hashlib.sha256(content).digest() == digest else []
    except Exception:  # anything can go wrong with a pickle, and all that is lost is time
        return []
