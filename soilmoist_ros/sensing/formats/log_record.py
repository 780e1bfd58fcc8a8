# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Converts the fields of one line to a record: units, live times, range checks, choice of sensors."""

from __future__ import annotations

import math
import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Literal, NoReturn
from zoneinfo import ZoneInfo

from soilmoist_ros.sensing import gnss
from soilmoist_ros.sensing.formats.log_layout import Layout, Source
from soilmoist_ros.sensing.formats.log_values import (
    Decimal,
    Quantity,
    likely_time_formats,
    read_coordinate,
    read_number,
    read_time,
    remedy_of_unit,
    zone_doubt,
)
from soilmoist_ros.sensing.formats.logger_format import RATE_TIME_S, AirQuantity, LoggerFormat, order_of
from soilmoist_ros.sensing.formats.notation import date_text, is_packed, stamp_text
from soilmoist_ros.sensing.problems import Kind
from soilmoist_ros.sensing.records import NAN, LoggerRecord, Position

Longitude = Literal["signed", "east", "west"]

EARLIEST_S = 631_152_000.0  # 1990-01-01: clocks with an empty battery start in 1970 or 1980
LATEST_S = 4_102_444_800.0  # 2100-01-01
HALF_DAY_S = 43_200.0


class LostRecordError(Exception):
    """The line is damaged, or the record has no counts."""

    def __init__(self, kind: Kind, message: str, column: str = "", remedy: str = "") -> None:
        self.note = Remark(kind, message, column, remedy)
        super().__init__(message)


@dataclass(frozen=True)
class Remark:
    """A remark about a record."""

    kind: Kind
    message: str
    column: str = ""
    remedy: str = ""


@dataclass
class Reading:
    """A record and the remarks about it.

    :param key: number, time and counts as the line has them; a line that is repeated has the same
    :param notes: faults that do not drop the record
    :param gnss_offset_s: logger's time of day minus the receiver's [s], NaN if unknown
    :param left_out: counts of the tubes that are left out, by number
    """

    record: LoggerRecord
    key: int
    notes: list[Remark] = field(default_factory=list)
    gnss_offset_s: float = NAN
    left_out: dict[int, float] = field(default_factory=dict)


