# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Compute the missions of a campaign, in this process or in local processes."""

from __future__ import annotations

import multiprocessing
import os
import signal
import threading
import traceback
from collections import deque
from collections.abc import Callable, Generator, Iterable, Iterator
from concurrent.futures import FIRST_COMPLETED, Future, ProcessPoolExecutor, wait
from concurrent.futures.process import BrokenProcessPool
from contextlib import contextmanager
from dataclasses import dataclass

from soilmoist_ros.foundation import one_thread_each
from soilmoist_ros.lab.campaign_file import CampaignMission
from soilmoist_ros.lab.mission_store import pack
from soilmoist_ros.simulation import MissionResult, MissionSettings

Simulate = Callable[[MissionSettings], MissionResult]


@dataclass(frozen=True)
class Failure:
    """A failed mission."""

    mission: CampaignMission
    error: str  # error message in one line
    details: str = ""  # traceback; may be empty

    def __str__(self) -> str:
        return f"{self.mission.settings}: {self.error}"


Finished = tuple[CampaignMission, bytes | Failure]  # a mission, and the bytes of its file or why it failed
Flow = Generator[Finished, None, None]  # missions in the order in which they finish; closing it stops the workers


def compute(mission: CampaignMission, simulate: Simulate) -> Finished:
    """Simulate one mission; errors are returned, not raised."""
    try:
        return mission, pack(simulate(mission.settings), mission.key)
    except Exception as error:
        text = " ".join(str(error).split()) or "no message"
        return mission, Failure(mission, f"{type(error).__name__}: {text}", traceback.format_exc())


def in_this_process(todo: Iterable[CampaignMission], simulate: Simulate) -> Flow:
    """Compute the missions one after the other in this process."""
    for mission in todo:
        yield compute(mission, simulate)


def in_processes(todo: Iterable[CampaignMission], simulate: Simulate, workers: int) -> Flow:
    """Compute in ``workers`` new local processes, each with one thread of linear algebra.

    After the death of a process, all running missions are retried one by one. A mission fails if it kills its
    process again. The processes end with this one, however it ends.
    """
    waiting, suspects = deque(todo), list[CampaignMission]()
    with one_thread_each():
        while waiting:
            suspects += yield from _in_one_pool(waiting, simulate, workers)
        for mission in suspects:
            if (yield from _in_one_pool(deque([mission]), simulate, 1)):
                yield mission, Failure(mission, "the process that computed it died (was the memory used up?)")


def _in_one_pool(
    waiting: deque[CampaignMission], simulate: Simulate, workers: int
) -> Generator[Finished, None, list[CampaignMission]]:
    """Compute until all missions are done or a process dies; returns the missions that were running then."""
    others, context = set(multiprocessing.active_children()), multiprocessing.get_context("spawn")
    pool = ProcessPoolExecutor(min(workers, len(waiting)), context, initializer=_begin)
    running: dict[Future[Finished], CampaignMission] = {}
    try:
        while waiting or running:
            while waiting and len(running) < 2 * workers:
                with _deaf():
                    running[pool.submit(compute, waiting[0], simulate)] = waiting[0]
                waiting.popleft()
            for future in wait(running, return_when=FIRST_COMPLETED).done:
                finished = future.result()
                del running[future]
                yield finished
    except BrokenProcessPool:
        return list(running.values())
    finally:
        for process in set(multiprocessing.active_children()) - others if running else ():
            process.terminate()  # a mission is stored by this process, when it is complete
        pool.shutdown(wait=True, cancel_futures=True)
    return []


@contextmanager
def _deaf() -> Iterator[None]:
    """Let processes that start in this context ignore Ctrl-C: this process handles it."""
    if threading.current_thread() is not threading.main_thread():
        yield
        return
    before = signal.signal(signal.SIGINT, signal.SIG_IGN)
    try:
        yield
    finally:
        signal.signal(signal.SIGINT, before)


def _begin() -> None:
    """Initialise a process: it ends when its parent has died; the pool would wait for work for ever."""
    threading.Thread(target=_end_with_parent, name="end with parent", daemon=True).start()


def _end_with_parent() -> None:
    parent = multiprocessing.parent_process()
    if parent is not None:
        parent.join()
        os._exit(1)
