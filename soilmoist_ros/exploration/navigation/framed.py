# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""A navigator whose navigation has another frame than the field: the one place where goals change the frame."""

from __future__ import annotations

from dataclasses import replace

from soilmoist_ros.exploration.guard.robot_frames import RobotFrames
from soilmoist_ros.exploration.navigation.navigator import Navigator
from soilmoist_ros.exploration.travel.stop import Stop
from soilmoist_ros.exploration.travel.way import Way
from soilmoist_ros.foundation import PlaneMove


class FramedNavigator:
    """A :class:`Navigator` that lives in the plane of the field, around one that lives in the navigation's frame.

    :param navigator: sends the goals, in the frame of the navigation
    :param frames: knows that frame
    """

    def __init__(self, navigator: Navigator, frames: RobotFrames) -> None:
        self._navigator = navigator
        self._frames = frames

    @property
    def waiting_for(self) -> str:
        """See :class:`Navigator`."""
        return self._frames.waiting_for or self._navigator.waiting_for

    @property
    def other_client(self) -> str:
        """See :class:`Navigator`."""
        return self._navigator.other_client

    @property
    def on_the_way(self) -> str:
        """See :class:`Navigator`."""
        return self._navigator.on_the_way

    @property
    def caution(self) -> str:
        """See :class:`Navigator`."""
        return self._navigator.caution

    @property
    def feedback_age_s(self) -> float:
        """See :class:`Navigator`."""
        return self._navigator.feedback_age_s

    @property
    def stop_unheard(self) -> bool:
        """See :class:`Navigator`."""
        return self._navigator.stop_unheard

    def go(self, goal_id: int, stop: Stop, way: Way) -> None:
        """See :class:`Navigator`."""
        move = self._move
        corners = move.places(way.corners) if len(way.corners) else way.corners
        nodes = tuple(_moved(node, move) for node in way.nodes)
        self._navigator.go(goal_id, _moved(stop, move), replace(way, corners=corners, nodes=nodes))

    def cancel(self, goal_id: int) -> None:
        """See :class:`Navigator`."""
        self._navigator.cancel(goal_id)

    def moved(self, place: tuple[float, float], now_s: float, sd_m: float) -> None:
        """See :class:`Navigator`."""
        if self._frames.move is not None:
            self._navigator.moved(self._frames.move.place(place), now_s, sd_m)

    def tick(self, now_s: float) -> None:
        """See :class:`Navigator`."""
        self._navigator.tick(now_s)

    @property
    def _move(self) -> PlaneMove:
        assert self._frames.move is not None, "no mission starts before the frame of the navigation is known"
        return self._frames.move


def _moved(stop: Stop, move: PlaneMove) -> Stop:
    x_m, y_m = move.place((stop.x_m, stop.y_m))
    return replace(stop, x_m=x_m, y_m=y_m)
