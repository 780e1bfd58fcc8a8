# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""What the console knows now, in sections; each viewer receives the sections that have changed."""

from __future__ import annotations

import threading
import time
from collections.abc import Callable, Mapping
from typing import Any


class Board:
    """Sections of values that JSON can express, written by one thread and read by others.

    A value is never changed after it was put: a reader keeps what it has read. A section that is a tuple is a list
    that grows: readers receive what follows the part that they have.

    :param now_s: steady time [s]
    """

    def __init__(self, now_s: Callable[[], float] = time.monotonic) -> None:
        self.now_s = now_s
        self._guard = threading.Lock()
        self._sections: dict[str, Any] = {}
        self._heard: dict[str, float] = {}
        self.version = 0
        """Number of the changes so far."""

    def put(self, name: str, value: Any) -> None:
        """Replace a section."""
        with self._guard:
            self._sections[name] = value
            self.version += 1

    def hear(self, source: str) -> None:
        """Note that a source was heard now."""
        with self._guard:
            self._heard[source] = self.now_s()
            self.version += 1

    def heard_s(self, source: str) -> float:
        """Steady time at which a source was last heard [s]; minus infinity if never."""
        with self._guard:
            return self._heard.get(source, float("-inf"))

    def get(self, name: str, default: Any = None) -> Any:
        """Value of a section."""
        with self._guard:
            return self._sections.get(name, default)

    def snapshot(self) -> dict[str, Any]:
        """All sections now, and when each source was heard."""
        with self._guard:
            return {**self._sections, "heard": {name: round(heard_s, 1) for name, heard_s in self._heard.items()}}


def changes(old: Mapping[str, Any], new: Mapping[str, Any]) -> dict[str, Any]:
    """What a reader of ``old`` needs to have ``new``, as JSON.

    >>> changes({"a": 1, "trail": (1, 2)}, {"a": 1, "trail": (1, 2, 3), "b": 0})
    {'set': {'b': 0}, 'extend': {'trail': [2, [3]]}}

    :returns: ``set``: values by section; ``extend``: by section, how many items stay and the items that follow
    """
    replaced, extended = {}, {}
    for name, value in new.items():
        before = old.get(name)
        if before is value or (name in old and before == value):
            continue
        if isinstance(value, tuple) and isinstance(before, tuple):
            kept = 0
            for one, other in zip(before, value, strict=False):
                if one != other:
                    break
                kept += 1
            extended[name] = [kept, list(value[kept:])]
        else:
            replaced[name] = value
    return {key: part for key, part in (("set", replaced), ("extend", extended)) if part}
