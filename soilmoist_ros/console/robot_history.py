# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""What a viewer who comes late wants to see: the visits, the way of a robot, and how its count has grown."""

from __future__ import annotations

import math
from typing import Any

from soilmoist_ros.console.board import Board
from soilmoist_ros.console.views import PLACE_DIGITS
from soilmoist_ros.exploration import MissionStatus, Phase

STEP_M = 0.5
"""Moves shorter than this are no way, but noise of the receiver [m]."""
MAX_TRAIL = 4000
"""Places of a way at most; then every second one is left out."""
MAX_COUNTS = 200
MAX_VISITS = 1000
"""Latest visits that are kept; then the oldest quarter is left out."""


class RobotHistory:
    """Writes the sections ``place``, ``trail`` and ``count`` of a robot.

    :param board: where
    :param robot: namespace of the robot
    """

    def __init__(self, board: Board, robot: str) -> None:
        self._board, self._robot = board, robot
        self._trail: tuple[tuple[float, float], ...] = ()
        self._heading_deg: float | None = None
        self._stop = ""
        self._counts: tuple[tuple[int, int], ...] = ()

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

    def count(self, status: MissionStatus) -> None:
        """The mission says how much it has counted at its stop."""
        stop = status.target.name if status.target and status.phase is Phase.COUNTING else ""
        if stop != self._stop:
            self._stop, self._counts = stop, ()
        if stop and math.isfinite(status.dwell_s):
            one = round(status.dwell_s), status.raw_counts
            if not self._counts or one != self._counts[-1]:
                if len(self._counts) >= MAX_COUNTS:
                    self._counts = self._counts[::2]
                self._counts = (*self._counts, one)
        self._board.put(f"count/{self._robot}", self._counts)


class VisitHistory:
    """Writes the section ``visits``: the latest ones of all robots.

    :param board: where
    """

    def __init__(self, board: Board) -> None:
        self._board = board
        self._visits: tuple[dict[str, Any], ...] = ()

    def add(self, view: dict[str, Any]) -> None:
        """Add a visit, see :func:`visit_view`."""
        if len(self._visits) >= MAX_VISITS:
            self._visits = self._visits[MAX_VISITS // 4 :]
        self._visits = (*self._visits, view)
        self._board.put("visits", self._visits)
