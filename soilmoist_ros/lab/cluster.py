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
from collections.abc import Callable, Iterable
from contextlib import suppress
from typing import Any

from soilmoist_ros.foundation import InputError, connect
from soilmoist_ros.lab.campaign_file import CampaignMission
from soilmoist_ros.lab.computing import Failure, Finished, Flow, Simulate, WorkersLostError, compute
from soilmoist_ros.lab.mission_store import code_version

IN_FLIGHT = 3
"""Missions in flight for each thread of the cluster: one runs, the others bridge the way to the scheduler."""
LOOK_S = 2.0  # time between two looks at the number of workers [s]
REMEDY = "install the same version of soilmoist_ros there, start its worker again, and run the same command again"


def on_cluster(
    todo: Iterable[CampaignMission],
    simulate: Simulate,
    scheduler: str,
    waits: Callable[[str], None] = lambda note: None,
) -> Flow:
    """Compute on the workers of a Dask cluster, which must have the same version of this package.

    Dask repeats missions of a worker that dies. Workers may come and go; with none left, the campaign waits. The
    results of a worker that comes with another version are not stored.

    :raises InputError: if Dask is not installed, the scheduler or a worker does not answer in time, or a worker
        has another version of this package
    :raises WorkersLostError: if the scheduler does not answer any more
    """
    with connect(scheduler) as client:
        _check_versions(client)
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
                future = client.submit(compute, mission, simulate, key=key, pure=False)
                running[future] = mission
                future.add_done_callback(arrived.put)
            with suppress(queue.Empty):
                future = arrived.get(timeout=LOOK_S)
                mission = running.pop(future)
                finished = _finished(future, mission, scheduler)
                future.release()
                yield finished


def _finished(future: Any, mission: CampaignMission, scheduler: str) -> Finished:
    """Result of a future, or the failure by which it was lost; ``WorkersLostError`` if the scheduler is lost."""
    try:
        if future.status != "cancelled":
            found: Finished = future.result()
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


def _check_versions(client: Any) -> None:
    """Refuse workers with another version of this package (``InputError``)."""
    versions = client.run(code_version, on_error="return")
    if wrong := {address: found for address, found in versions.items() if found != code_version()}:
        address, found = min(wrong.items())
        has = f"cannot load it ({found})" if isinstance(found, BaseException) else f"has {found}"
        others = f", and {len(wrong) - 1} more differ" if len(wrong) > 1 else ""
        message = f"this is soilmoist_ros {code_version()}, but the Dask worker {address} {has}{others}"
        raise InputError(message, REMEDY)
