"""Goals that are only poses: nothing answers, so arrival and standstill are judged by the robot's positions."""

from __future__ import annotations

import math
from collections import deque
from dataclasses import dataclass

from soilmoist_ros.exploration.navigation.navigator import Ended, Outcome
from soilmoist_ros.exploration.travel.stop import Stop

_STILL_SHARE = 1 / 3
"""A robot that stays within this share of the arrival radius stands still."""


@dataclass(frozen=True, slots=True)
class SendPose:
    """Send the robot to this place [m]."""

    x_m: float
    y_m: float


class PoseClient:
    """Takes goals one at a time. Each method gives what is to be done now, in order.

    How long a goal or a cancellation may take is for the mission to say: it cancels, or goes on without.

    :param radius_m: the robot is at a stop within this distance [m]
    :param settle_s: it has arrived or stopped when it has stood still for this time [s]
    """

    def __init__(self, radius_m: float, settle_s: float) -> None:
        self._radius_m = radius_m
        self._settle_s = settle_s
        self._track: deque[tuple[float, tuple[float, float]]] = deque()
        self._goal: tuple[int, Stop | None] | None = None  # without a stop: it is being cancelled
        self._stay_at_next = False

    def go(self, goal_id: int, stop: Stop) -> tuple[SendPose | Ended, ...]:
        """A new goal; a pose replaces the one before at once."""
        replaced = self._end(Outcome.CANCELED, "replaced by another goal")
        self._goal = (goal_id, stop)
        self._track.clear()
        self._stay_at_next = False
        return *replaced, SendPose(stop.x_m, stop.y_m)

    def cancel(self, goal_id: int) -> tuple[SendPose | Ended, ...]:
        """Let the robot stay where it is."""
        replaced = self._end(Outcome.CANCELED, "cancelled") if self._goal and self._goal[0] != goal_id else ()
        self._goal = (goal_id, None)
        self._stay_at_next = not self._track
        if self._stay_at_next:
            return replaced
        place = self._track[-1][1]
        self._track.clear()
        return *replaced, SendPose(*place)

    def moved(self, place: tuple[float, float], now_s: float) -> tuple[SendPose | Ended, ...]:
        """The robot is here [m]."""
        self._track.append((now_s, place))
        while len(self._track) > 1 and self._track[1][0] <= now_s - self._settle_s:
            self._track.popleft()
        if self._goal is None:
            return ()
        stop = self._goal[1]
        if stop is None:
            if self._stay_at_next:
                self._stay_at_next = False
                return (SendPose(*place),)
            return self._end(Outcome.CANCELED, "cancelled; the robot stands") if self._stands(place, now_s) else ()
        away_m = math.dist(place, (stop.x_m, stop.y_m))
        if away_m <= self._radius_m and self._stands(place, now_s):
            return self._end(Outcome.SUCCEEDED, f"standing {away_m:.1f} m from {stop.name}")
        return ()

    def _stands(self, place: tuple[float, float], now_s: float) -> bool:
        near_m = self._radius_m * _STILL_SHARE
        since_s = self._track[0][0]
        return now_s - since_s >= self._settle_s and all(math.dist(at, place) <= near_m for _, at in self._track)

    def _end(self, outcome: Outcome, reason: str) -> tuple[Ended, ...]:
        if self._goal is None:
            return ()
        goal_id, self._goal = self._goal[0], None
        return (Ended(goal_id, outcome, reason),)
