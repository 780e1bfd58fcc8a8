# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Converts the fields of one line to a record: units, live times, range checks, choice of sensors."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Literal, NoReturn

from soilmoist_ros.sensing import gnss
from soilmoist_ros.sensing.checks.weather import remedy_of_unit
from soilmoist_ros.sensing.formats.log_layout import Layout, PositionLayout, Source
from soilmoist_ros.sensing.formats.log_values import read_number, read_time
from soilmoist_ros.sensing.formats.logger_format import Humidity, LoggerFormat, Pressure, Temperature
from soilmoist_ros.sensing.problems import Kind
from soilmoist_ros.sensing.records import NAN, LoggerRecord, Position

Longitude = Literal["signed", "east", "west"]

EARLIEST_S = 631_152_000.0  # 1990-01-01: clocks with an empty battery start in 1970 or 1980
LATEST_S = 4_102_444_800.0  # 2100-01-01
HALF_DAY_S = 43_200.0


class LostRecordError(Exception):
    """The line is damaged, or the record has no counts."""

    def __init__(self, kind: Kind, message: str, column: str = "", remedy: str = "") -> None:
        self.note = Note(kind, message, column, remedy)
        super().__init__(message)


@dataclass(frozen=True)
class Note:
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
    """

    record: LoggerRecord
    key: int
    notes: list[Note] = field(default_factory=list)
    gnss_offset_s: float = NAN


class FieldReader:
    """Reads the fields of the lines of one log.

    :param logger: format of the log
    :param layout: columns of the log
    :param longitude: side of Greenwich, for formats that write longitudes without a sign
    """

    def __init__(self, logger: LoggerFormat, layout: Layout, longitude: Longitude) -> None:
        self._logger = logger
        self.layout = layout
        self._side = longitude
        self._missing = {text.casefold() for text in logger.missing} | {""}
        self._notes: list[Note] = []
        self._previous_stamp_s, self._previous_number = NAN, -1
        self._usual_s, self._unusual_s = NAN, NAN

    def read(self, fields: Sequence[str], period_s: float | None, line: int) -> Reading:
        """Convert one line to a record.

        :param fields: fields of the line, one for each name of the layout
        :param period_s: nominal duration of a record [s], ``None`` if unknown
        :param line: number of the line
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
        self._check_live_time(live_s, period_s)
        # Not the counts of the record: those of a rate depend on the time since the line before.
        written = (read_number(fields[source.index]) for source in self.layout.counts)
        key = hash((number, stamp_s, *written))  # the numbers need five times the memory
        if self._logger.time.marks == "start":
            stamp_s += period_s or live_s
        humidity = self._quantity(fields, "humidity", self._logger.humidity, self.layout.humidity)
        record = LoggerRecord(
            stamp_s=stamp_s,
            tube_counts=tuple(counts),
            tube_live_s=tuple(live),
            pressure_hpa=self._quantity(fields, "pressure", self._logger.pressure, self.layout.pressure),
            temperature_degc=self._quantity(
                fields, "temperature", self._logger.temperature, self.layout.temperature
            ),
            relative_humidity=humidity if math.isnan(humidity) else min(humidity, 1.0),
            position=self._position(fields, self.layout.position) if self.layout.position else None,
            line=line,
            record_number=number,
        )
        return Reading(record, key, self._notes, self._gnss_offset(fields, record))

    def _note(self, kind: Kind, message: str, column: str = "", remedy: str = "") -> None:
        self._notes.append(Note(kind, message, column, remedy))

    def _is_missing(self, text: str) -> bool:
        return text.strip().casefold() in self._missing

    def _stamp(self, fields: Sequence[str]) -> float:
        time = self._logger.time
        text = " ".join(fields[source.index].strip() for source in self.layout.time)
        column = "+".join(source.name for source in self.layout.time)
        stamp_s = read_time(text, time.formats, time.utc_offset_hours)
        if stamp_s is None:
            _lose(Kind.BAD_TIME, f"{text[:60]!r} is not a time as in {' or '.join(time.formats)}", column)
        if not EARLIEST_S <= stamp_s <= LATEST_S:
            _lose(
                Kind.BAD_TIME,
                f"the time {text!r} is before 1990 or after 2099",
                column,
                "set the logger's clock; its backup battery may be empty",
            )
        return stamp_s

    def _record_number(self, fields: Sequence[str]) -> int:
        source = self.layout.record_number
        if source is None or self._is_missing(fields[source.index]):
            return -1
        number = read_number(fields[source.index])
        if number is None or number < 0 or number != int(number):
            self._note(Kind.NOT_A_NUMBER, f"{fields[source.index][:40]!r} is no record number", source.name)
            return -1
        return int(number)

    def _live_times(
        self, fields: Sequence[str], period_s: float | None, since_s: float, steps: int
    ) -> list[float]:
        """Live time of each tube [s]; NaN if the tube did not count.

        :param since_s: time since the previous record [s]
        :param steps: difference to the record number before, 1 without numbers
        """
        if self._logger.live_time.from_stamps and not any(self.layout.live):
            live_s = self._interval(since_s, steps) if period_s is None else self._time_since(period_s, since_s)
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

    def _time_since(self, period_s: float, since_s: float) -> float:
        """Time since the previous line [s]; the record period if the previous line is missing."""
        if 0 < since_s < 1.5 * period_s:
            return since_s
        return self._assumed_live_time(period_s, "the previous line's time is not known")

    def _live_time(self, fields: Sequence[str], source: Source | None, period_s: float | None) -> float:
        if source is None:
            if self._logger.live_time.columns:
                return self._assumed_live_time(period_s, "no column has the live time")
            return self._period(period_s)
        text = fields[source.index]
        if self._is_missing(text):
            return self._assumed_live_time(period_s, "the live time is missing")
        number = read_number(text)
        if number is None:
            _lose(Kind.NOT_A_NUMBER, f"the live time {text[:40]!r} is not a number", source.name)
        live_s = source.convert(number)
        low, high = self._logger.live_time.range
        if live_s == 0:
            return NAN  # the tube did not count in this record
        if not low <= live_s <= high:
            _lose(
                Kind.OUT_OF_RANGE,
                f"the live time {live_s:g} s is not within {low:g}..{high:g}",
                source.name,
            )
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

    def _check_live_time(self, live_s: float, period_s: float | None) -> None:
        fraction = self._logger.record_period.minimal_live_fraction
        if period_s is not None and live_s < fraction * period_s:
            self._note(Kind.SHORT_LIVE_TIME, f"only {live_s:g} s of {period_s:g} s were counted")

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
        """Counts of one tube; NaN if it did not count.

        :raises LostRecordError: if the field is damaged
        """
        settings = self._logger.counts
        if self._is_missing(text):
            return NAN
        number = read_number(text)
        if number is None:
            _lose(Kind.NOT_A_NUMBER, f"the count {text[:40]!r} is not a number", source.name)
        if number in settings.sentinels or math.isnan(live_s):
            return NAN
        if number < 0:
            _lose(Kind.NEGATIVE_COUNT, f"the count {number:g} is negative", source.name)
        if settings.unit == "counts_per_second":
            number = self._whole(number, live_s, source)
        elif number != int(number):
            _lose(Kind.NOT_WHOLE, f"the count {number:g} is not a whole number", source.name)
        low, high = settings.range
        if not low <= number <= high:
            _lose(Kind.OUT_OF_RANGE, f"the count {number:g} is not within {low:g}..{high:g}", source.name)
        return number

    def _whole(self, rate_cps: float, live_s: float, source: Source) -> float:
        counts = rate_cps * live_s
        whole = float(round(counts))
        if abs(counts - whole) > self._logger.counts.rounding_tolerance:
            self._note(
                Kind.ROUNDED_COUNT, f"{rate_cps:g}/s times {live_s:g} s is {counts:.2f} counts", source.name
            )
        return whole

    def _quantity(
        self,
        fields: Sequence[str],
        name: str,
        quantity: Pressure | Temperature | Humidity | None,
        sources: Sequence[Source],
    ) -> float:
        """Value of the first sensor with a credible value, NaN if there is none."""
        if quantity is None or not sources:
            return NAN
        low, high = quantity.range
        for source in sources:
            text = fields[source.index]
            if self._is_missing(text):
                continue
            number = read_number(text)
            if number is None:
                self._note(Kind.NOT_A_NUMBER, f"the {name} {text[:40]!r} is not a number", source.name)
            elif number in quantity.sentinels:
                self._note(Kind.SENTINEL, f"the {name} {number:g} is the mark for a missing value", source.name)
            elif not low <= source.convert(number) <= high:
                message = f"the {name} {number:g} is not credible ({low:g}..{high:g})"
                remedy = remedy_of_unit(name, number, low, high, "check the sensor")
                self._note(Kind.OUT_OF_RANGE, message, source.name, remedy)
            else:
                return source.convert(number)
        self._note(Kind.MISSING_VALUE, f"no {name}")
        return NAN

    def _position(self, fields: Sequence[str], layout: PositionLayout) -> Position | None:
        settings = self._logger.position
        assert settings is not None
        quality = fields[layout.quality.index].strip() if layout.quality else ""
        latitude = self._coordinate(fields, layout.latitude, 90)
        longitude = self._coordinate(fields, layout.longitude, 180)
        nowhere = settings.zero_is_no_fix and latitude == 0 and longitude == 0
        if (
            latitude is None
            or longitude is None
            or nowhere
            or (layout.quality and quality in settings.no_fix_quality)
        ):
            self._note(Kind.NO_FIX, "no position fix", layout.latitude.name)
            return None
        if not settings.longitude_signed:
            if self._side == "east" and longitude < 0:
                message = f"the longitude {longitude:g} is west, the site file says east"
                self._note(
                    Kind.OUT_OF_RANGE, message, layout.longitude.name, "correct 'longitude' in the site file"
                )
                return None
            longitude = -abs(longitude) if self._side == "west" else longitude
        altitude = self._number(fields, layout.altitude)
        hdop = self._number(fields, layout.hdop)
        sd = gnss.horizontal_sd(int(quality) if quality in set("12345678") else 1, hdop)
        return Position(latitude, longitude, altitude if -500 <= altitude <= 9000 else NAN, sd)

    def _coordinate(self, fields: Sequence[str], source: Source, limit: float) -> float | None:
        text = fields[source.index]
        number = read_number(text)
        if number is not None and abs(number) <= limit:
            return number
        if not self._is_missing(text):
            self._note(Kind.OUT_OF_RANGE, f"{text[:40]!r} is not within {limit:g} degrees", source.name)
        return None

    def _number(self, fields: Sequence[str], source: Source | None) -> float:
        number = None if source is None else read_number(fields[source.index])
        return NAN if number is None else number

    def _gnss_offset(self, fields: Sequence[str], record: LoggerRecord) -> float:
        settings, layout = self._logger.position, self.layout.position
        if settings is None or layout is None or layout.time_of_day is None or record.position is None:
            return NAN
        text = "1970-01-01 " + fields[layout.time_of_day.index].strip()
        time_of_day = read_time(text, [f"%Y-%m-%d {settings.time_of_day_format}"])
        if time_of_day is None:
            return NAN
        return (record.stamp_s - time_of_day + HALF_DAY_S) % (2 * HALF_DAY_S) - HALF_DAY_S


def _lose(kind: Kind, message: str, column: str = "", remedy: str = "") -> NoReturn:
    raise LostRecordError(kind, message, column, remedy)
