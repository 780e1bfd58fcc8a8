# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Puts the records of several sources into one map: each once, wherever it comes from.

Mappers of several robots exchange what one of them has missed, such as in an outage of the network. Each lists
what its map holds: number and sum of hashes of the records of each minute, of older ones of each hour. A mapper
that hears a list sends the records of the spans that differ. So records reach a mapper through any other one that
has them, also those of a robot that is gone.
"""

from __future__ import annotations

import math
import struct
from collections import Counter
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, field
from hashlib import blake2b
from operator import attrgetter
from typing import Any, Final

from soilmoist_ros.mapping import FieldMap, Skip, SkippedRecords, without_verdict
from soilmoist_ros.sensing import CountRecord, Doubt, Doubts, placed_of_any

RECEIVED: Final = ""
"""Source of the records that were received as messages, now or by an earlier process."""
START: Final = "start_from"
"""Source of the records that a map starts with."""
TEAM: Final = "other robots"
"""Source of the records that mappers of other robots send when this one has missed them."""
TEAM_S: Final = 60.0
"""With several robots, how much older than the last record of the map a record may be before the map is made
again in order of time [s]."""

HELD: Final = "held_records"
"""Topic of the list of a mapper."""
MISSED: Final = "missed_counts"
"""Topic of the records that a mapper sends to those that have missed them."""
LIST_S: Final = 10.0
"""Time between two lists of a mapper [s]."""
MAX_RECORDS: Final = 5000
"""Records that follow one list; the next list brings the next ones."""

_MINUTE_S: Final = 60
_HOUR_S: Final = 3600
_OPEN_S: Final = 20.0
"""A span whose records came less than this ago is not compared: the others may be receiving them [s]."""
_AGAIN_S: Final = (60.0, 3600.0)
"""First and longest time until the records of a span are sent again that a mapper does not take [s]."""
_HASH: Final = 1 << 64
_OF_MESSAGES: Final = (Skip.UNREADABLE, Skip.OTHER_FRAME, Skip.STAMP)
"""Reasons for which messages and records are left out before they are added."""
_NUMBERS: Final = [name for name in CountRecord.__slots__ if name != "quarantine"]
_VALUES: Final = attrgetter(*_NUMBERS)
_KEY: Final = struct.Struct(f"<{len(_NUMBERS)}d")


class MapRecords:
    """The records of a map, merged from messages, logs, journals and bags.

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
        self.arrived: list[CountRecord] = []
        """Records since then, in the order in which they came, without those that the map starts with."""
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
        if source != START:
            self.arrived += new
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
        if robot is None:  # of a log, or sent by another mapper: any of the robots may have counted it
            return placed_of_any(record, self._doubts.values())
        return self._doubts[robot].placed(record) if robot in self._doubts else record

    def read_anew(self, source: str, records: Iterable[CountRecord]) -> list[CountRecord]:
        """Add the records of a source that is read as a whole each time; otherwise as :meth:`take`."""
        self._seen.pop(source, None)
        return self.take(source, records)

    @property
    def in_order(self) -> list[CountRecord]:
        """The records in the order in which the map has added them."""
        return self._records

    def reset(self, until_s: float | None = None) -> float:
        """Remove all records. Sources but messages bring only those after a stamp [s], which is returned."""
        newest_s = max((record.stamp_s for record in self._records), default=-math.inf)
        self.until_s = max(self.until_s, newest_s if until_s is None else until_s)
        self._records.clear()
        self.arrived = []
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


@dataclass
class _Span:
    """Good records of a minute: their hashes, and when the last one came."""

    records: list[tuple[CountRecord, int]] = field(default_factory=list)
    came_s: float = -math.inf


