# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Converts the fields of one line to a record: units, live times, range checks, choice of sensors."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Literal
from zoneinfo import ZoneInfo

from soilmoist_ros.sensing import gnss
from soilmoist_ros.sensing.formats.log_layout import Layout, Source
from soilmoist_ros.sensing.formats.log_values import (
    Quantity,
    likely_time_formats,
    read_coordinate,
    read_number,
    read_time,
    remedy_of_unit,
    zone_doubt,
)
from soilmoist_ros.sensing.formats.logger_format import RATE_TIME_S, ROUNDING_TOLERANCE, LoggerFormat
from soilmoist_ros.sensing.formats.notation import is_packed, stamp_text
from soilmoist_ros.sensing.problems import Finding, Kind, LostRecordError
from soilmoist_ros.sensing.records import NAN, LoggerRecord, Position

Longitude = Literal["signed", "east", "west"]

EARLIEST_S = 631_152_000.0  # 1990-01-01: clocks with an empty battery start in 1970 or 1980
LATEST_S = 4_102_444_800.0  # 2100-01-01
HALF_DAY_S = 43_200.0
_NO_NUMBER = "write 'decimal: comma' in the logger format, or add a mark of missing values to its 'missing'"


class FieldReader:
    """Reads the fields of the lines of one log; the side of Greenwich is for longitudes without a sign."""

    def __init__(self, logger: LoggerFormat, layout: Layout, longitude: Longitude) -> None:
        self._logger = logger
        self.layout = layout
        self.notes: list[Finding] = []
        """Faults of the last record that did not drop it."""
        self._side = longitude
        self._missing = {text.casefold() for text in logger.missing} | {""}
        self._clock = logger.time.clock
        self._rivals = logger.time.rivals if logger.time.date_order == "auto" else ()
        self._formats = [name for name in logger.time.used_formats if name not in self._rivals]
        self._packed = False
        self.stamp_s, self._previous_number = NAN, -1
        """Stamp of the last record as its line has it [s since 1970 UTC]."""
        self._usual_s, self._unusual_s = NAN, NAN

    def read(self, fields: Sequence[str], period_s: float | None, line: int) -> LoggerRecord:
        """Convert one line to a record.

        :raises LostRecordError: if the line has no usable record
        """
        self.notes = []
        stamp_s = self._stamp(fields)
        number = self._record_number(fields)
        since_s, steps = stamp_s - self.stamp_s, number - self._previous_number
        self.stamp_s, self._previous_number = stamp_s, number
        live = self._live_times(fields, period_s, since_s, 1 if number < 0 else steps)
        counts = self._counts(fields, live)
        live = [NAN if math.isnan(count) else time for count, time in zip(counts, live, strict=True)]
        live_s = max(time for time in live if not math.isnan(time))
        if period_s is not None and live_s < self._logger.record_period.minimal_live_fraction * period_s:
            self._note(Kind.SHORT_LIVE_TIME, f"only {live_s:g} s of {period_s:g} s were counted")
        if self._logger.time.marks == "start":
            stamp_s += period_s or live_s
        pressure, temperature, humidity = (self._air(fields, name) for name in self._logger.air)
        return LoggerRecord(
            stamp_s=stamp_s, tube_counts=tuple(counts), tube_live_s=tuple(live), pressure_hpa=pressure,
            temperature_degc=temperature, relative_humidity=1.0 if humidity > 1.0 else humidity,
            position=self._position(fields, self.layout.position) if self.layout.position else None, line=line,
            record_number=number,
        )  # fmt: skip

    def left_out(self, fields: Sequence[str]) -> dict[int, float]:
        """Counts of the tubes that the format leaves out, by number."""
        columns = zip(self.layout.tubes, self.layout.counts, strict=True)
        return {
            tube: max(self._number(fields, source) or 0.0, 0.0)
            for tube, source in columns
            if tube in self._logger.counts.left_out
        }

    def clock_ahead_s(self, fields: Sequence[str], record: LoggerRecord) -> float:
        """Logger's time of day minus that of the receiver in the line [s], NaN if unknown."""
        settings, source = self._logger.position, self.layout.position.get("time_of_day")
        if settings is None or source is None or record.position is None:
            return NAN
        form = f"%Y-%m-%d {settings.time_of_day_format}"
        time_of_day_s = read_time(f"1970-01-01 {fields[source.index].strip()}", [form])
        if time_of_day_s is None:
            return NAN
        return (record.stamp_s - time_of_day_s + HALF_DAY_S) % (2 * HALF_DAY_S) - HALF_DAY_S

    def _note(self, kind: Kind, message: str, column: str = "", remedy: str = "") -> None:
        self.notes.append(Finding(kind, message, remedy, column=column))

    def _text(self, fields: Sequence[str], source: Source | None) -> str:
        """Text of a field, empty if there is none or it marks a missing value."""
        text = "" if source is None else fields[source.index].strip()
        return "" if text.casefold() in self._missing else text

    def _number(self, fields: Sequence[str], source: Source | None) -> float | None:
        return None if source is None else read_number(fields[source.index], self._logger.decimal)

    def _stamp(self, fields: Sequence[str]) -> float:
        text = stamp_text(fields, self.layout)
        column = "+".join(source.name for source in self.layout.time)
        stamp_s = read_time(text, self._formats, self._clock, self.stamp_s)
        if stamp_s is None and read_time(text, self._rivals) is not None:
            remedy = "write 'date_order: day_first' or 'date_order: month_first' below 'time' in the logger format"
            raise LostRecordError(Kind.BAD_TIME, f"{text!r} has two orders of day and month", column, remedy)
        if stamp_s is None or not EARLIEST_S <= stamp_s <= LATEST_S:
            likely = [one for one in likely_time_formats(text) if one not in self._formats]
            remedy = f"if it is {' or '.join(likely[:2])}, add this to time.formats" if likely else ""
            message = f"{text[:60]!r} is not a time as in {' or '.join(self._formats)}"
            if stamp_s is not None:
                message = f"the time {text!r} is before 1990 or after 2099"
                remedy = remedy or "set the logger's clock; its backup battery may be empty"
            raise LostRecordError(Kind.BAD_TIME, message, column, remedy)
        if isinstance(self._clock, ZoneInfo) and (doubt := zone_doubt(text, self._formats, self._clock, stamp_s)):
            self._note(Kind.LOCAL_TIME, f"{text!r} {doubt}", column, "see logger_time_zone in the site file")
        return stamp_s

    def _record_number(self, fields: Sequence[str]) -> int:
        source = self.layout.record_number
        if source is None or not (text := self._text(fields, source)):
            return -1
        number = self._number(fields, source)
        if number is None or number < 0 or number != int(number):
            self._note(Kind.NOT_A_NUMBER, f"{text[:40]!r} is no record number", source.name)
            return -1
        return int(number)

    def _live_times(
        self, fields: Sequence[str], period_s: float | None, since_s: float, steps: int
    ) -> list[float]:
        """Live time of each tube [s], NaN if it did not count; ``steps`` is the difference of record numbers, 1
        without.
        """
        if not self._logger.live_time.from_stamps or any(self.layout.live):
            return [self._live_time(fields, source, period_s) for source in self.layout.live]
        if period_s is None:
            live_s = self._interval(since_s, steps)
        elif 0 < since_s < 1.5 * period_s:
            live_s = since_s
        else:
            live_s = self._assumed_live_time(period_s, "the previous line's time is not known")
        return [live_s] * len(self.layout.tubes)

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
            raise LostRecordError(Kind.NO_LIVE_TIME, f"{what}: how long this record counted is unknown")
        self._usual_s, self._unusual_s = since_s, NAN
        return since_s

    def _live_time(self, fields: Sequence[str], source: Source | None, period_s: float | None) -> float:
        if source is None:
            if self._logger.live_time.columns:
                return self._assumed_live_time(period_s, "no column has the live time")
            return _known(period_s)
        if not (text := self._text(fields, source)):
            return self._assumed_live_time(period_s, "the live time is missing")
        if (number := self._number(fields, source)) is None:
            message = f"the live time {text[:40]!r} is not a number"
            raise LostRecordError(Kind.NOT_A_NUMBER, message, source.name, _NO_NUMBER)
        live_s = source.convert(number)
        low, high = self._logger.live_time.range
        if live_s != 0 and not low <= live_s <= high:
            message = f"the live time {live_s:g} s is not within {low:g}..{high:g}"
            raise LostRecordError(Kind.OUT_OF_RANGE, message, source.name)
        return live_s or NAN  # with 0 the tube did not count in this record

    def _assumed_live_time(self, period_s: float | None, why: str) -> float:
        period = _known(period_s)
        self._note(Kind.ASSUMED_LIVE_TIME, f"{why}; the record period of {period:g} s is used")
        return period

    def _counts(self, fields: Sequence[str], live: Sequence[float]) -> list[float]:
        left_out = self._logger.counts.left_out
        counts = []
        for tube, source, live_s in zip(self.layout.tubes, self.layout.counts, live, strict=True):
            count = NAN if tube in left_out else self._count(fields, source, live_s)
            if math.isnan(count) and tube not in left_out:
                self._note(Kind.MISSING_TUBE, f"tube {tube} gave no counts", source.name, "check its cable")
            counts.append(count)
        if all(math.isnan(count) for count in counts):
            raise LostRecordError(Kind.NO_COUNTS, "no tube gave counts")
        return counts

    def _count(self, fields: Sequence[str], source: Source, live_s: float) -> float:
        """Counts of one tube; NaN if it did not count."""
        settings = self._logger.counts
        if not (text := self._text(fields, source)):
            return NAN
        if (number := self._number(fields, source)) is None:
            message = f"the count {text[:40]!r} is not a number"
            raise LostRecordError(Kind.NOT_A_NUMBER, message, source.name, _NO_NUMBER)
        if number in settings.sentinels or math.isnan(live_s):
            return NAN
        if number < 0:
            raise LostRecordError(Kind.NEGATIVE_COUNT, f"the count {number:g} is negative", source.name)
        if settings.unit != "counts":
            number = self._whole(number, live_s, source)
        elif number != int(number):
            remedy = f"if it is a rate, write 'unit: {' or '.join(RATE_TIME_S)}' below 'counts'"
            message = f"the count {number:.10g} is not a whole number"
            raise LostRecordError(Kind.NOT_WHOLE, message, source.name, remedy)
        low, high = settings.range
        if not low <= number <= high:
            message = f"the count {number:g} is not within {low:g}..{high:g}"
            raise LostRecordError(Kind.OUT_OF_RANGE, message, source.name)
        return number

    def _whole(self, rate: float, live_s: float, source: Source) -> float:
        time_s = RATE_TIME_S[self._logger.counts.unit]
        counts = rate * live_s / time_s
        whole = float(round(counts))
        if abs(counts - whole) > ROUNDING_TOLERANCE:
            per = {1.0: "s", 60.0: "min", 3600.0: "h"}[time_s]
            message = f"{rate:g}/{per} times {live_s:g} s is {counts:.2f} counts"
            remedy = "take the raw counts: if these were corrected or smoothed, they are corrected twice"
            self._note(Kind.ROUNDED_COUNT, message, source.name, remedy)
        return whole

    def _air(self, fields: Sequence[str], name: Quantity) -> float:
        """Value of the first sensor with a credible value, NaN if there is none."""
        quantity, sources = self._logger.air[name], self.layout.air[name]
        if quantity is None or not sources:
            return NAN
        low, high = quantity.range
        unread = False
        for source in sources:
            if not (text := self._text(fields, source)):
                continue
            if (number := self._number(fields, source)) is None:
                unread = True
                message = f"the {name} {text[:40]!r} is not a number"
                self._note(Kind.NOT_A_NUMBER, message, source.name, _NO_NUMBER)
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
        noted = len(self.notes)
        if settings.notation == "auto":
            self._packed = self._packed or is_packed(fields[layout["latitude"].index], self._logger.decimal)
        else:
            self._packed = settings.notation == "degrees_minutes"
        latitude = self._coordinate(fields, "latitude", 90)
        longitude = self._coordinate(fields, "longitude", 180)
        quality = fields[layout["quality"].index].strip() if "quality" in layout else None
        if len(self.notes) > noted:
            return None
        nowhere = latitude == longitude == 0
        if latitude is None or longitude is None or nowhere or quality in settings.no_fix_quality:
            self._note(Kind.NO_FIX, "no position fix", layout["latitude"].name)
            return None
        if not settings.longitude_signed:
            if self._side == "east" and longitude < 0:
                message = f"the longitude {longitude:g} is west, the site file says east"
                remedy = "correct 'longitude' in the site file"
                self._note(Kind.BAD_POSITION, message, layout["longitude"].name, remedy)
                return None
            longitude = -abs(longitude) if self._side == "west" else longitude
        altitude, hdop = (self._number(fields, layout.get(name)) for name in ("altitude", "hdop"))
        level = next((int(known) for known in "12345678" if known == quality), 1)
        sd_m = gnss.horizontal_sd(level, NAN if hdop is None else hdop)
        if altitude is None or not -500 <= altitude <= 9000:
            altitude = NAN
        return Position(latitude, longitude, altitude, sd_m)

    def _coordinate(self, fields: Sequence[str], name: str, limit: float) -> float | None:
        """Latitude or longitude [deg], ``None`` if it is missing, or noted as unreadable."""
        source, side = self.layout.position[name], self.layout.position.get(f"{name}_hemisphere")
        if not (written := self._text(fields, source)):
            return None
        text = written if side is None else f"{written} {fields[side.index]}"
        packed, decimal = self._packed, self._logger.decimal
        value = read_coordinate(text, packed, decimal)
        if value is not None and limit == 180 and 180 < value <= 360:
            value -= 360  # of an instrument that counts from 0 to 360
        if value is not None and abs(value) <= limit:
            return value
        remedy, other = "check the columns of the position", read_coordinate(written, not packed, decimal)
        if other is not None and abs(other) <= limit:
            notation = "degrees" if packed else "degrees_minutes"
            remedy = f"as {notation} it is {other:.5f}: write 'notation: {notation}' below 'position' if all are"
        message = f"{text[:40]!r} is no {name} within {limit:g} degrees"
        self._note(Kind.BAD_POSITION, message, source.name, remedy)
        return None


def _known(period_s: float | None) -> float:
    if period_s is None:
        remedy = "give record_period.default_s in the logger format"
        message = "neither a live time nor a record period is known"
        raise LostRecordError(Kind.NO_LIVE_TIME, message, remedy=remedy)
    return period_s
