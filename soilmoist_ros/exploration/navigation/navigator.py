# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""A navigator takes the robot to one stop at a time, and reports how each goal ended."""

from __future__ import annotations

from dataclasses import dataclass, replace
from enum import StrEnum
from typing import Protocol

from soilmoist_ros.exploration.travel.stop import Array, Stop, Way
from soilmoist_ros.foundation import PlaneMove


class Outcome(StrEnum):
    """End of a goal."""

    SUCCEEDED = "succeeded"
    CANCELED = "canceled"
    FAILED = "failed"
    SUPERSEDED = "superseded"  # another client's goal has replaced it
    STOPPED = "stopped"  # the watchdog or another client has cancelled it


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
        """Reason why goals cannot be sent: what is missing; empty without one."""

    @property
    def other_client(self) -> str:
        """Client that drives the robot instead of this planner, in words; empty if none is known."""

    @property
    def on_the_way(self) -> str:
        """Report of the navigation about the way, for displays; empty without one."""

    @property
    def caution(self) -> str:
        """Function of the navigation that the mission relies on and that is unavailable now; empty without one."""

    @property
    def feedback_age_s(self) -> float:
        """Time since the last feedback about the goal in progress [s]; nan without a goal or any feedback."""

    @property
    def stop_unheard(self) -> bool:
        """True if the navigation may not have heard of a cancellation yet: a process that ends waits a moment."""

    def go(self, goal_id: int, stop: Stop, way: Way) -> None:
        """Take the robot to a stop.

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
        """Check the navigation and its time limits; to be called several times a second."""


def in_frame(stop: Stop, way: Way, move: PlaneMove) -> tuple[Stop, Way]:
    """A goal in the frame of a navigation, by the move from the field's plane: the one place where it changes."""

    def moved(one: Stop) -> Stop:
        x_m, y_m = move.place((one.x_m, one.y_m))
        return replace(one, x_m=x_m, y_m=y_m)

    def judge(path: Array, nodes: Array) -> str:
        return way.judge(move.inverse.places(path), move.inverse.places(nodes))

    corners = move.places(way.corners) if len(way.corners) else way.corners
    return moved(stop), replace(way, corners=corners, nodes=tuple(map(moved, way.nodes)), judge=judge)
