# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Compute the missions of a campaign on a Dask cluster.

A task of the cluster is a batch of missions, because the administration of each task takes time. A few batches for
each thread of the cluster are submitted at a time, and each result is released as soon as it is here. So neither
this process nor the cluster holds more than that, however many missions a campaign has.
"""

from __future__ import annotations

import logging
import queue
import time
from collections import deque
from collections.abc import Callable, Iterable, Iterator, Sequence
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from typing import Any, Final

from distributed import WorkerPlugin

from soilmoist_ros.foundation import InputError, connect
from soilmoist_ros.lab.campaign_file import Mission
from soilmoist_ros.lab.computing import (
    Failure,
    Finished,
    Flow,
    Simulate,
    WorkersLostError,
    compute,
)
from soilmoist_ros.lab.mission_store import code_version

IN_FLIGHT = 3
"""Batches in flight for each thread of the cluster: one runs, the others bridge the way to the scheduler."""
MAX_BATCH = 16
"""Maximum number of missions in a batch."""
BATCH_S = 1.0
"""A batch begins no mission after this time [s]; the rest of it is submitted again."""
LOOK_S = 2.0
"""Time between two looks at the number of workers [s]."""
NAME: Final = "soilmoist_ros-campaign"
SAMPLING: Final = ("profile", "profile-cycle")
"""What Dask calls 100 times a second to see where its tasks are, which takes some of the worker's time."""
_log = logging.getLogger("distributed.worker")  # which Dask shows in the terminal of the worker
REMEDY = "install the same version of soilmoist_ros there, start its worker again, and run the same command again"


@dataclass(frozen=True)
class _Refused:
    """A worker with another version did not compute a batch; it leaves the cluster, so another one will."""


