# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Records of the planner, in slices, so that no flood of them delays a command."""

from __future__ import annotations

import time
from collections import deque
from collections.abc import Callable, Sequence
from typing import Final

from rclpy.clock import Clock, ClockType
from rclpy.node import Node
from sensor_msgs.msg import PointCloud2

from soilmoist_ros.exploration import MissionControl
from soilmoist_ros.nodes.runtime.soon import Soon
from soilmoist_ros.sensing import CountRecord

SLICE: Final = 100
"""Records that are taken at a time; some 20 ms of work."""
PAUSE_S: Final = 0.05
"""Shortest time between the slices of different messages [s]: each costs a sync of the disk."""
MAX_MESSAGES: Final = 20_000


class PlannerRecords:
    """Passes the records of messages to the control.

    A callback takes a slice at most, and the executor serves others before the next one. Messages that have
    arrived meanwhile are one slice, with one sync of the disk.

    :param node: node whose executor calls
    :param control: receives the records
    :param read: records of a message of a property; logs what cannot be used, and returns none then
    """

    def __init__(
        self, node: Node, control: MissionControl, read: Callable[[str, PointCloud2], Sequence[CountRecord]]
    ) -> None:
        self._logger = node.get_logger()
        self._control = control
        self._read = read
        self._messages: deque[tuple[str, PointCloud2]] = deque()
        self._name = ""
        self._records: list[CountRecord] = []
        self._taken_s = 0.0
        self._continue = Soon(node, self.take)
        node.create_timer(2 * PAUSE_S, self.take, clock=Clock(clock_type=ClockType.STEADY_TIME))

    def put(self, name: str, message: PointCloud2) -> None:
        """Queue a message with records of a property."""
        if len(self._messages) >= MAX_MESSAGES:
            self._logger.error("counts arrive faster than they can be stored: some are left out", once=True)
            return
        self._messages.append((name, message))
        if time.monotonic() - self._taken_s >= PAUSE_S:
            self.take()

    def take(self) -> None:
        """Take a slice of the records that wait."""
        while self._messages and len(self._records) < SLICE:
            name, message = self._messages[0]
            if self._records and name != self._name:
                break
            self._messages.popleft()
            self._name = name
            self._records += self._read(name, message)
        part, self._records = self._records[:SLICE], self._records[SLICE:]
        if not part:
            return
        self._taken_s = time.monotonic()
        self._control.records(part, self._name, more=bool(self._records))
        if self._records or self._messages:
            self._continue.ask()
