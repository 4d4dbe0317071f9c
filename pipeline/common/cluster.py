"""Work on a running Dask cluster. Its workers need this project in the same versions, but not our files.

A task carries everything it needs, so that the cluster can repeat it elsewhere when a worker is lost. It is a pickle:
who reaches the scheduler may run code on its workers, as with every Dask cluster. Results come back as plain numbers.
"""

from __future__ import annotations

import asyncio
import logging
import pickle
import threading
from collections.abc import Generator, Sequence
from typing import Any

from pipeline.common import kept
from pipeline.common.errors import ConfigError
from pipeline.common.versions import stamp

TIMEOUT = 5.0  # [s] for the scheduler's first answer


_solving = threading.Lock()


def check(address: str) -> None:
    """Raise ConfigError unless a Dask scheduler answers at `address`; say so if it has no workers yet."""
    if address in ("", "???"):
        raise ConfigError("parallel.address: not given; where the Dask scheduler listens, e.g. tcp://127.0.0.1:8786")
    try:
        from distributed.core import rpc
    except ImportError:
        raise ConfigError(f"parallel.address = {address}: needs Dask; pip install '.[cluster]'") from None

    async def ask() -> dict[str, Any]:
        async with rpc(address, timeout=TIMEOUT) as scheduler:
            return await scheduler.identity()

    try:
        answer = asyncio.run(asyncio.wait_for(ask(), TIMEOUT))
    except Exception as error:
        reason = " ".join(str(error).split()) or "no answer"
        raise ConfigError(f"parallel.address = {address}: no Dask scheduler there ({reason})") from None
    if answer.get("type") != "Scheduler":
        raise ConfigError(f"parallel.address = {address}: a Dask {answer.get('type')}, not the scheduler")
    if not answer.get("workers"):
        print(f"{address} has no workers yet; waiting for the first", flush=True)


def run(
    address: str, wait: float, function: Any, context: Any, items: Sequence[Any]
) -> Generator[tuple[int, bytes], None, None]:
    """(index, function(context, item) as `kept` writes it) for all items, in the order in which they finish."""
    check(address)
    from distributed import Client, as_completed
    from distributed.client import FutureCancelledError

    logging.getLogger("distributed.client").setLevel(logging.CRITICAL)  # what goes wrong is raised below
    with Client(address, timeout=TIMEOUT, set_as_default=False) as client:
        try:
            client.wait_for_workers(1, timeout=wait)
        except TimeoutError:
            raise ConfigError(
                f"parallel.address = {address}: no worker came within parallel.wait = {wait:g} s"
            ) from None
        tasks = [pickle.dumps((function, context, item)) for item in items]
        futures = client.map(_task, tasks, versions=stamp(), pure=False)
        indices = {future.key: index for index, future in enumerate(futures)}
        try:
            for future in as_completed(futures, loop=client.loop):
                yield indices[future.key], future.result()
        except FutureCancelledError:
            raise ConfigError(
                f"parallel.address = {address}: the scheduler went away; what is finished is kept, start again"
            ) from None


def _task(task: bytes, versions: str) -> bytes:
    """On a worker: one solve at a time, on one thread (IPOPT's linear solver is not made for several)."""
    from threadpoolctl import threadpool_limits

    if versions != stamp():
        raise ConfigError(f"parallel.address: a worker has other versions ({stamp()}) than this process ({versions})")
    with _solving, threadpool_limits(1):
        function, context, item = pickle.loads(task)
        return kept.dumps(function(context, item))
