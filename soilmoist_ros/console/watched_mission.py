# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""The page of a simulated mission: it shows how the map grows, and steers nothing."""

from __future__ import annotations

import math
import time
from pathlib import Path
from typing import Final

from soilmoist_ros.console.board import Board, RobotHistory
from soilmoist_ros.console.map_layers import MapLayers
from soilmoist_ros.console.plan_routes import SurveyFiles
from soilmoist_ros.console.server import ConsoleServer
from soilmoist_ros.console.views import field_view, mission_view, place_views
from soilmoist_ros.console.visitors import PORT, Access, free_port
from soilmoist_ros.exploration import Phase
from soilmoist_ros.mapping import Field, FieldGrid, map_cells
from soilmoist_ros.simulation import Moment

MAP_S: Final = 1.0
"""Shortest time between two maps [s]; a map that takes long to make comes less often."""
_POLL_S: Final = 0.05
_BUSY: Final = 4.0
"""Time between two maps in units of the time that one takes."""


class WatchedMission:
    """Shows the moments of a simulated mission on a page of this machine, as fast as the viewer wants. A context.

    :param grid: cells of the map
    :param robots: names of the robots
    :param time_factor: simulated seconds per real second
    :param runs: folder of the runs that the page lists
    :param note: what the page says of the mission
    :raises InputError: if aiohttp is not installed, or no port is free
    """

    def __init__(
        self, field: Field, grid: FieldGrid, robots: tuple[str, ...], time_factor: float, runs: Path, note: str
    ) -> None:
        self._grid, self._robots, self._time_factor = grid, robots, time_factor
        self._board = Board()
        self._history = {robot: RobotHistory(self._board, robot) for robot in robots}
        self._board.put("robots", list(robots))
        self._board.put("field", field_view(field))
        self._board.put("watch_only", note)
        self._picture: MapLayers | None = None
        self._map_s, self._samples, self._visits = 0.0, 0, 0
        self._begun_s: float | None = None
        self.stopped = False
        files = SurveyFiles(runs, runs)
        self._server = ConsoleServer(self._board, None, Access(), lambda: self._picture, files, {})
        port = self._server.start("127.0.0.1", free_port(PORT))
        self.address = f"http://127.0.0.1:{port}/"
        """Address of the page."""

    def __enter__(self) -> WatchedMission:
        return self

    def __exit__(self, *_error: object) -> None:
        self._server.close()

    def stop(self) -> None:
        """End the mission at its next moment; signal handlers may call it."""
        # An event has a lock, which the interrupted thread may hold: the handler would wait for it for ever.
        self.stopped = True

    def wait(self, limit_s: float = math.inf) -> None:
        """Wait for :meth:`stop`, or until a time has passed [s]."""
        end_s = time.monotonic() + limit_s
        while not self.stopped and (left_s := end_s - time.monotonic()) > 0:
            time.sleep(min(left_s, _POLL_S))

    def show(self, moment: Moment) -> bool:
        """Wait until a moment is due, then show it; false after :meth:`stop`."""
        now_s = time.monotonic()
        if self._begun_s is None:
            self._begun_s = now_s - moment.time_s / self._time_factor
        due_s = self._begun_s + moment.time_s / self._time_factor
        if due_s < now_s:  # the computer is slower than asked for: the mission is not hurried later
            self._begun_s += now_s - due_s
        self.wait(due_s - now_s)
        for robot, one in zip(self._robots, moment.robots, strict=True):
            self._board.put(f"mission/{robot}", mission_view(one.status, {}))
            self._board.put(f"plan/{robot}", place_views((stop.x_m, stop.y_m) for stop in one.ahead))
            self._history[robot].place(*one.xy, 0.0)
            self._history[robot].follow(one.status)
            self._board.hear(f"mission/{robot}")
        if len(moment.visits) != self._visits:
            self._visits = len(moment.visits)
            self._board.put("visits", tuple(place_views((visit.x_m, visit.y_m) for visit in moment.visits)))
        ended = all(one.status.phase is Phase.FINISHED for one in moment.robots)
        if ended or (len(moment.samples) != self._samples and time.monotonic() >= self._map_s):
            self.show_map(moment)
        return not self.stopped

    def show_map(self, moment: Moment) -> None:
        """Show the map of a moment."""
        begun_s = time.monotonic()
        soil_map = moment.soil_map()
        if soil_map is None:
            return
        self._samples = len(moment.samples)
        self._picture = MapLayers.after(self._picture, map_cells(self._grid, soil_map))
        self._board.put("map", self._picture.about)
        self._board.put("samples", tuple(place_views(moment.samples.xy)))
        self._board.hear("map")
        ended_s = time.monotonic()
        self._map_s = ended_s + max(MAP_S, _BUSY * (ended_s - begun_s))
