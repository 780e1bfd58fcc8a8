# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Motion of the robot as it shows in noisy places: one estimate for mission, navigation and watch.

Places are averaged over short times. A robot has moved if the end of a span of time lies farther from its
beginning than noise explains. The scatter from place to place is measured; another part of the noise wanders over
minutes within the standard deviation that the receiver states. A receiver that repeats one place holds it until
the error has grown, and then jumps: its errors before and after have nothing in common.
"""

from __future__ import annotations

import math
from collections import deque
from dataclasses import dataclass
from statistics import median
from typing import Final

from soilmoist_ros.exploration.mission.events import STILL_M

MEAN_S: Final = 0.5  # time over which places are averaged [s]
KEPT_S: Final = 66.0  # time for which places are kept [s]
WANDER_S: Final = 60.0
"""Time constant of the wandering part of the error [s]: that of multipath and of the atmosphere is minutes."""
UNKNOWN_SD_M: Final = 1.0  # standard deviation of a place that states none [m]
STILL_SDS: Final = 3.0  # a motion shows beyond this many standard deviations of the noise
SLOW_MPS: Final = 0.05  # speed that a standstill must exclude [m/s]
SPANS: Final = (1.0, 1.5, 2.0, 3.0, 4.0)
"""Multiples of the time asked for: the first at which the noise lets one see that speed judges."""
MAX_SPAN_S: Final = 60.0  # longest time over which standstill is judged [s]
MOVED_SDS: Final = 6.0  # a motion is certain beyond this many: hundreds of hours are judged, some times a minute
MOVED_SPANS_S: Final = (2.0, 4.0, 8.0, 16.0, 32.0, 64.0)  # times over which a certain motion is looked for [s]
DRIVEN_SDS: Final = 4.0  # a stretch is driven beyond this many: an hour of standing adds none
_SCATTER_OF: Final = 60
"""Number of means whose scatter is measured, as a share of the standard deviation that they state."""
MIN_SD_M: Final = 0.005  # no receiver is better than this [m]; some state 0
_MEDIAN: Final = 2 * math.log(2)
"""Median of the squared distance by noise, divided by the variance of each coordinate."""
_SLACK_S: Final = 0.3  # a span may be this much shorter than asked for, since means have no exact time [s]

Place = tuple[float, float]


@dataclass(slots=True)
class _Mean:
    """Mean of the places in a short time."""

    at_s: float
    x_m: float
    y_m: float
    sd_m: float
    count: int = 1

    def add(self, at_s: float, place: Place, sd_m: float) -> None:
        self.count += 1
        share = 1.0 / self.count
        self.at_s += share * (at_s - self.at_s)
        self.x_m += share * (place[0] - self.x_m)
        self.y_m += share * (place[1] - self.y_m)
        self.sd_m += share * (sd_m - self.sd_m)


@dataclass(frozen=True, slots=True)
class PlaceShift:
    """Distance that the robot seems to have moved in a time."""

    east_m: float  # eastwards [m]
    north_m: float  # northwards [m]
    noise_m: float  # standard deviation of each of the two by noise [m]
    span_s: float  # over which time [s]

    @property
    def length_m(self) -> float:
        """The distance [m]."""
        return math.hypot(self.east_m, self.north_m)

    @property
    def limit_m(self) -> float:
        """Distance up to which a robot stands [m]."""
        return max(STILL_M, STILL_SDS * self.noise_m)

    @property
    def seen_mps(self) -> float:
        """Speed from which a motion shows for sure [m/s]."""
        return (self.limit_m + STILL_SDS * self.noise_m) / self.span_s

    @property
    def certain_m(self) -> float:
        """Part of the distance that noise cannot explain [m]."""
        return max(0.0, self.length_m - MOVED_SDS * self.noise_m)


NO_SHIFT: Final = PlaceShift(0.0, 0.0, 0.0, 1.0)


@dataclass(frozen=True, slots=True)
class Standing:
    """Standstill of the robot."""

    for_s: float  # for how long, as long as was needed to be sure [s]; 0 if it moves or nobody knows
    unseen_mps: float = 0.0  # a slower motion would not show in the noise [m/s]; 0 below :data:`SLOW_MPS`


class Motion:
    """Recent places of the robot, in the order of their times."""

    def __init__(self) -> None:
        self._means: deque[_Mean] = deque()
        self._squares: deque[float] = deque(maxlen=_SCATTER_OF)
        self._scatter = 0.0  # variance of a mean, as a multiple of the one that is stated
        self._anchor: tuple[float, list[_Mean]] = math.inf, []  # since when, and the first means after that
        self._counted: list[_Mean] = []  # up to where the way driven has been added up

    def take(self, at_s: float, place: Place, sd_m: float = math.nan) -> None:
        """A plausible place; one that is older than the last is left out.

        :param at_s: when it was measured [s]; a clock that goes back far begins anew
        :param sd_m: standard deviation of each coordinate [m], NaN if unknown
        """
        means, sd_m = self._means, max(sd_m, MIN_SD_M) if math.isfinite(sd_m) else UNKNOWN_SD_M
        if means and at_s < means[-1].at_s - KEPT_S:
            self.forget()
            self._squares.clear()
        if not means or at_s // MEAN_S > means[-1].at_s // MEAN_S:
            self._measure_scatter()
            means.append(_Mean(at_s, *place, sd_m))
        elif at_s // MEAN_S == means[-1].at_s // MEAN_S:
            means[-1].add(at_s, place, sd_m)
        while means[0].at_s < at_s - KEPT_S and len(means) > 3:
            means.popleft()

    def forget(self) -> None:
        """The places so far say nothing about what the robot does from now on."""
        self._means.clear()
        self._anchor = math.inf, []
        self._counted = []

    def driven_m(self) -> float:
        """Length of the way since the last call that returned one [m]; 0 while noise may be all of it."""
        latest = list(self._means)[-4:-1]  # the last mean still changes
        if len(latest) < 3 or (self._counted and latest[0].at_s <= self._counted[-1].at_s):
            return 0.0
        shift = self._between(self._counted, latest) if self._counted else NO_SHIFT
        if self._counted and shift.length_m <= max(STILL_M, DRIVEN_SDS * shift.noise_m):
            return 0.0
        self._counted = latest
        return shift.length_m

    def standing(self, for_s: float, since_s: float = -math.inf) -> Standing:
        """Standstill of the robot by its last places.

        :param for_s: shortest time over which to judge [s]; noisy places need up to four times as long
        :param since_s: only places after this time count [s]
        """
        shift, whole_s = None, 0.0
        for factor in SPANS:
            whole_s = min(factor * for_s, MAX_SPAN_S)
            shift = self.shift(whole_s, since_s, whole=True)
            if shift is None or shift.seen_mps <= SLOW_MPS:
                break
        if shift is None:
            return Standing(0.0)
        parts = (self.shift(whole_s / part, since_s) for part in (2, 4))
        if any(each is not None and each.length_m > each.limit_m for each in (shift, *parts)):
            return Standing(0.0)
        return Standing(whole_s, shift.seen_mps if shift.seen_mps > SLOW_MPS else 0.0)

    def moved(self, since_s: float) -> PlaceShift:
        """The most certain motion since a time, over a short time or a long one.

        :param since_s: from when on the robot should have stood [s]; the place of then is remembered
        """
        found = [self.shift(span_s, since_s) for span_s in MOVED_SPANS_S]
        found.append(self._from_anchor(since_s))
        return max(filter(None, found), key=lambda shift: shift.certain_m, default=NO_SHIFT)

    def shift(self, for_s: float, since_s: float = -math.inf, whole: bool = False) -> PlaceShift | None:
        """Shift of the robot in the last time; ``None`` if there are too few places.

        :param since_s: only places after this time count [s]
        :param whole: whether places must cover all of the time
        """
        if not self._means:
            return None
        begin_s, used = self._means[-1].at_s - for_s + _SLACK_S, list[_Mean]()
        for mean in reversed(self._means):
            if mean.at_s < since_s:
                break
            used.append(mean)
            if mean.at_s <= begin_s:
                break
        if len(used) < 2 or (whole and used[-1].at_s > begin_s):
            return None
        third = max(1, len(used) // 3)
        return self._between(used[-third:], used[:third])

    def _from_anchor(self, since_s: float) -> PlaceShift | None:
        if self._anchor[0] != since_s:
            self._anchor = since_s, []
        anchor = self._anchor[1]
        if len(anchor) < 3:
            anchor[:] = [mean for mean in self._means if mean.at_s >= since_s][:3]
        latest = list(self._means)[-3:]
        return self._between(anchor, latest) if anchor and anchor[-1].at_s < latest[0].at_s else None

    def _between(self, first: list[_Mean], last: list[_Mean]) -> PlaceShift:
        """The shift from the mean of some means to that of others."""
        begin_s, west, south, sd_1 = _middle(first)
        end_s, east, north, sd_2 = _middle(last)
        alike = math.exp(-(end_s - begin_s) / WANDER_S) if self._scatter else 0.0
        wander = sd_1**2 + sd_2**2 - 2 * alike * sd_1 * sd_2
        noise_m = math.sqrt(wander + self._scatter * (sd_1**2 / len(first) + sd_2**2 / len(last)))
        return PlaceShift(east - west, north - south, noise_m, end_s - begin_s)

    def _measure_scatter(self) -> None:
        """Compare the last mean but one with the line between its neighbours, which an even motion is on."""
        if len(self._means) < 3:
            return
        one, two, three = self._means[-3], self._means[-2], self._means[-1]
        share = (two.at_s - one.at_s) / (three.at_s - one.at_s)
        off_x = two.x_m - one.x_m - share * (three.x_m - one.x_m)
        off_y = two.y_m - one.y_m - share * (three.y_m - one.y_m)
        square = (off_x**2 + off_y**2) / (1 + share**2 + (1 - share) ** 2)
        self._squares.append(square / two.sd_m**2)
        self._scatter = median(self._squares) / _MEDIAN


def _middle(means: list[_Mean]) -> tuple[float, ...]:
    """Time, place and standard deviation in the middle of some means."""
    rows = ((mean.at_s, mean.x_m, mean.y_m, mean.sd_m) for mean in means)
    return tuple(sum(column) / len(means) for column in zip(*rows, strict=True))