class FieldReader:
    """Reads the fields of the lines of one log; the side of Greenwich is for longitudes without a sign."""

    def __init__(self, logger: LoggerFormat, layout: Layout, longitude: Longitude) -> None:
        self._logger = logger
        self.layout = layout
        self._side = longitude
        self._missing = {text.casefold() for text in logger.missing} | {""}
        self._notes: list[Remark] = []
        self._formats, self._clock = list(logger.time.used_formats), logger.time.clock
        self._rivals = logger.time.rivals if logger.time.date_order == "auto" else ()
        self._packed = False
        self._previous_stamp_s, self._previous_number = NAN, -1
        self._usual_s, self._unusual_s = NAN, NAN

    def read(self, fields: Sequence[str], period_s: float | None, line: int) -> Reading:
        """Convert one line to a record.

        :raises LostRecordError: if the line has no usable record
        """
        self._notes = []
        stamp_s = self._stamp(fields)
        number = self._record_number(fields)
        since_s, steps = stamp_s - self._previous_stamp_s, number - self._previous_number
        self._previous_stamp_s, self._previous_number = stamp_s, number
        live = self._live_times(fields, period_s, since_s, 1 if number < 0 else steps)
        counts = self._counts(fields, live)
        live = [NAN if math.isnan(count) else time for count, time in zip(counts, live, strict=True)]
        live_s = max(time for time in live if not math.isnan(time))
        if period_s is not None and live_s < self._logger.record_period.minimal_live_fraction * period_s:
            self._note(Kind.SHORT_LIVE_TIME, f"only {live_s:g} s of {period_s:g} s were counted")
        # Not the counts of the record: those of a rate depend on the time since the line before.
        written = (self._read(fields[source.index]) for source in self.layout.counts)
        key = hash((number, stamp_s, *written))  # the numbers need five times the memory
        if self._logger.time.marks == "start":
            stamp_s += period_s or live_s
        air = {name: self._quantity(fields, name, settings) for name, settings in self._logger.air.items()}
        record = LoggerRecord(
            stamp_s=stamp_s,
            tube_counts=tuple(counts),
            tube_live_s=tuple(live),
            pressure_hpa=air["pressure"],
            temperature_degc=air["temperature"],
            relative_humidity=1.0 if air["humidity"] > 1.0 else air["humidity"],
            position=self._position(fields, self.layout.position) if self.layout.position else None,
            line=line,
            record_number=number,
        )
        left_out = {
            tube: max(self._read(fields[source.index]) or 0.0, 0.0)
            for tube, source in zip(self.layout.tubes, self.layout.counts, strict=True)
            if tube in self._logger.counts.left_out
        }
        return Reading(record, key, self._notes, self._gnss_offset(fields, record), left_out)

    def _note(self, kind: Kind, message: str, column: str = "", remedy: str = "") -> None:
        self._notes.append(Remark(kind, message, column, remedy))

    def _is_missing(self, text: str) -> bool:
        return text.strip().casefold() in self._missing

    def _read(self, text: str) -> float | None:
        return read_number(text, self._logger.decimal)

    def _stamp(self, fields: Sequence[str]) -> float:
        text = stamp_text(fields, self.layout)
        column = "+".join(source.name for source in self.layout.time)
        stamp_s = None
        if self._rivals:
            sure = [name for name in self._formats if name not in self._rivals]
            stamp_s = read_time(text, sure, self._clock, self._previous_stamp_s)
            if stamp_s is None:
                self._require_order(text, column)
        if stamp_s is None:
            stamp_s = read_time(text, self._formats, self._clock, self._previous_stamp_s)
        if stamp_s is None or not EARLIEST_S <= stamp_s <= LATEST_S:
            likely = [one for one in likely_time_formats(text) if one not in self._formats]
            remedy = f"if it is {' or '.join(likely[:2])}, add this to time.formats" if likely else ""
            if stamp_s is None:
                message = f"{text[:60]!r} is not a time as in {' or '.join(self._formats)}"
                _lose(Kind.BAD_TIME, message, column, remedy)
            battery = "set the logger's clock; its backup battery may be empty"
            _lose(Kind.BAD_TIME, f"the time {text!r} is before 1990 or after 2099", column, remedy or battery)
        if isinstance(self._clock, ZoneInfo) and (doubt := zone_doubt(text, self._formats, self._clock, stamp_s)):
            self._note(Kind.LOCAL_TIME, f"{text!r} {doubt}", column, "see logger_time_zone in the site file")
        return stamp_s

    def _require_order(self, text: str, column: str) -> None:
        """Decide on the order of day and month from a stamp that has one reading; later ones have it, too."""
        readings = {order_of(name): read_time(text, [name]) for name in self._rivals if read_time(text, [name])}
        if len(set(readings.values())) > 1:
            dates = " or ".join(
                f"{date_text(stamp_s)} ({order})" for order, stamp_s in readings.items() if stamp_s
            )
            remedy = "write one of these words as 'date_order' below 'time' in the logger format"
            _lose(Kind.BAD_TIME, f"{text!r} is {dates}, and no stamp before it decides", column, remedy)
        if readings:
            self._formats = [
                name for name in self._formats if name not in self._rivals or order_of(name) in readings
            ]
            self._rivals = ()

    def _record_number(self, fields: Sequence[str]) -> int:
        source = self.layout.record_number
        if source is None or self._is_missing(fields[source.index]):
            return -1
        number = self._read(fields[source.index])
        if number is None or number < 0 or number != int(number):
            self._note(Kind.NOT_A_NUMBER, f"{fields[source.index][:40]!r} is no record number", source.name)
            return -1
        return int(number)

    def _live_times(
        self, fields: Sequence[str], period_s: float | None, since_s: float, steps: int
    ) -> list[float]:
        """Live time of each tube [s], NaN if it did not count; ``steps`` is the difference of record numbers, 1
        without.
        """
        if self._logger.live_time.from_stamps and not any(self.layout.live):
            if period_s is None:
                live_s = self._interval(since_s, steps)
            elif 0 < since_s < 1.5 * period_s:
                live_s = since_s
            else:
                live_s = self._assumed_live_time(period_s, "the previous line's time is not known")
            return [live_s] * len(self.layout.tubes)
        return [self._live_time(fields, source, period_s) for source in self.layout.live]

    def _interval(self, since_s: float, steps: int) -> float:
        """Counting interval of a logger without a nominal period [s]: the time since the previous record.

        After missing records it is the usual interval. After a restart, or when the logger stood still, it is
        unknown; a longer interval that returns becomes the usual one.
        """
        if steps > 1 and math.isfinite(self._usual_s):
            return self._assumed_live_time(self._usual_s, "records are missing before this one")
        runs, returns = steps == 1 and since_s > 0, abs(since_s - self._unusual_s) < 1.0
        if not runs or (since_s > 1.5 * self._usual_s and not returns):
            self._unusual_s = since_s if runs else NAN
            what = "the logger stood still" if runs else "the logger has just started"
            _lose(Kind.NO_LIVE_TIME, f"{what}: how long this record counted is unknown")
        self._usual_s, self._unusual_s = since_s, NAN
        return since_s

    def _live_time(self, fields: Sequence[str], source: Source | None, period_s: float | None) -> float:
        if source is None:
            if self._logger.live_time.columns:
                return self._assumed_live_time(period_s, "no column has the live time")
            return self._period(period_s)
        text = fields[source.index]
        if self._is_missing(text):
            return self._assumed_live_time(period_s, "the live time is missing")
        number = self._read(text)
        if number is None:
            _lose(Kind.NOT_A_NUMBER, f"the live time {text[:40]!r} is not a number", source.name, _likely(text))
        live_s = source.convert(number)
        low, high = self._logger.live_time.range
        if live_s == 0:
            return NAN  # the tube did not count in this record
        if not low <= live_s <= high:
            _lose(Kind.OUT_OF_RANGE, f"the live time {live_s:g} s is not within {low:g}..{high:g}", source.name)
        return live_s

    def _assumed_live_time(self, period_s: float | None, why: str) -> float:
        period = self._period(period_s)
        self._note(Kind.ASSUMED_LIVE_TIME, f"{why}; the record period of {period:g} s is used")
        return period

    def _period(self, period_s: float | None) -> float:
        if period_s is None:
            _lose(
                Kind.NO_LIVE_TIME,
                "neither a live time nor a record period is known",
                remedy="give record_period.default_s in the logger format",
            )
        return period_s

    def _counts(self, fields: Sequence[str], live: Sequence[float]) -> list[float]:
        left_out = self._logger.counts.left_out
        counts = []
        for tube, source, live_s in zip(self.layout.tubes, self.layout.counts, live, strict=True):
            count = NAN if tube in left_out else self._count(fields[source.index], source, live_s)
            if math.isnan(count) and tube not in left_out:
                self._note(Kind.MISSING_TUBE, f"tube {tube} gave no counts", source.name, "check its cable")
            counts.append(count)
        if all(math.isnan(count) for count in counts):
            _lose(Kind.NO_COUNTS, "no tube gave counts")
        return counts

    def _count(self, text: str, source: Source, live_s: float) -> float:
        """Counts of one tube; NaN if it did not count."""
        settings = self._logger.counts
        if self._is_missing(text):
            return NAN
        number = self._read(text)
        if number is None:
            _lose(Kind.NOT_A_NUMBER, f"the count {text[:40]!r} is not a number", source.name, _likely(text))
        if number in settings.sentinels or math.isnan(live_s):
            return NAN
        if number < 0:
            _lose(Kind.NEGATIVE_COUNT, f"the count {number:g} is negative", source.name)
        if settings.unit != "counts":
            number = self._whole(number, live_s, source)
        elif number != int(number):
            remedy = f"if it is a rate, write 'unit: {' or '.join(RATE_TIME_S)}' below 'counts'"
            _lose(Kind.NOT_WHOLE, f"the count {number:.10g} is not a whole number", source.name, remedy)
        low, high = settings.range
        if not low <= number <= high:
            _lose(Kind.OUT_OF_RANGE, f"the count {number:g} is not within {low:g}..{high:g}", source.name)
        return number

    def _whole(self, rate: float, live_s: float, source: Source) -> float:
        time_s = RATE_TIME_S[self._logger.counts.unit]
        counts = rate * live_s / time_s
        whole = float(round(counts))
        if abs(counts - whole) > self._logger.counts.rounding_tolerance:
            per = {1.0: "s", 60.0: "min", 3600.0: "h"}[time_s]
            message = f"{rate:g}/{per} times {live_s:g} s is {counts:.2f} counts"
            remedy = "take the raw counts: if these were corrected or smoothed, they are corrected twice"
            self._note(Kind.ROUNDED_COUNT, message, source.name, remedy)
        return whole

    def _quantity(self, fields: Sequence[str], name: Quantity, quantity: AirQuantity | None) -> float:
        """Value of the first sensor with a credible value, NaN if there is none."""
        sources = self.layout.air[name]
        if quantity is None or not sources:
            return NAN
        low, high = quantity.range
        unread = False
        for source in sources:
            text = fields[source.index]
            if self._is_missing(text):
                continue
            number = self._read(text)
            if number is None:
                unread, message = True, f"the {name} {text[:40]!r} is not a number"
                self._note(Kind.NOT_A_NUMBER, message, source.name, _likely(text))
            elif number in quantity.sentinels:
                self._note(Kind.SENTINEL, f"the {name} {number:g} is the mark for a missing value", source.name)
            elif not low <= source.convert(number) <= high:
                message = f"the {name} {number:g} is not credible ({low:g}..{high:g})"
                remedy = remedy_of_unit(name, number, low, high, "check the sensor")
                self._note(Kind.OUT_OF_RANGE, message, source.name, remedy)
            else:
                return source.convert(number)
        if not unread:
            self._note(Kind.MISSING_VALUE, f"no {name}")
        return NAN

    def _position(self, fields: Sequence[str], layout: Mapping[str, Source]) -> Position | None:
        settings = self._logger.position
        assert settings is not None
        quality = fields[layout["quality"].index].strip() if "quality" in layout else ""
        noted = len(self._notes)
        if settings.notation == "auto":
            self._packed = self._packed or is_packed(fields[layout["latitude"].index], self._logger.decimal)
        else:
            self._packed = settings.notation == "degrees_minutes"
        latitude = self._coordinate(fields, layout["latitude"], layout.get("latitude_hemisphere"), 90)
        longitude = self._coordinate(fields, layout["longitude"], layout.get("longitude_hemisphere"), 180)
        if latitude is None or longitude is None:
            if len(self._notes) == noted:
                self._note(Kind.NO_FIX, "no position fix", layout["latitude"].name)
            return None
        nowhere = settings.zero_is_no_fix and latitude == 0 and longitude == 0
        if nowhere or ("quality" in layout and quality in settings.no_fix_quality):
            self._note(Kind.NO_FIX, "no position fix", layout["latitude"].name)
            return None
        if not settings.longitude_signed:
            if self._side == "east" and longitude < 0:
                message = f"the longitude {longitude:g} is west, the site file says east"
                self._note(
                    Kind.BAD_POSITION, message, layout["longitude"].name, "correct 'longitude' in the site file"
                )
                return None
            longitude = -abs(longitude) if self._side == "west" else longitude
        altitude = self._number(fields, layout.get("altitude"))
        hdop = self._number(fields, layout.get("hdop"))
        sd = gnss.horizontal_sd(int(quality) if quality in set("12345678") else 1, hdop)
        return Position(latitude, longitude, altitude if -500 <= altitude <= 9000 else NAN, sd)

    def _coordinate(
        self, fields: Sequence[str], source: Source, side: Source | None, limit: float
    ) -> float | None:
        written = fields[source.index]
        if self._is_missing(written):
            return None
        text = written if side is None else f"{written} {fields[side.index]}"
        decimal = self._logger.decimal
        value = read_coordinate(text, self._packed, decimal)
        if value is not None and limit == 180 and 180 < value <= 360:
            value -= 360  # of an instrument that counts from 0 to 360
        if value is not None and abs(value) <= limit:
            return value
        self._note(
            Kind.BAD_POSITION,
            f"{text[:40]!r} is no {'longitude' if limit == 180 else 'latitude'} within {limit:g} degrees",
            source.name,
            _likely_coordinate(written, self._packed, decimal, limit),
        )
        return None

    def _number(self, fields: Sequence[str], source: Source | None) -> float:
        number = None if source is None else self._read(fields[source.index])
        return NAN if number is None else number

    def _gnss_offset(self, fields: Sequence[str], record: LoggerRecord) -> float:
        settings, layout = self._logger.position, self.layout.position
        if settings is None or "time_of_day" not in layout or record.position is None:
            return NAN
        text = "1970-01-01 " + fields[layout["time_of_day"].index].strip()
        time_of_day = read_time(text, [f"%Y-%m-%d {settings.time_of_day_format}"])
        if time_of_day is None:
            return NAN
        return (record.stamp_s - time_of_day + HALF_DAY_S) % (2 * HALF_DAY_S) - HALF_DAY_S


def _lose(kind: Kind, message: str, column: str = "", remedy: str = "") -> NoReturn:
    raise LostRecordError(kind, message, column, remedy)


def _likely(text: str) -> str:
    """Advice on a text that is no number."""
    if re.fullmatch(r"[+-]?\d+,\d+", text.strip(), re.ASCII):
        return "if it has a decimal comma, write 'decimal: comma' in the logger format"
    if re.fullmatch(r"[#*?A-Za-z./_-]+", text.strip(), re.ASCII):
        return "if it marks a missing value, add it to 'missing' in the logger format"
    return ""


def _likely_coordinate(text: str, packed: bool, decimal: Decimal, limit: float) -> str:
    """Advice on a coordinate that cannot be read as the others of its file are."""
    other = read_coordinate(text, not packed, decimal)
    if other is not None and abs(other) <= limit:
        notation = "degrees" if packed else "degrees_minutes"
        return f"as {notation} it is {other:.5f}: write 'notation: {notation}' below 'position' if all are"
    return _likely(text) if read_number(text, decimal) is None else "check the columns of the position"
