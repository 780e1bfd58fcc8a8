# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Puts the records of several sources into one map: each once, wherever it comes from."""

from __future__ import annotations

import math
import struct
from collections import Counter
from collections.abc import Iterable
from operator import attrgetter
from typing import TYPE_CHECKING, Final

from soilmoist_ros.mapping import Skip, SkippedRecords, without_verdict
from soilmoist_ros.sensing import CountRecord, Doubt, Doubts, placed_of_any

if TYPE_CHECKING:
    from soilmoist_ros.mapping import FieldMap  # the driver keeps records, too, and needs no map in memory

RECEIVED: Final = ""
"""Source of the records that were received as messages, now or by an earlier process."""
START: Final = "start_from"
"""Source of the records that a map starts with."""
TEAM_S: Final = 60.0
"""With several robots, how much older than the last record of the map a record may be before the map is made
again in order of time [s]."""

_OF_MESSAGES: Final = (Skip.UNREADABLE, Skip.OTHER_FRAME, Skip.STAMP)
"""Reasons for which messages and records are left out before they are added."""
_NUMBERS: Final = [name for name in CountRecord.__slots__ if name != "quarantine"]
_VALUES: Final = attrgetter(*_NUMBERS)
_KEY: Final = struct.Struct(f"<{len(_NUMBERS)}d")


class MapRecords:
    """The records of a map, merged from messages, logs, and tables and bags to start from.

    Two sources hold the same record if all of its values are equal. A record that one source holds twice, such as
    two points of a message without stamps, counts twice. The map adds records in order of time, so it does not
    depend on when each source was read.

    :param late_s: how much older than the last record of the map a record may be [s] before the map is made again
        in order of time; 0: the records are those of one robot
    """

    def __init__(self, field_map: FieldMap, late_s: float = 0.0) -> None:
        self.map = field_map
        self.until_s = -math.inf
        """Stamp of the last reset, up to which other sources than messages bring nothing [s]."""
        self._late_s = late_s
        self._records: list[CountRecord] = []
        self._doubts: dict[str, Doubts] = {}
        self._robots: dict[bytes, str] = {}
        self._total: Counter[bytes] = Counter()
        self._seen: dict[str, Counter[bytes]] = {}

    def take(self, source: str, records: Iterable[CountRecord]) -> list[CountRecord]:
        """Add and return the records that no source has brought yet; each call brings others of the source."""
        seen = self._seen.setdefault(source, Counter())
        new = []
        for record in records:
            if source != RECEIVED and record.stamp_s <= self.until_s:
                continue
            key = record_key(record)
            seen[key] += 1
            if seen[key] > self._total[key]:
                self._total[key] += 1
                new.append(record)
        if not new:
            return []
        if source != RECEIVED:
            new.sort(key=_stamp)
            if self._records and new[0].stamp_s < self._records[-1].stamp_s - self._late_s:
                self._rebuild(new)
                return new
        for record in new:
            self.map.add(self._placed(record))
        self._records += new
        return new

    def sent_by(self, robot: str, records: Iterable[CountRecord]) -> None:
        """Note which robot of several has sent records, before they are added."""
        self._robots.update((record_key(record), robot) for record in records)

    def doubt(self, doubt: Doubt, robot: str | None = None) -> bool:
        """Take a doubt about the place of a robot, or its end; returns whether it made the map again."""
        before = list(map(self._placed, self._records))
        new = self._doubts.setdefault(robot or "", Doubts()).take(doubt)
        if not new or before == list(map(self._placed, self._records)):
            return False
        self._rebuild([])
        return True

    def _placed(self, record: CountRecord) -> CountRecord:
        if not self._doubts:
            return record
        robot = self._robots.get(record_key(record), None if self._late_s else "")
        if robot is None:  # of a log: any of the robots may have counted it
            return placed_of_any(record, self._doubts.values())
        return self._doubts[robot].placed(record) if robot in self._doubts else record

    @property
    def in_order(self) -> list[CountRecord]:
        """The records in the order in which the map has added them."""
        return self._records

    def reset(self, until_s: float | None = None) -> float:
        """Remove all records. Sources but messages bring only those after a stamp [s], which is returned."""
        newest_s = max((record.stamp_s for record in self._records), default=-math.inf)
        self.until_s = max(self.until_s, newest_s if until_s is None else until_s)
        self._records.clear()
        self._total.clear()
        self._seen.clear()
        self.map.reset()
        return self.until_s

    def use(self, field_map: FieldMap) -> None:
        """Add all records to another map from now on."""
        self.map = field_map
        self._rebuild([])

    def _rebuild(self, new: list[CountRecord]) -> None:
        skipped: dict[Skip, SkippedRecords] = {
            reason: entry for reason, entry in self.map.skipped.items() if reason in _OF_MESSAGES
        }
        self._records = sorted([*self._records, *new], key=_stamp)
        self.map.reset()
        self.map.skipped |= skipped
        for record in self._records:
            self.map.add(self._placed(record))


def record_key(record: CountRecord) -> bytes:
    """All values of a record but the verdict of a map; NaN has many forms, of which one is used."""
    record = without_verdict(record)
    numbers = _KEY.pack(*(math.nan if value != value else value for value in _VALUES(record)))
    return numbers + record.quarantine.encode() if record.quarantine else numbers


_stamp: Final = attrgetter("stamp_s")