class RecordExchange:
    """Records that a map holds, of which good ones are listed, and those of them that other robots' maps lack."""

    def __init__(self, records: MapRecords) -> None:
        self._records = records
        self._known = 0
        self._arrived = records.arrived
        self._minutes: dict[int, _Span] = {}
        self._sent: dict[tuple[str, int], tuple[object, float, float]] = {}

    def update(self, now_s: float) -> None:
        """Take over the records that the map has got since the last call, at a steady time [s]."""
        arrived = self._records.arrived
        if arrived is not self._arrived:  # the map was reset
            self._arrived, self._known, self._minutes = arrived, 0, {}
        for record in arrived[self._known :]:
            if math.isfinite(record.stamp_s) and not without_verdict(record).quarantine:
                span = self._minutes.setdefault(math.floor(record.stamp_s / _MINUTE_S), _Span())
                hashed = int.from_bytes(blake2b(record_key(record), digest_size=8).digest())
                span.records.append((record, hashed))
                span.came_s = now_s
        self._known = len(arrived)

    def held(self) -> dict[str, Any]:
        """The list of this map, as plain values."""
        since_s = self._records.until_s
        newest = max(self._minutes, default=0) * _MINUTE_S
        hours_until = newest // _HOUR_S * _HOUR_S - _HOUR_S
        spans = {str(begin): _summary(spans, since_s) for begin, spans in self._spans(hours_until)}
        since = None if math.isinf(since_s) else since_s
        return {"since": since, "hours_until": hours_until, "spans": {b: s for b, s in spans.items() if s[0]}}

    def missed(self, name: str, held: dict[str, Any], now_s: float) -> list[CountRecord]:
        """Records of this map that another one lacks by the list that it has sent, in order of time.

        :raises ValueError, TypeError, LookupError: if it is not a list of a mapper
        """
        since_s = -math.inf if held["since"] is None else float(held["since"])
        theirs = {int(begin): (int(count), str(total)) for begin, (count, total) in held["spans"].items()}
        found: list[CountRecord] = []
        for begin, spans in self._spans(int(held["hours_until"])):
            mine, other = tuple(_summary(spans, since_s)), theirs.get(begin, (0, ""))
            is_open = any(now_s - span.came_s < _OPEN_S for span in spans)
            # Who has fewer gets the others first, and then sends what only he has.
            if mine == other or not mine[0] or mine[0] < other[0] or is_open or len(found) >= MAX_RECORDS:
                continue
            before, at_s, wait_s = self._sent.get((name, begin), (None, -math.inf, 0.0))
            if before == (mine, other) and now_s - at_s < wait_s:
                continue
            wait_s = min(2 * wait_s, _AGAIN_S[1]) if before == (mine, other) else _AGAIN_S[0]
            self._sent[name, begin] = (mine, other), now_s, wait_s
            found += [record for span in spans for record, _ in span.records if record.stamp_s > since_s]
        return sorted(found, key=_stamp)

    def _spans(self, hours_until: int) -> Iterator[tuple[int, list[_Span]]]:
        """Begin of each span [s], in order, with its minutes; spans before a time are hours."""
        grouped: dict[int, list[_Span]] = {}
        for minute in sorted(self._minutes):
            begin = minute * _MINUTE_S
            begin = begin // _HOUR_S * _HOUR_S if begin < hours_until else begin
            grouped.setdefault(begin, []).append(self._minutes[minute])
        yield from grouped.items()


def _summary(spans: Sequence[_Span], since_s: float) -> list[Any]:
    """Number of the records after a time, and the sum of their hashes."""
    hashes = [hashed for span in spans for record, hashed in span.records if record.stamp_s > since_s]
    return [len(hashes), f"{sum(hashes) % _HASH:x}"]


def record_key(record: CountRecord) -> bytes:
    """All values of a record but the verdict of a map; NaN has many forms, of which one is used."""
    record = without_verdict(record)
    numbers = _KEY.pack(*(math.nan if value != value else value for value in _VALUES(record)))
    return numbers + record.quarantine.encode() if record.quarantine else numbers


_stamp: Final = attrgetter("stamp_s")
