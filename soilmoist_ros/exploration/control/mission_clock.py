# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Mission time: it runs evenly, whatever is done to the clock of the computer."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

from soilmoist_ros.exploration.mission.events import ClockStarted, ClockStepped
from soilmoist_ros.exploration.mission.state import MissionState

NOTICED_S = 0.1
"""A smaller difference between the clocks is no step [s]."""
_BOOT_ID = Path("/proc/sys/kernel/random/boot_id")


class MissionClock:
    """Mission time begins as ROS time, and runs with steady time from then on.

    Durations and limits use it. Records, messages and visits keep stamps in ROS time; the mission knows the
    difference. With simulated time, mission time is ROS time.

    :param ros_s: ROS time [s]; 0 while it does not run
    :param steady_s: steady time of the computer [s]; ``None`` where time is simulated
    :param boot: names the start of the computer from which steady time counts; empty if unknown
    """

    def __init__(
        self, ros_s: Callable[[], float], steady_s: Callable[[], float] | None = None, boot: str = ""
    ) -> None:
        self._ros_s = ros_s
        self._steady_s = steady_s
        self._boot = boot
        self._offset_s: float | None = None

    def now_s(self) -> float:
        """Mission time [s]; 0 while ROS time does not run."""
        if self._steady_s is None:
            return self._ros_s()
        if self._offset_s is None:
            ros_s = self._ros_s()
            if ros_s <= 0:
                return 0.0
            self._offset_s = ros_s - self._steady_s()
        return self._steady_s() + self._offset_s

    def go_on_from(self, state: MissionState) -> None:
        """Continue the time of a mission of an earlier process.

        Since the same start of the computer, steady time has gone on. Otherwise ROS time decides, but mission time
        never runs backwards.

        :param state: of the mission
        """
        if self._steady_s is None or state.now_s is None:
            return
        steady_s = self._steady_s()
        if self._boot and state.boot == self._boot:
            self._offset_s = state.steady_offset_s
        else:
            self._offset_s = max(self._ros_s() - state.stamp_offset_s, state.now_s) - steady_s

    def events(self, state: MissionState) -> list[ClockStarted | ClockStepped]:
        """What the mission has to know of the clocks.

        :param state: of the mission
        """
        now_s = self.now_s()
        if self._steady_s is None or self._offset_s is None:
            return []
        found: list[ClockStarted | ClockStepped] = []
        if (state.boot, state.steady_offset_s) != (self._boot, self._offset_s):
            found.append(ClockStarted(now_s, self._boot, self._offset_s))
        step_s = self._ros_s() - now_s - state.stamp_offset_s
        if abs(step_s) > NOTICED_S:
            found.append(ClockStepped(now_s, step_s))
        return found


def boot_id() -> str:
    """Name of the last start of this computer, by Linux; empty where it gives none."""
    try:
        return _BOOT_ID.read_text().strip()
    except OSError:
        return ""
