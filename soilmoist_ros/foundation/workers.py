# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Work elsewhere: on local processes, and in a thread that takes batches."""

from __future__ import annotations

import logging
import os
import threading
import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from typing import Generic, TypeVar

Item = TypeVar("Item")
_log = logging.getLogger(__name__)

THREADS = (
    "OPENBLAS_NUM_THREADS",
    "OMP_NUM_THREADS",
    "MKL_NUM_THREADS",
    "BLIS_NUM_THREADS",
    "VECLIB_MAXIMUM_THREADS",
)


def cores() -> int:
    """Number of cores that this process may use."""
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1


@contextmanager
def one_thread_each() -> Iterator[None]:
    """Limit processes that start in this context to one thread; the limit must be set before they load numpy."""
    before = {name: os.environ.get(name) for name in THREADS}
    os.environ.update(dict.fromkeys(THREADS, "1"))
    try:
        yield
    finally:
        for name, value in before.items():
            if value is None:
                os.environ.pop(name, None)
            else:
                os.environ[name] = value


# Batches ---------------------------------------------------------------------------------------------------------


class Batches(Generic[Item]):
    """A thread that handles items in the order of their arrival, all that wait at once.

    What ``handle`` raises is logged, and the thread continues. After ``idle_s`` without items it is called with an
    empty batch. Items beyond ``max_items`` that wait are counted in ``lost``. With ``rest_s`` [s], the thread
    rests at least this long after each batch, and 20 times as long as the batch took, until it is closed.
    """

    def __init__(
        self,
        handle: Callable[[Sequence[Item]], None],
        name: str,
        idle_s: float | None = None,
        max_items: int = 20_000,
        rest_s: float = 0.0,
    ) -> None:
        self.lost = 0
        self._handle = handle
        self._idle_s = idle_s
        self._max_items = max_items
        self._rest_s = rest_s
        self._items: list[Item] = []
        self._handling = False
        self._closing = False
        self._wake = threading.Condition()
        self._thread = threading.Thread(target=self._run, name=name, daemon=True)
        self._thread.start()

    def put(self, item: Item) -> None:
        """Queue an item; never waits."""
        with self._wake:
            if len(self._items) >= self._max_items:
                self.lost += 1
                return
            self._items.append(item)
            self._wake.notify_all()

    def flush(self, timeout_s: float) -> bool:
        """Wait until everything that has arrived is handled; whether it is within this time [s]."""
        with self._wake:
            return self._wake.wait_for(lambda: not self._items and not self._handling, timeout_s)

    def close(self, timeout_s: float | None = None) -> None:
        """Handle what waits, then end the thread; may be called twice."""
        with self._wake:
            self._closing = True
            self._wake.notify_all()
        self._thread.join(timeout_s)

    def _run(self) -> None:
        while (batch := self._wait()) is not None:
            began_s = time.monotonic()
            try:
                self._handle(batch)
            except Exception:  # one bad item must not end the work of a mission
                _log.exception("%d items of %s are lost", len(batch), self._thread.name)
            with self._wake:
                self._handling = False
                self._wake.notify_all()
                if self._rest_s:
                    rest_s = max(self._rest_s, 20 * (time.monotonic() - began_s))
                    self._wake.wait_for(lambda: self._closing, rest_s)

    def _wait(self) -> list[Item] | None:
        """The items that wait, or none after :attr:`_idle_s`; ``None`` at the end."""
        with self._wake:
            self._wake.wait_for(lambda: self._closing or bool(self._items), self._idle_s)
            batch, self._items = self._items, []
            self._handling = bool(batch)
            return None if self._closing and not batch else batch
