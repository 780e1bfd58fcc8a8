# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""State that the console knows now, in sections, with the visits and ways for viewers who come late."""

from __future__ import annotations

import math
import threading
import time
from collections.abc import Callable, Mapping
from typing import Any

from soilmoist_ros.console.views import PLACE_DIGITS, place_views
from soilmoist_ros.exploration import MissionStatus, Phase

STEP_M = 0.5
"""Moves shorter than this are no way, but noise of the receiver [m]."""
RESTING = frozenset({Phase.IDLE, Phase.FINISHED})
"""Phases in which a robot stands where its next mission will start."""
BEGUN_S = 5.0
"""Time of a mission in which its robot is still where it started [s]."""
MAX_TRAIL = 4000
"""Places of a way at most; then every second one is left out."""
MAX_VISITS = 1000
"""Latest visits that are kept; then the oldest quarter is left out."""


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
    """Changes that turn ``old`` into ``new``, as JSON.

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


# What a viewer who comes late wants to see: the visits, and the way of a robot ----------------------------------


class RobotHistory:
    """Writes the sections ``place``, ``trail``, ``start`` (where its mission began), and ``ended`` (when, in
    seconds since 1970; ``None`` before) of a robot.
    """

    def __init__(self, board: Board, robot: str) -> None:
        self._board, self._robot = board, robot
        self._trail: tuple[tuple[float, float], ...] = ()
        self._start: list[float] | None = None
        self._ended = False
        self._heading_deg: float | None = None

    def place(self, x_m: float, y_m: float, sd_m: float) -> None:
        """The robot is at a place [m]; its heading is that of its last move."""
        here = round(x_m, PLACE_DIGITS), round(y_m, PLACE_DIGITS)
        last = self._trail[-1] if self._trail else None
        if last is None or math.dist(last, here) >= STEP_M:
            if last is not None:
                self._heading_deg = round(math.degrees(math.atan2(here[0] - last[0], here[1] - last[1])) % 360)
            if len(self._trail) >= MAX_TRAIL:
                self._trail = self._trail[::2]
            self._trail = (*self._trail, here)
            self._board.put(f"trail/{self._robot}", self._trail)
        sd = round(sd_m, PLACE_DIGITS) if math.isfinite(sd_m) else None
        self._board.put(f"place/{self._robot}", [*here, self._heading_deg, sd])

    def follow(self, status: MissionStatus) -> None:
        """Take the begin and the end of a mission from its status."""
        if self._trail and (status.phase in RESTING or status.time_used_s < BEGUN_S):
            self._start = list(self._trail[-1])
            self._board.put(f"start/{self._robot}", self._start)
        if self._ended is not (status.phase is Phase.FINISHED):
            self._ended = not self._ended
            self._board.put(f"ended/{self._robot}", round(time.time()) if self._ended else None)


class VisitHistory:
    """Writes the section ``visits``: places of the latest ones of all robots."""

    def __init__(self, board: Board) -> None:
        self._board = board
        self._visits: tuple[list[float], ...] = ()

    def add(self, place: tuple[float, float]) -> None:
        """Add the place of a visit [m]."""
        if len(self._visits) >= MAX_VISITS:
            self._visits = self._visits[MAX_VISITS // 4 :]
        self._visits = (*self._visits, *place_views([place]))
        self._board.put("visits", self._visits)
