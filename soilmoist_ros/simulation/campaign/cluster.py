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
from contextlib import contextmanager
from dataclasses import dataclass
from importlib import import_module
from typing import Any

from soilmoist_ros.foundation.errors import InputError
from soilmoist_ros.foundation.workers import connect
from soilmoist_ros.simulation.campaign.campaign_file import Mission
from soilmoist_ros.simulation.campaign.computing import (
    Failure,
    Finished,
    Flow,
    Simulate,
    WorkersLostError,
    compute,
)
from soilmoist_ros.simulation.campaign.mission_store import code_version

IN_FLIGHT = 4
"""Missions in flight for each thread of the cluster: one runs, the others bridge the way to the scheduler."""
LOOK_S = 2.0
"""Time between two looks at the number of workers [s]."""
REMEDY = "install the same version of soilmoist_ros there, start its worker again, and run the same command again"


@dataclass(frozen=True)
class _Refused:
    """A worker with another version did not compute a mission; it leaves the cluster, so another one will."""


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
        waiting, running = deque(todo), dict[Any, Mission]()
        threads, looked_s = 0, -LOOK_S
        while waiting or running:
            if time.monotonic() >= looked_s + LOOK_S:
                threads, looked_s = _threads(client, scheduler), time.monotonic()
                if not threads:
                    waits(f"waiting for a worker: dask worker {scheduler}")
            while waiting and len(running) < IN_FLIGHT * threads:
                mission = waiting.popleft()
                future = client.submit(
                    _compute, mission, simulate, code_version(), key=f"mission-{mission.key}", pure=False
                )
                running[future] = mission
                future.add_done_callback(arrived.put)
            for future in _batch(arrived):
                mission = running.pop(future)
                result = _result(future, mission, scheduler)
                future.release()
                if isinstance(result, _Refused):
                    waiting.append(mission)
                else:
                    yield result


def _compute(mission: Mission, simulate: Simulate, version: str) -> Finished | _Refused:
    return compute(mission, simulate) if code_version() == version else _Refused()


def _batch(arrived: queue.SimpleQueue[Any]) -> list[Any]:
    """All futures that have arrived; waits for the first one for a while."""
    try:
        batch = [arrived.get(timeout=LOOK_S)]
    except queue.Empty:
        return []
    while not arrived.empty():
        batch.append(arrived.get())
    return batch


def _result(future: Any, mission: Mission, scheduler: str) -> Finished | _Refused:
    """What a future has computed.

    :raises WorkersLostError: if it was cancelled, which happens when the scheduler is lost
    """
    if future.status == "cancelled":
        raise _lost(scheduler)
    try:
        result: Finished | _Refused = future.result()
    except Exception as error:
        if future.status == "cancelled":
            raise _lost(scheduler) from None
        text = " ".join(str(error).split())
        failure = Failure(mission, f"lost on the cluster ({type(error).__name__}: {text})")
        return Finished(mission, failure, float("nan"))
    return result


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
    gate = import_module("soilmoist_ros.simulation.campaign.cluster_gate")
    client.register_plugin(gate.Gate(code_version(), simulate), name=gate.NAME)
    try:
        yield
    finally:
        if client.status == "running":
            client.unregister_worker_plugin(gate.NAME)
