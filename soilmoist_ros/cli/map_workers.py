"""Where the tiles of a large map are computed: in this process, in local processes, or on a Dask cluster."""

from __future__ import annotations

import multiprocessing
from collections.abc import Callable, Iterable, Iterator
from concurrent.futures import ProcessPoolExecutor
from concurrent.futures.process import BrokenProcessPool
from contextlib import ExitStack, contextmanager
from typing import Any

from soilmoist_ros.foundation.errors import InputError
from soilmoist_ros.mapping.kriging.tiled_kriging import Compute
from soilmoist_ros.simulation.campaign.campaign import cores
from soilmoist_ros.simulation.campaign.workers import connect, one_thread_each


@contextmanager
def tile_workers(workers: int | None = None, scheduler: str | None = None) -> Iterator[Compute]:
    """What computes the tiles of a map; processes and connections begin with the first tile, end with the context.

    :param workers: local processes; one per core if ``None``, 0 or 1 computes in this process
    :param scheduler: address of a Dask scheduler to compute on instead, whose workers have the same version of
        this package
    :raises InputError: when used, if the cluster cannot be reached, or a worker dies
    """
    count = cores() if workers is None else workers
    with ExitStack() as stack:
        if scheduler is not None:
            yield _Cluster(scheduler, stack)
        elif count > 1:
            yield _Processes(count, stack)
        else:
            yield map


class _Processes:
    """Fresh local processes, each with one thread of linear algebra."""

    def __init__(self, count: int, stack: ExitStack) -> None:
        self._count, self._stack = count, stack
        self._pool: ProcessPoolExecutor | None = None

    def __call__(self, function: Callable[[Any], Any], items: Iterable[Any]) -> Iterator[Any]:
        if self._pool is None:
            self._stack.enter_context(one_thread_each())
            pool = ProcessPoolExecutor(self._count, multiprocessing.get_context("spawn"))
            self._pool = self._stack.enter_context(pool)
        try:
            yield from self._pool.map(function, items)
        except BrokenProcessPool:
            raise InputError(
                "a process that computed the map died", "free some memory, or give --workers 1"
            ) from None


class _Cluster:
    """The workers of a Dask cluster."""

    def __init__(self, scheduler: str, stack: ExitStack) -> None:
        self._scheduler, self._stack = scheduler, stack
        self._client: Any = None

    def __call__(self, function: Callable[[Any], Any], items: Iterable[Any]) -> Iterator[Any]:
        if self._client is None:
            self._client = self._stack.enter_context(connect(self._scheduler))
        shared = self._client.scatter(function, broadcast=True, hash=False)
        futures = [self._client.submit(_apply, shared, item, pure=False) for item in items]
        try:
            for number, future in enumerate(futures):
                yield future.result()
                futures[number] = None
        finally:
            self._client.cancel([future for future in futures if future is not None])


def _apply(function: Callable[[Any], Any], item: Any) -> Any:
    return function(item)
