# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Compute the missions of a campaign on a Dask cluster.

A few missions for each thread of the cluster are submitted at a time, and each result is released as soon as it is
here. So neither this process nor the cluster holds more than that, however many missions a campaign has.
"""

from __future__ import annotations

import logging
import queue
import time
from collections import deque
from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager, suppress
from typing import Any, Final

from distributed import WorkerPlugin

from soilmoist_ros.foundation import InputError, connect
from soilmoist_ros.lab.campaign_file import CampaignMission
from soilmoist_ros.lab.computing import Failure, Finished, Flow, Simulate, WorkersLostError, compute
from soilmoist_ros.lab.mission_store import code_version

IN_FLIGHT = 3
"""Missions in flight for each thread of the cluster: one runs, the others bridge the way to the scheduler."""
LOOK_S = 2.0  # time between two looks at the number of workers [s]
NAME: Final = "soilmoist_ros-campaign"
_log = logging.getLogger("distributed.worker")  # which Dask shows in the terminal of the worker
REMEDY = "install the same version of soilmoist_ros there, start its worker again, and run the same command again"


def on_cluster(
    todo: Iterable[CampaignMission],
    simulate: Simulate,
    scheduler: str,
    waits: Callable[[str], None] = lambda note: None,
) -> Flow:
    """Compute on the workers of a Dask cluster, which must have the same version of this package.

    Dask repeats missions of a worker that dies. Workers may come and go; with none left, the campaign waits.

    :raises InputError: if Dask is not installed, the scheduler or a worker does not answer in time, or a worker
        has another version of this package
    :raises WorkersLostError: if the scheduler does not answer any more
    """
    with connect(scheduler) as client, _same_version(client, simulate):
        arrived: queue.SimpleQueue[Any] = queue.SimpleQueue()
        waiting, running = deque(todo), dict[Any, CampaignMission]()
        threads, looked_s = 0, -LOOK_S
        while waiting or running:
            if time.monotonic() >= looked_s + LOOK_S:
                threads, looked_s = _threads(client, scheduler), time.monotonic()
                if not threads:
                    waits(f"waiting for a worker: dask worker {scheduler}")
            while waiting and len(running) < IN_FLIGHT * threads:
                mission = waiting.popleft()
                key = f"mission-{mission.key}"
                future = client.submit(_compute, mission, simulate, code_version(), key=key, pure=False)
                running[future] = mission
                future.add_done_callback(arrived.put)
            with suppress(queue.Empty):
                future = arrived.get(timeout=LOOK_S)
                mission = running.pop(future)
                finished = _finished(future, mission, scheduler)
                future.release()
                if finished is None:
                    waiting.appendleft(mission)
                else:
                    yield finished


def _compute(mission: CampaignMission, simulate: Simulate, version: str) -> Finished | None:
    """A mission; ``None`` by a worker of another version, which leaves the cluster, so that another one will."""
    return compute(mission, simulate) if code_version() == version else None


def _finished(future: Any, mission: CampaignMission, scheduler: str) -> Finished | None:
    """Result of a future, or the failure by which it was lost; ``WorkersLostError`` if the scheduler is lost."""
    try:
        if future.status != "cancelled":
            found: Finished | None = future.result()
            return found
    except Exception as error:
        if future.status != "cancelled":
            text = " ".join(str(error).split())
            failure = Failure(mission, f"lost on the cluster ({type(error).__name__}: {text})")
            return Finished(mission, failure, float("nan"))
    raise _lost(scheduler)


def _lost(scheduler: str) -> WorkersLostError:
    """The error for a lost scheduler; Dask's own attempts to reach it again are not shown."""
    logging.getLogger("distributed.client").setLevel(logging.CRITICAL)
    return WorkersLostError(f"the Dask scheduler at {scheduler!r} does not answer any more")


def _threads(client: Any, scheduler: str) -> int:
    """Number of threads of all workers; raises ``WorkersLostError`` if the scheduler does not answer."""
    if client.status != "running":
        raise _lost(scheduler)
    try:
        return sum(client.nthreads().values())
    except Exception:
        raise _lost(scheduler) from None


@contextmanager
def _same_version(client: Any, simulate: Simulate) -> Iterator[None]:
    """Refuse workers with another version of this package, also later ones in this context (``InputError``)."""
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
    """Close a worker with another version of this package; load the simulator, by reading this, in all others."""

    def __init__(self, version: str, simulate: Simulate) -> None:
        self._version = version
        self._simulate = simulate

    def setup(self, worker: Any) -> None:
        """Check the version of a worker that joins."""
        if code_version() != self._version:
            reason = f"this worker has soilmoist_ros {code_version()}, the campaign {self._version}"
            _log.error("%s; install the same version", reason)
            worker.loop.add_callback(worker.close, reason=reason)
