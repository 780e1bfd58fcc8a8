# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Doubts about the meaning of whole logs: their times, and which of their tubes is moderated."""

from __future__ import annotations

import math
import re
from collections.abc import Iterator, Sequence
from datetime import UTC, datetime
from itertools import pairwise

import numpy as np

from soilmoist_ros.foundation import Mistake, listing
from soilmoist_ros.sensing.formats.logger_reader import LogFile
from soilmoist_ros.sensing.problems import Kind, Problem
from soilmoist_ros.sensing.records import LoggerRecord

MIN_OVERLAP = 0.2
"""Share of a counting interval that lies before the record before, from which the two overlap."""
MIN_OVERLAP_S = 5.0
"""Overlap that rounded stamps and late lines do not cause [s]."""
MONTH_S = 20 * 86_400.0
"""Time between two days that is one of months [s]."""
MIN_MONTHS = 3
"""Number of such times that make the order of day and month doubtful."""
MIN_BARE = 0.3
"""Counts of a tube relative to the others below which it is not connected, rather than bare."""
CHANCE_SD = 4.0
"""Standard deviations of a count that chance explains: a log of minutes shows no bare tube."""
BARE_SHARE = 0.7
"""Counts of a tube relative to the others below which it may be bare: a thermal tube counts about half."""
MIN_ALIKE = 20
"""Number of records from which common factors of all counts are no chance."""
_CHANGED = re.compile(r"corr|smooth|mov_?avg|filtered|norm")


def log_doubts(logs: Sequence[LogFile]) -> Iterator[Problem]:
    """Doubts about the logs of one probe."""
    unique = {(one.stamp_s, one.record_number, str(one.tube_counts)): one for log in logs for one in log.records}
    records = sorted(unique.values(), key=lambda record: record.stamp_s)
    if not records:
        return
    found = [*_rates(records, logs), *_overlaps(records), *_units(records), *_months(records), *_tubes(logs)]
    for kind, message, remedy in found:
        yield Problem(kind, Mistake(message, remedy, logs[0].path))


def _rates(records: Sequence[LoggerRecord], logs: Sequence[LogFile]) -> Iterator[tuple[Kind, str, str]]:
    """Numbers that are read as counts, and seem to be a rate, or corrected."""
    log = logs[0]
    if log.logger is None:
        return
    names = listing(name for number, name in log.tubes.items() if number not in log.left_out_counts)
    if _CHANGED.search(names.casefold()):
        message = f"by their name, {names} are corrected or smoothed: they would be corrected twice"
        yield Kind.NOT_COUNTS, message, "take the raw counts, whose counting statistics hold"
    if log.logger.counts.unit != "counts":
        return
    unit, factor = log.count_rate, 0
    if not unit and len(records) >= MIN_ALIKE:
        numbers = [count for record in records for count in record.tube_counts if count > 0]
        factor = math.gcd(*(int(count) for count in numbers))
        unit = "counts_per_hour" if len(set(numbers)) > 3 and factor % 60 == 0 else ""
    if unit:
        why = f"all are multiples of {factor}" if factor else "so the header says"
        message = f"the counts of {names} may be a rate, {unit.replace('_', ' ')}: {why}"
        yield (
            Kind.NOT_COUNTS,
            message,
            f"if it is, write 'unit: {unit}' below 'counts' in a copy of the logger format",
        )


def _overlaps(records: Sequence[LoggerRecord]) -> Iterator[tuple[Kind, str, str]]:
    """Counting intervals that begin before the record before: a clock was set back, or a live time is too long."""
    live_s = [max((live for live in one.tube_live_s if live > 0), default=0.0) for one in records]
    over = [
        (overlap_s, after)
        for (before, after), live in zip(pairwise(records), live_s[1:], strict=True)
        if (overlap_s := live - (after.stamp_s - before.stamp_s)) > max(MIN_OVERLAP * live, MIN_OVERLAP_S)
    ]
    if not over:
        return
    span_s = records[-1].stamp_s - records[0].stamp_s + live_s[0]
    first = over[0][1]
    begin, end = _utc(records[0].stamp_s), _utc(records[-1].stamp_s)
    many = f"{len(over)} record{'s' * (len(over) > 1)} began to count before the record before ended"
    message = (
        f"{_hours(math.fsum(live_s))} were counted in the {_hours(span_s)} from {begin} to {end}: "
        f"{many}, first at {_utc(first.stamp_s)} (line {first.line})"
    )
    if len(over) > len(records) / 2:
        yield Kind.OVERLAP, message, "check live_time and record_period of the logger format, and their units"
        return
    yield (
        Kind.OVERLAP,
        message,
        "if the clock of the logger changes to summer time, name its zone in the site file "
        "(logger_time_zone: Europe/Berlin); else check if the clock was set there, or if the record was shorter",
    )


