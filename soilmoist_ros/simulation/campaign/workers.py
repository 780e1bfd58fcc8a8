"""Compute the missions of a campaign in this process, in local processes, or on a Dask cluster.

Each function takes the remaining missions. It yields each mission when it finishes, with the bytes of its file
or the failure.
"""

from __future__ import annotations

import importlib
import multiprocessing
import signal
import threading
import traceback
from collections import deque
from collections.abc import Callable, Generator, Iterable, Iterator
from concurrent.futures import FIRST_COMPLETED, Future, ProcessPoolExecutor, wait
from concurrent.futures.process import BrokenProcessPool
from contextlib import contextmanager
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

from soilmoist_ros.foundation.workers import connect, one_thread_each
from soilmoist_ros.simulation.campaign.campaign_file import Mission
from soilmoist_ros.simulation.campaign.mission_store import pack
from soilmoist_ros.simulation.mission.result import MissionResult
from soilmoist_ros.simulation.mission.settings import MissionSettings

if TYPE_CHECKING:
    from multiprocessing.synchronize import Event

Simulate = Callable[[MissionSettings, Callable[[float], None] | None], MissionResult]

_stop: Event | None = None


@dataclass(frozen=True)
class Failure:
    """A failed mission.

    :param mission: the mission
    :param error: error message in one line
    :param details: traceback; may be empty
    """

    mission: Mission
    error: str
    details: str = ""

    def __str__(self) -> str:
        return f"{self.mission.settings}: {self.error}"


Finished = tuple[Mission, bytes | Failure]
Flow = Generator[Finished, None, None]


class _Stopped(Exception):  # noqa: N818 - nothing went wrong
    """The campaign was stopped during the mission."""


def compute(mission: Mission, simulate: Simulate) -> bytes | Failure:
    """Simulate one mission; errors are returned, not raised."""
    try:
        return pack(simulate(mission.settings, _stop_if_asked), mission.key)
    except Exception as error:
        text = " ".join(str(error).split()) or "no message"
        return Failure(mission, f"{type(error).__name__}: {text}", traceback.format_exc())


def in_this_process(todo: Iterable[Mission], simulate: Simulate) -> Flow:
    """Compute the missions one after the other in this process."""
    for mission in todo:
        yield mission, compute(mission, simulate)


def in_processes(todo: Iterable[Mission], simulate: Simulate, workers: int) -> Flow:
    """Compute in ``workers`` new local processes, each with one thread of linear algebra.

    After the death of a process, all running missions are retried one by one. A mission fails if it kills its
    process again.
    """
    waiting, suspects = deque(todo), list[Mission]()
    with one_thread_each():
        while waiting:
            suspects += yield from _in_one_pool(waiting, simulate, workers)
        for mission in suspects:
            if (yield from _in_one_pool(deque([mission]), simulate, 1)):
                yield mission, Failure(mission, "the process that computed it died (was the memory used up?)")


def _in_one_pool(
    waiting: deque[Mission], simulate: Simulate, workers: int
) -> Generator[Finished, None, list[Mission]]:
    """Compute until all missions are done or a process dies; returns the missions that were running then."""
    context = multiprocessing.get_context("spawn")
    stop = context.Event()
    pool = ProcessPoolExecutor(min(workers, len(waiting)), context, initializer=_begin, initargs=(stop,))
    running: dict[Future[bytes | Failure], Mission] = {}
    try:
        while waiting or running:
            while waiting and len(running) < workers + 1:
                with _deaf():
                    running[pool.submit(compute, waiting[0], simulate)] = waiting[0]
                waiting.popleft()
            for future in wait(running, return_when=FIRST_COMPLETED).done:
                content = future.result()
                yield running.pop(future), content
    except BrokenProcessPool:
        return list(running.values())
    finally:
        stop.set()
        pool.shutdown(wait=True, cancel_futures=True)
    return []


@contextmanager
def _deaf() -> Iterator[None]:
    """Let processes that start in this context ignore Ctrl-C, even while they load modules."""
    if threading.current_thread() is not threading.main_thread():
        yield
        return
    before = signal.signal(signal.SIGINT, signal.SIG_IGN)
    try:
        yield
    finally:
        signal.signal(signal.SIGINT, before)


def _begin(stop: Event) -> None:
    """Initialise a process: it ignores Ctrl-C, because the parent handles Ctrl-C and sets ``stop``."""
    global _stop
    _stop = stop
    signal.signal(signal.SIGINT, signal.SIG_IGN)


def _stop_if_asked(_share: float) -> None:
    """Progress callback that stops the mission if the campaign was stopped."""
    if _stop is not None and _stop.is_set():
        raise _Stopped("the campaign was stopped")


def on_cluster(todo: Iterable[Mission], simulate: Simulate, scheduler: str) -> Flow:
    """Compute on the workers of a Dask cluster, which must have the same version of this package.

    :param scheduler: address of the scheduler, such as ``tcp://head:8786``
    :raises InputError: if Dask is not installed, or the scheduler or a worker does not answer in time
    """
    client = connect(scheduler)
    as_completed: Any = importlib.import_module("distributed").as_completed

    with client:
        futures: dict[Any, Mission] = {}
        try:
            for mission in todo:
                futures[client.submit(compute, mission, simulate, key=f"mission-{mission.key}", pure=False)] = (
                    mission
                )
            for future in as_completed(list(futures), loop=client.loop):
                mission = futures.pop(future)
                error = future.exception()
                yield mission, future.result() if error is None else Failure(mission, _lost(error))
                future.release()
        finally:
            if futures:
                client.cancel(list(futures), force=True)


def _lost(error: BaseException) -> str:
    text = " ".join(str(error).split())
    return f"lost on the cluster ({type(error).__name__}: {text})"
