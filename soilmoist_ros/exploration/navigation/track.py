# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Where the robot plausibly is: recent positions that agree with each other and with how fast it can move."""

from __future__ import annotations

import math
from collections import deque

from soilmoist_ros.exploration.guard.motion import Motion
from soilmoist_ros.exploration.travel.stop import Stop

MIN_AGREEING, AMONG = 3, 5
"""As many agreeing positions among the newest ones make a place plausible."""
MAX_AGE_S = 3.0  # highest age of the newest of them [s]
MAX_SPAN_S = 45.0
"""Highest age of the oldest of them [s]; without fixes there are only the places of records, one in 10 s."""
SPEED_FACTOR = 3.0  # the robot may be this many times as fast as its expected speed
USUAL_FACTOR = 1.2  # the robot is seldom faster than this multiple of its expected speed
KEPT_S = 60.0  # time for which places are kept [s]
SPACING_S = 0.5  # places that come faster are thinned to this spacing, except for the newest [s]
STILL_S = 2.0  # shortest standstill of a robot that is at a stop [s]
STILL_SHARE = 1 / 3  # a robot that stands within this share of the arrival radius from a stop needs no goal to it

Place = tuple[float, float]


class RobotTrack:
    """Plausible places of the robot. Positions that it cannot have reached are left out.

    :param noise_m: positions may be this far off [m]
    """

    def __init__(self, speed_mps: float, noise_m: float) -> None:
        self._speed_mps = speed_mps
        self._max_speed_mps = SPEED_FACTOR * speed_mps
        self._noise_m = noise_m
        self._newest: deque[tuple[float, Place]] = deque(maxlen=MIN_AGREEING)
        self._verdicts: deque[bool] = deque(maxlen=AMONG)
        self._places: deque[tuple[float, Place]] = deque()
        self._motion = Motion()
        self.now_s = -math.inf
        self.resumed_s = -math.inf
        """Time of the first place after the last gap of more than :data:`MAX_AGE_S` [s]."""
        self.leaped = False
        """True if the robot would have had to be faster than expected in that gap."""

    def tick(self, now_s: float) -> None:
        """Time has passed [s]; a clock that goes back far starts a new track."""
        if now_s < self.now_s - KEPT_S:
            for kept in (self._newest, self._verdicts, self._places):
                kept.clear()
            self.now_s, self._motion = now_s, Motion()
        self.now_s = max(now_s, self.now_s)  # threads may call in another order than they read the clock

    def moved(self, place: Place, now_s: float, sd_m: float = math.nan) -> bool:
        """Process a position [m] and its standard deviation [m]; returns whether it is plausible."""
        self.tick(now_s)
        now_s = self.now_s
        self._newest.append((now_s, place))
        if self._places:
            plausible = all(self._agree(at, self._newest[-1]) for at in self._places)
            last_s, last = self._places[-1]
            if plausible and now_s - last_s > MAX_AGE_S:
                reach_m = USUAL_FACTOR * self._speed_mps * (now_s - last_s) + self._noise_m
                self.resumed_s, self.leaped = now_s, math.dist(last, place) > reach_m
            if plausible:
                self._motion.take(now_s, place, sd_m)
                self._keep(self._newest[-1])
            self._verdicts.append(plausible)
        elif len(self._newest) == MIN_AGREEING and all(self._agree(at, self._newest[-1]) for at in self._newest):
            self._places.extend(self._newest)
            for at_s, agreeing in self._newest:
                self._motion.take(at_s, agreeing, sd_m)
            self._verdicts.extend([True] * MIN_AGREEING)
        while len(self._places) > MIN_AGREEING and self._places[0][0] < now_s - KEPT_S:
            self._places.popleft()
        return bool(self._verdicts) and self._verdicts[-1]

    @property
    def still_m(self) -> float:
        """Distance from a stop at which a robot that stands needs no goal to it [m]."""
        return self._noise_m * STILL_SHARE

    @property
    def place(self) -> Place | None:
        """Where the robot is [m], if several recent positions agree."""
        newest = list(self._places)[-MIN_AGREEING:]
        if sum(self._verdicts) < MIN_AGREEING or self.now_s - newest[-1][0] > MAX_AGE_S:
            return None
        return newest[-1][1] if self.now_s - newest[0][0] <= MAX_SPAN_S else None

    @property
    def heading_rad(self) -> float | None:
        """Direction of the last motion beyond the noise, anticlockwise from east [rad]."""
        for _, before in reversed(self._places):
            here = self._places[-1][1]
            if math.dist(before, here) > self._noise_m:
                return math.atan2(here[1] - before[1], here[0] - before[0])
        return None

    def stands(self, for_s: float, since_s: float = -math.inf) -> bool:
        """True if the robot stands still, as :meth:`.Motion.standing`.

        :param for_s: for how long at least [s]
        :param since_s: only places after this time count [s]
        """
        return self.place is not None and self._motion.standing(for_s, since_s).for_s > 0

    def standing_at(self, stop: Stop, within_m: float) -> bool:
        """True if the robot stands at a stop, and within this distance of it [m]."""
        here = self.place
        near = here is not None and math.dist(here, (stop.x_m, stop.y_m)) <= min(within_m, stop.reach_m)
        return near and self.stands(STILL_S)

    def _keep(self, at: tuple[float, Place]) -> None:
        places = self._places
        if len(places) > MIN_AGREEING and places[-1][0] - places[-2][0] < SPACING_S:
            places.pop()
        places.append(at)

    def _agree(self, one: tuple[float, Place], other: tuple[float, Place]) -> bool:
        reach_m = self._max_speed_mps * abs(other[0] - one[0]) + self._noise_m
        return math.dist(one[1], other[1]) <= reach_m