def _units(records: Sequence[LoggerRecord]) -> Iterator[tuple[Kind, str, str]]:
    """A live time whose unit is another one: it is a sixtieth of the time between records, for example."""
    live_s = float(
        np.median([max((live for live in one.tube_live_s if live > 0), default=0.0) for one in records])
    )
    steps = [step_s for a, b in pairwise(records) if (step_s := b.stamp_s - a.stamp_s) > 0]
    share = live_s / float(np.median(steps)) if steps else 1.0
    for factor, words in ((60, "minutes"), (3600, "hours")):
        if 0.8 < share * factor < 1.1:
            message = (
                f"records count {live_s:g} s, 1/{factor} of the time between them: the live time may be in {words}"
            )
            yield Kind.LIVE_TIME_UNIT, message, "correct 'unit' below 'live_time' in the logger format"


def _months(records: Sequence[LoggerRecord]) -> Iterator[tuple[Kind, str, str]]:
    days = sorted({int(record.stamp_s // 86_400) for record in records})
    jumps = [(one, other) for one, other in pairwise(days) if 86_400 * (other - one) > MONTH_S]
    if len(jumps) < MIN_MONTHS or 2 * len(jumps) < len(days) - 1:
        return
    one, other = (f"{datetime.fromtimestamp(86_400 * day, UTC):%Y-%m-%d}" for day in jumps[0])
    message = (
        f"the records lie on {len(days)} days, {len(jumps)} times a month or more apart, as {one} and {other}"
    )
    remedy = "if day and month are swapped, correct time.formats of the logger format; else map each survey alone"
    yield Kind.MONTHS_APART, message, remedy


def _tubes(logs: Sequence[LogFile]) -> Iterator[tuple[Kind, str, str]]:
    """Tubes that count as if another one were the moderated tube."""
    log = logs[0]
    records = [record for one in logs for record in one.records if len(record.tube_counts) == len(log.tubes)]
    if not log.tubes or not records:
        return
    numbers = list(log.tubes)
    totals = np.nansum([record.tube_counts for record in records], axis=0)
    left_out = {
        number: sum(one.left_out_counts.get(number, 0.0) for one in logs) for number in log.left_out_counts
    }
    used = {number: total for number, total in zip(numbers, totals, strict=True) if number not in left_out}
    mean = float(np.mean(list(used.values()))) if used else 0.0
    for number, total in left_out.items():
        if mean > 0 and total - CHANCE_SD * math.sqrt(total) > mean / BARE_SHARE:
            message = (
                f"tube {number}, which the format leaves out, counts {total / mean:.2f} times what tube "
                f"{', '.join(map(str, used))} counts: a moderated tube counts more than a bare one"
            )
            remedy = f"if tube {number} is the moderated one, copy the logger format and leave the other one out"
            yield Kind.OTHER_TUBE, message, remedy
    strong = float(np.median(sorted(used.values())[len(used) // 2 :])) if len(used) > 1 else 0.0
    for weak, total in used.items():
        if total <= MIN_BARE * strong or total + CHANCE_SD * math.sqrt(total) >= BARE_SHARE * strong:
            continue
        message = f"tube {weak} counts {total / strong:.2f} times what the others count: it may be bare (thermal)"
        remedy = f"if it is bare, copy the logger format and write 'left_out: [{weak}]' below 'counts'"
        yield Kind.OTHER_TUBE, message, remedy


def _hours(time_s: float) -> str:
    hours = time_s / 3600
    return f"{hours:.2f} h" if hours < 10 else f"{hours:,.0f} h"


def _utc(stamp_s: float) -> str:
    return datetime.fromtimestamp(stamp_s, UTC).strftime("%Y-%m-%d %H:%M UTC")
