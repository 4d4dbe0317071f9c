"""One map over workers, with progress and resume. It knows nothing of what it maps.

Results come back in the order of the items, whatever the workers: processes here, or those of a running Dask cluster.
With a `store`, every finished result is kept under a key made from the function, the shared context, the item, our
source and the versions in use: a killed run goes on where it was and never takes work that belongs to other inputs.
"""

from __future__ import annotations

import multiprocessing
import os
import threading
import time
from collections.abc import Callable, Generator, Sequence
from contextlib import closing
from dataclasses import dataclass
from pathlib import Path
from typing import Any, TypeVar

import joblib
from joblib import Parallel, delayed, parallel_config
from joblib.externals.loky.process_executor import BrokenProcessPool

from pipeline.common import kept
from pipeline.common.errors import WorkerError
from pipeline.common.files import write_beside
from pipeline.common.versions import stamp

Context = TypeVar("Context")


Item = TypeVar("Item")


Result = TypeVar("Result")


LOOK_EVERY = 0.2  # [s], at its parent: a worker


@dataclass(frozen=True)
class Workers:
    """How work is spread: `count` processes here (None: all cores), or the Dask cluster of the scheduler at `address`.

    Finished results are kept in the folder `store` if given.
    """

    count: int | None = 1
    store: Path | None = None
    address: str | None = None
    wait: float = 60.0  # [s] for the first worker of the cluster

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
        known = {index: result for index, file in enumerate(files) for result in _load(file)}
        missing = [index for index in range(len(items)) if index not in known]
        work = [(files[index], items[index]) for index in missing]
        results = []
        with closing(self._run(function, context, work)) as fresh:
            for index in range(len(items)):
                result = known[index] if index in known else next(fresh)
                results.append(result)
                done(index + 1, result)
        return results

    def _run(self, function: Any, context: Any, work: list[tuple[Path | None, Any]]) -> Generator[Any, None, None]:
        if self.address is not None and work:
            return _on_cluster((self.address, self.wait), function, context, work)
        return _here(min(self._count(), len(work)), function, context, work)

    def _count(self) -> int:
        """`count`; as many as this process may use if None, but one in a process that is itself one of many."""
        return self.count or (1 if multiprocessing.parent_process() else joblib.cpu_count())

    def _file(self, function: Any, context: Any, item: Any) -> Path | None:
        if self.store is None:
            return None
        # joblib's hash, because equal objects need not have equal pickles.
        key = joblib.hash((stamp(), function.__module__, function.__qualname__, context, item), hash_name="sha1")
        return self.store / f"{key}.result"


def _here(count: int, function: Any, context: Any, work: list[tuple[Path | None, Any]]) -> Generator[Any, None, None]:
    if count <= 1:
        for file, item in work:
            yield _one(function, context, item, file)
        return
    given, restarted = 0, False
    # Loky's tracker takes away what a run that is ended leaves behind; it need not warn of it on our terminal.
    quiet = "ignore:resource_tracker:UserWarning"
    if quiet not in os.environ.get("PYTHONWARNINGS", ""):
        os.environ["PYTHONWARNINGS"] = ",".join(filter(None, [os.environ.get("PYTHONWARNINGS"), quiet]))
    while given < len(work):
        jobs = (delayed(_in_a_worker)(function, context, item, file) for file, item in work[given:])
        ours = {"initializer": _follow, "initargs": (os.getpid(),)}
        try:
            with parallel_config(backend="loky", inner_max_num_threads=1, **ours):
                for result in Parallel(n_jobs=count, return_as="generator", batch_size=1)(jobs):
                    yield result
                    given += 1
        except BrokenProcessPool:
            if restarted:
                raise WorkerError(
                    f"parallel.workers = {count}: worker processes were killed twice, by the system for want of "
                    "memory or from outside; fewer of them, or fewer knots and starts, need less"
                ) from None
            restarted = True


def _in_a_worker(function: Any, context: Any, item: Any, file: Path | None) -> Any:
    found = _load(file)  # a pool that was started again has some results already
    return found[0] if found else _one(function, context, item, file)


def _follow(parent: int) -> None:
    """End this process soon after the one that gives it work, however that ended, and before it gives any too."""

    def watch() -> None:
        while os.getppid() == parent:
            time.sleep(LOOK_EVERY)
        os._exit(1)

    threading.Thread(target=watch, daemon=True).start()


def _one(function: Any, context: Any, item: Any, file: Path | None) -> Any:
    result = function(context, item)
    if file is not None and _is_final(result):
        _keep(file, kept.dumps(result))
    return result


def _is_final(result: Any) -> bool:
    """Whether it would come out the same again; one that a clock has stopped says that it would not."""
    return getattr(result, "final", True)


def _on_cluster(
    there: tuple[str, float], function: Any, context: Any, work: list[tuple[Path | None, Any]]
) -> Generator[Any, None, None]:
    """Results are kept here, as they finish: a cluster need not share our files."""
    from pipeline.common import cluster

    waiting: dict[int, Any] = {}
    following = 0
    with closing(cluster.run(*there, function, context, [item for _, item in work])) as finished:
        for index, content in finished:
            file, result = work[index][0], kept.loads(content)
            if file is not None and _is_final(result):
                _keep(file, content)
            waiting[index] = result
            while following in waiting:
                yield waiting.pop(following)
                following += 1


def _keep(file: Path, content: bytes) -> None:
    write_beside(file, lambda unfinished: unfinished.write_bytes(content))


def _load(file: Path | None) -> list[Any]:
    """The result in `file`; none if it is not there, or not what was written: all that is lost is time."""
    if file is None or not file.is_file():
        return []
    try:
        return [kept.loads(file.read_bytes())]
    except (OSError, ValueError):
        return []
