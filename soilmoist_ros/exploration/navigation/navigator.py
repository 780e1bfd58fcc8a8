# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""A navigator takes the robot to one stop at a time, and reports how each goal ended."""

from __future__ import annotations

from dataclasses import dataclass, replace
from enum import StrEnum
from typing import Protocol

from soilmoist_ros.exploration.guard.robot_frames import RobotFrames
from soilmoist_ros.exploration.travel.stop import Stop, Way
from soilmoist_ros.foundation import PlaneMove


class Outcome(StrEnum):
    """End of a goal."""

    SUCCEEDED = "succeeded"
    CANCELED = "canceled"
    FAILED = "failed"
    SUPERSEDED = "superseded"
    """Another client's goal has replaced it."""


@dataclass(frozen=True, slots=True)
class Ended:
    """A goal has ended; reported once for each goal."""

    goal_id: int  # the mission's id of the goal
    outcome: Outcome  # how it ended; ``SUCCEEDED`` only if the robot's own position agrees
    reason: str  # why, for operators


class Navigator(Protocol):
    """Takes the robot to stops. No method waits; every goal ends with one :class:`Ended`."""

    @property
    def waiting_for(self) -> str:
        """What is missing before goals can be sent; empty if nothing is."""

    @property
    def other_client(self) -> str:
        """Who drives the robot instead of this planner, in words; empty if nobody is known to."""

    @property
    def on_the_way(self) -> str:
        """What the navigation reports about the way, for displays; empty if nothing."""

    @property
    def caution(self) -> str:
        """What the navigation cannot do now although the mission relies on it; empty if nothing."""

    @property
    def feedback_age_s(self) -> float:
        """Time since the last feedback about the goal in progress [s]; nan without a goal or any feedback."""

    @property
    def stop_unheard(self) -> bool:
        """True if the navigation may not have heard of a cancellation yet: a process that ends waits a moment."""

    def go(self, goal_id: int, stop: Stop, way: Way) -> None:
        """Take the robot to a stop.

        :param goal_id: the mission's id of the goal
        :param stop: the stop
        :param way: the route, allowed by the fence: poses go to its corners as way points, names are sent as in
            ``way.nodes``, one after the other
        """

    def cancel(self, goal_id: int) -> None:
        """Stop the robot.

        :param goal_id: also that of a mission before this process, ``ANYBODYS`` or ``FORGOTTEN``, see
            :class:`.CancelGoal`
        """

    def moved(self, place: tuple[float, float], now_s: float, sd_m: float) -> None:
        """The robot is at this place [m], of this standard deviation [m], at this time of the mission [s]."""

    def tick(self, now_s: float) -> None:
        """Check the navigation and its time limits; to be called several times a second.

        :param now_s: time of the mission [s]
        """


# The one place where goals change the frame ---------------------------------------------------------------------


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
