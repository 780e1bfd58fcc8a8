# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""One holder of the controls: the others look on, see who it is, and may take over."""

from __future__ import annotations

import time
from collections import Counter
from collections.abc import Callable

ABSENT_S = 30.0
"""Time without a connection after which the controls are free [s]; the robots go on."""


class Controls:
    """Who has the controls. Only the thread of the server uses it.

    :param now_s: steady time [s]
    """

    def __init__(self, now_s: Callable[[], float] = time.monotonic) -> None:
        self._now_s = now_s
        self._holder = ""
        self._who = ""
        self._seen_s = 0.0
        self._connected: Counter[str] = Counter()

    @property
    def who(self) -> str:
        """Name of the holder; empty if the controls are free."""
        return (self._who or "somebody without a name") if self._is_held() else ""

    def holds(self, client: str) -> bool:
        """Whether a page has the controls."""
        return self._is_held() and client == self._holder

    def take(self, client: str, who: str, over: bool = False) -> bool:
        """Give the controls to a page if they are free, or if it takes them over; whether it has them.

        :param client: number of the page, which only the page knows
        :param who: name of its operator
        :param over: whether it takes them from another page
        """
        if not client or (self._is_held() and client != self._holder and not over):
            return False
        self._holder, self._who, self._seen_s = client, who, self._now_s()
        return True

    def connect(self, client: str) -> None:
        """A page is connected."""
        self._connected[client] += 1

    def disconnect(self, client: str) -> None:
        """A page is not connected any more."""
        self._connected[client] -= 1
        if self._connected[client] <= 0:
            del self._connected[client]
        if client == self._holder:
            self._seen_s = self._now_s()

    def _is_held(self) -> bool:
        here = self._connected[self._holder] > 0 or self._now_s() - self._seen_s < ABSENT_S
        return bool(self._holder) and here
