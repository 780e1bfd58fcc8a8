# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""A thread that handles what has arrived in batches, so that no flood delays anything else."""

from __future__ import annotations

import logging
import threading
from collections.abc import Callable, Sequence
from typing import Generic, TypeVar

Item = TypeVar("Item")

_log = logging.getLogger(__name__)


class Batches(Generic[Item]):
    """A thread that handles items in the order of their arrival, all that wait at once.

    :param handle: handles a batch, in the thread; what it raises is logged, and the thread continues
    :param name: name of the thread
    :param idle_s: time after which ``handle`` is called with an empty batch when nothing arrives [s]
    :param max_items: number of items that may wait; further ones are counted in :attr:`lost`

    Attributes
    ----------
    lost : int
        items that were not taken because too many waited
    """

    def __init__(
        self,
        handle: Callable[[Sequence[Item]], None],
        name: str,
        idle_s: float | None = None,
        max_items: int = 20_000,
    ) -> None:
        self.lost = 0
        self._handle = handle
        self._idle_s = idle_s
        self._max_items = max_items
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
            try:
                self._handle(batch)
            except Exception:  # one bad item must not end the work of a mission
                _log.exception("%d items of %s are lost", len(batch), self._thread.name)
            with self._wake:
                self._handling = False
                self._wake.notify_all()

    def _wait(self) -> list[Item] | None:
        """The items that wait, or none after :attr:`_idle_s`; ``None`` at the end."""
        with self._wake:
            self._wake.wait_for(lambda: self._closing or bool(self._items), self._idle_s)
            batch, self._items = self._items, []
            self._handling = bool(batch)
            return None if self._closing and not batch else batch