def on_cluster(
    todo: Iterable[Mission],
    simulate: Simulate,
    scheduler: str,
    waits: Callable[[str], None] = lambda note: None,
) -> Flow:
    """Compute on the workers of a Dask cluster, which must have the same version of this package.

    Dask repeats missions of a worker that dies. Workers may come and go; with none left, the campaign waits.

    :param scheduler: address of the scheduler, such as ``tcp://head:8786``
    :param waits: called with what the campaign waits for
    :raises InputError: if Dask is not installed, the scheduler or a worker does not answer in time, or a worker
        has another version of this package
    :raises WorkersLostError: if the scheduler does not answer any more
    """
    with connect(scheduler) as client, _same_version(client, simulate):
        arrived: queue.SimpleQueue[Any] = queue.SimpleQueue()
        waiting, running = deque(todo), dict[Any, list[Mission]]()
        threads, looked_s, most = 0, -LOOK_S, MAX_BATCH
        while waiting or running:
            if time.monotonic() >= looked_s + LOOK_S:
                threads, looked_s = _threads(client, scheduler), time.monotonic()
                if not threads:
                    waits(f"waiting for a worker: dask worker {scheduler}")
            while waiting and len(running) < IN_FLIGHT * threads:
                share = -(-len(waiting) // (IN_FLIGHT * threads))
                batch = [waiting.popleft() for _ in range(min(most, share))]
                key = f"missions-{batch[0].key}-{len(batch)}"
                future = client.submit(_compute, batch, simulate, code_version(), key=key, pure=False)
                running[future] = batch
                future.add_done_callback(arrived.put)
            for future in _all_of(arrived):
                batch = running.pop(future)
                results = _results(future, scheduler)
                future.release()
                if isinstance(results, BaseException) and len(batch) > 1:
                    results, most = [], 1  # which of them is to blame?
                elif isinstance(results, BaseException):
                    text = " ".join(str(results).split())
                    failure = Failure(batch[0], f"lost on the cluster ({type(results).__name__}: {text})")
                    results = [Finished(batch[0], failure, float("nan"))]
                finished = [] if isinstance(results, _Refused) else results
                waiting.extendleft(reversed(batch[len(finished) :]))
                yield from finished


def _compute(batch: Sequence[Mission], simulate: Simulate, version: str) -> list[Finished] | _Refused:
    """The first missions of a batch, at least one."""
    if code_version() != version:
        return _Refused()
    begin_s, finished = time.monotonic(), list[Finished]()
    for mission in batch:
        finished.append(compute(mission, simulate))
        if time.monotonic() - begin_s >= BATCH_S:
            break
    return finished


def _all_of(arrived: queue.SimpleQueue[Any]) -> list[Any]:
    """All futures that have arrived; waits for the first one for a while."""
    try:
        found = [arrived.get(timeout=LOOK_S)]
    except queue.Empty:
        return []
    while not arrived.empty():
        found.append(arrived.get())
    return found


def _results(future: Any, scheduler: str) -> list[Finished] | _Refused | BaseException:
    """What a future has computed, or why it was lost.

    :raises WorkersLostError: if it was cancelled, which happens when the scheduler is lost
    """
    if future.status == "cancelled":
        raise _lost(scheduler)
    try:
        results: list[Finished] | _Refused = future.result()
    except Exception as error:
        if future.status == "cancelled":
            raise _lost(scheduler) from None
        return error
    return results


def _lost(scheduler: str) -> WorkersLostError:
    """The error for a lost scheduler; Dask's own attempts to reach it again are not shown."""
    logging.getLogger("distributed.client").setLevel(logging.CRITICAL)
    return WorkersLostError(f"the Dask scheduler at {scheduler!r} does not answer any more")


def _threads(client: Any, scheduler: str) -> int:
    """Number of threads of all workers.

    :raises WorkersLostError: if the scheduler does not answer
    """
    if client.status != "running":
        raise _lost(scheduler)
    try:
        return sum(client.nthreads().values())
    except Exception:
        raise _lost(scheduler) from None


@contextmanager
def _same_version(client: Any, simulate: Simulate) -> Iterator[None]:
    """Refuse workers with another version of this package, those too that join in this context.

    :raises InputError: if there is one now
    """
    versions = client.run(code_version, on_error="return")
    if wrong := {address: found for address, found in versions.items() if found != code_version()}:
        address, found = min(wrong.items())
        has = f"cannot load it ({found})" if isinstance(found, BaseException) else f"has {found}"
        others = f", and {len(wrong) - 1} more differ" if len(wrong) > 1 else ""
        message = f"this is soilmoist_ros {code_version()}, but the Dask worker {address} {has}{others}"
        raise InputError(message, REMEDY)
    client.register_plugin(Gate(code_version(), simulate), name=NAME)
    try:
        yield
    finally:
        if client.status == "running":
            with suppress(OSError):  # of a scheduler that has gone, which the client does not know yet
                client.unregister_worker_plugin(NAME)


class Gate(WorkerPlugin):
    """Close a worker with another version of this package; load the simulator in all others.

    During the campaign, Dask does not profile the worker, whose missions would take longer.

    :param version: version of the campaign
    :param simulate: simulates one mission; reading this plugin loads its module
    """

    def __init__(self, version: str, simulate: Simulate) -> None:
        self._version = version
        self._simulate = simulate

    def setup(self, worker: Any) -> None:
        """Check the version of a worker that joins."""
        if code_version() == self._version:
            self._sample(worker, False)
            return
        reason = f"this worker has soilmoist_ros {code_version()}, the campaign {self._version}"
        _log.error("%s; install the same version", reason)
        worker.loop.add_callback(worker.close, reason=reason)

    def teardown(self, worker: Any) -> None:
        """Let Dask profile the worker again."""
        self._sample(worker, True)

    def _sample(self, worker: Any, wanted: bool) -> None:
        for name in SAMPLING:
            if (callback := worker.periodic_callbacks.get(name)) is not None:
                worker.loop.add_callback(callback.start if wanted else callback.stop)
