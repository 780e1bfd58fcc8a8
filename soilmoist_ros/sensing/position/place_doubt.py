# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Times in which the place of a robot is not trusted, and what becomes of the records of such a time."""

from __future__ import annotations

import json
import math
from collections.abc import Iterable
from dataclasses import dataclass, replace
from enum import StrEnum
from typing import Final

from soilmoist_ros.sensing.problems import Kind
from soilmoist_ros.sensing.records import CountRecord

DOUBTS: Final = "place_doubts"
"""Topic of the doubts, next to ``counts``."""
CLOCKS_S: Final = 2.0  # clocks of receiver and logger may differ so far [s]
CONFIRMED_M: Final = 3.0
"""Places of a confirmed doubt are right this near to the confirmed place, or to the one before the doubt [m]."""
_NUMBERS: Final = ("since_s", "until_s", "x_m", "y_m", "before_x_m", "before_y_m")
_OF_PLACE: Final = frozenset((Kind.PLACE_JUMP.value, Kind.PLACE_DOUBT.value))


class DoubtOutcome(StrEnum):
    """End of a doubt."""

    OPEN = "open"  # it has not ended
    RETURNED = "returned"  # the place jumped away and came back to where the robot stood all the time
    CONFIRMED = "confirmed"  # people have confirmed the new place
    LOST = "lost"  # nobody knows where the robot was


@dataclass(frozen=True)
class Doubt:
    """A time in which the place is not trusted.

    :param since_s: stamp of the last trusted place [s since 1970 UTC]
    :param until_s: stamp from which on it is trusted again [s since 1970 UTC]; inf while that is open
    :param outcome: how it ended
    :param x_m: where the robot stood meanwhile if it ``returned``, or the ``confirmed`` place [m], with ``y_m``
    :param before_x_m: last trusted place before a confirmed doubt [m], NaN if unknown, with ``before_y_m``
    """

    since_s: float
    until_s: float = math.inf
    outcome: DoubtOutcome = DoubtOutcome.OPEN
    x_m: float = math.nan
    y_m: float = math.nan
    before_x_m: float = math.nan
    before_y_m: float = math.nan

    def covers(self, record: CountRecord) -> bool:
        """True if a part of a record was counted in the doubted time."""
        begin_s = record.stamp_s - record.exposure_s
        return record.stamp_s >= self.since_s - CLOCKS_S and begin_s <= self.until_s + CLOCKS_S

    def to_text(self) -> str:
        """JSON of the doubt."""
        numbers = {name: getattr(self, name) for name in _NUMBERS}
        known = {name: value for name, value in numbers.items() if math.isfinite(value)}
        return json.dumps({"outcome": self.outcome.value, **known})

    @classmethod
    def from_text(cls, text: str) -> Doubt:
        """Doubt from its JSON.

        :raises ValueError: if it is none
        """
        try:
            content = json.loads(text)
            numbers = {name: float(content[name]) for name in _NUMBERS if name in content}
            return cls(outcome=DoubtOutcome(content["outcome"]), **numbers)
        except (LookupError, TypeError) as error:
            raise ValueError(f"this is no doubt about a place: {text[:80]}") from error


def none_since(stamp_s: float) -> Doubt:
    """A doubt that covers nothing: a planner trusts its first place, so doubts of a planner before it are over."""
    return Doubt(stamp_s, 0.0, DoubtOutcome.LOST)


def placed(record: CountRecord, doubts: Iterable[Doubt]) -> CountRecord:
    """A record with its place as the doubts leave it: as it is, quarantined, or where the robot stood.

    >>> record = CountRecord(100.0, 9.0, 0.0, 0.0, 5, 10.0, 10.0)
    >>> placed(record, [Doubt(80.0)]).quarantine
    'place_doubt'
    >>> placed(record, [Doubt(80.0, 120.0, DoubtOutcome.RETURNED, 1.0, 0.0)]).x_m
    1.0
    """
    ended = None
    for doubt in doubts:
        if not doubt.covers(record):
            continue
        if doubt.outcome in (DoubtOutcome.OPEN, DoubtOutcome.LOST):
            return record if record.quarantine else replace(record, quarantine=Kind.PLACE_DOUBT.value)
        ended = doubt
    if ended is None or (record.quarantine and record.quarantine not in _OF_PLACE):
        return record
    if ended.outcome is DoubtOutcome.CONFIRMED:  # nobody has confirmed where a receiver jumped to meanwhile
        here, places = (record.x_m, record.y_m), ((ended.x_m, ended.y_m), (ended.before_x_m, ended.before_y_m))
        elsewhere = min(math.dist(here, place) for place in places) > CONFIRMED_M
        return replace(record, quarantine=Kind.PLACE_DOUBT.value if elsewhere else "")
    return replace(record, x_m=ended.x_m, y_m=ended.y_m, quarantine="")


def placed_of_any(record: CountRecord, robots: Iterable[Doubts]) -> CountRecord:
    """A record of one of several robots, quarantined if a doubt about the place of any of them changes it."""
    if record.quarantine or all(doubts.placed(record) == record for doubts in robots):
        return record
    return replace(record, quarantine=Kind.PLACE_DOUBT.value)


class Doubts:
    """The doubts about the place of one robot, each with its newest outcome."""

    def __init__(self) -> None:
        self._doubts: dict[float, Doubt] = {}

    def take(self, doubt: Doubt) -> bool:
        """Add a doubt, or its end, and return whether it is new; those open before it end where it begins."""
        new = self._doubts.get(doubt.since_s) != doubt
        for since_s, other in self._doubts.items():
            if other.outcome is DoubtOutcome.OPEN and since_s < doubt.since_s:
                self._doubts[since_s] = replace(other, until_s=doubt.since_s, outcome=DoubtOutcome.LOST)
        self._doubts[doubt.since_s] = doubt
        return new

    @property
    def all(self) -> tuple[Doubt, ...]:
        """The doubts, in the order in which they came."""
        return tuple(self._doubts.values())

    def placed(self, record: CountRecord) -> CountRecord:
        """See :func:`placed`."""
        return placed(record, self._doubts.values()) if self._doubts else record
