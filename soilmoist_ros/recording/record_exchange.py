# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Finds the records that the mapper of another robot has missed, such as in an outage of the network.

Each mapper lists what its map holds: number and sum of hashes of the records of each minute, of older ones of each
hour. A mapper that hears a list sends the records of the spans that differ. So records reach a mapper through
any other one that has them, also those of a robot that is gone. A record that comes twice counts once, see
:class:`~soilmoist_ros.recording.map_records.MapRecords`.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from hashlib import blake2b
from typing import Any, Final

from soilmoist_ros.mapping.expected_counts import without_verdict
from soilmoist_ros.recording.map_records import MapRecords, record_key
from soilmoist_ros.sensing.records import CountRecord

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


@dataclass
class _Span:
    """Good records of a minute: their hashes, and when the last one came."""

    records: list[tuple[CountRecord, int]] = field(default_factory=list)
    came_s: float = -math.inf


class RecordExchange:
    """What a map holds, and what the maps of other robots lack of it.

    :param records: records of the map; only the good ones are listed and sent
    """

    def __init__(self, records: MapRecords) -> None:
        self._records = records
        self._known = 0
        self._arrived = records.arrived
        self._minutes: dict[int, _Span] = {}
        self._sent: dict[tuple[str, int], tuple[object, float, float]] = {}

    def update(self, now_s: float) -> None:
        """Take over the records that the map has got since the last call.

        :param now_s: steady time [s]
        """
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
        """Records of this map that another one lacks, in order of time.

        :param name: who sent the list
        :param held: the list
        :param now_s: steady time [s]
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
        return sorted(found, key=lambda record: record.stamp_s)

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
