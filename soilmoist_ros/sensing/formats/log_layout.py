# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""The header of one log, and its columns with their quantities."""

from __future__ import annotations

import csv
import re
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace

from soilmoist_ros.sensing.formats import log_values as units
from soilmoist_ros.sensing.formats.log_values import canonical
from soilmoist_ros.sensing.formats.logger_format import AirQuantity, LoggerFormat
from soilmoist_ros.sensing.records import NAN

TUBE = "{tube}"
_PLACE = ("latitude", "longitude", "altitude", "quality", "hdop", "time_of_day",
          "latitude_hemisphere", "longitude_hemisphere")  # fmt: skip
"""Keys of the columns of a position."""
_SEPARATORS = {"comma": ",", "semicolon": ";", "tab": "\t", "whitespace": None}
MAX_METADATA = 500
_KEY_AND_VALUE = re.compile(r"\s*([^=:]{1,80}?)\s*[=:]\s*(\S.*?)\s*")


def plain_name(name: str) -> str:
    """Column name without case, blanks and punctuation, for comparison."""
    return re.sub(r"[^a-z0-9%]", "", name.casefold())


def split_fields(text: str, delimiter: str) -> list[str]:
    """Fields of a line without blanks around them; a quoted field may contain the separator."""
    separator = _SEPARATORS[delimiter]
    if separator and '"' in text:
        try:
            return [
                field.strip() for field in next(csv.reader([text], delimiter=separator, skipinitialspace=True))
            ]
        except csv.Error:
            pass
    return [field.strip() for field in text.split(separator)]


class MissingColumnsError(ValueError):
    """A header lacks columns that its format requires: quantity and alternative names of each."""

    def __init__(self, columns: Sequence[str]) -> None:
        self.columns = tuple(columns)
        super().__init__("no column " + "; no column ".join(self.columns))


@dataclass(frozen=True)
class Source:
    """Column of a quantity: its number from 0, its name in the header, and the conversion to the unit of this
    package.
    """

    index: int
    name: str
    convert: Callable[[float], float] = float


@dataclass(frozen=True)
class Layout:
    """Columns of one log.

    :param names: all names in the header
    :param time: columns of the stamp; several if date and time are separate
    :param tubes: numbers of the tubes, ascending; ``counts`` and ``live`` have the columns of each
    :param air: barometers, thermometers and hygrometers, each in order of preference
    :param position: columns of the position, by the key of the format; empty without latitude or longitude
    :param count_rate: unit of a count rate in the header of the counts, empty without one
    :param remarks: differences between the units of the header and the format, with the name of the column
    """

    names: tuple[str, ...]
    time: tuple[Source, ...]
    record_number: Source | None
    tubes: tuple[int, ...]
    counts: tuple[Source, ...]
    live: tuple[Source | None, ...]
    air: Mapping[units.Quantity, tuple[Source, ...]]
    position: Mapping[str, Source]
    count_rate: str = ""
    remarks: tuple[tuple[str, str], ...] = ()

    @property
    def values(self) -> list[Source]:
        """Columns of numbers: counts, live times and air."""
        live = [source for source in self.live if source is not None]
        return [*self.counts, *live, *(source for sensors in self.air.values() for source in sensors)]

    @property
    def number_of_sources(self) -> int:
        """Number of columns with a known quantity; the format with the highest number fits a header best."""
        return len(self.time) + len(self.values) + (self.record_number is not None) + 2 * bool(self.position)

    @property
    def unused(self) -> tuple[str, ...]:
        """Names of the columns that are not read."""
        used = {source.index for source in (*self.time, *self.values, *self.position.values())}
        used |= {self.record_number.index} if self.record_number else set()
        return tuple(name for index, name in enumerate(self.names) if name and index not in used)

    def fit(self, fields: list[str]) -> list[str] | None:
        """Fields with one for each name, ``None`` if their number does not fit; empty fields at the end are
        dropped.

        Letters N, S, E and W after the coordinates, which some headers do not name, are added to their
        coordinates.
        """
        count, place = len(self.names), self.position
        if len(fields) == count:
            return fields
        if len(fields) > count and not any(fields[count:]):
            return fields[:count]
        if len(fields) == count + 2 and place and "latitude_hemisphere" not in place:
            first, second = sorted((place["latitude"].index, place["longitude"].index))
            sides = {fields[first + 1].upper(), fields[second + 2].upper()}
            if sides in ({"N", "E"}, {"N", "W"}, {"S", "E"}, {"S", "W"}, {""}):
                joined = [*fields[:first], fields[first] + fields[first + 1], *fields[first + 2 : second + 1]]
                return [*joined, fields[second + 1] + fields[second + 2], *fields[second + 3 :]]
        return None

    @property
    def last_needed(self) -> int:
        """Index of the last column with a time, counts or a live time."""
        needed = [*self.time, *self.counts, *(source for source in self.live if source)]
        return max(source.index for source in needed)


class _Columns:
    """Finds names in a header."""

    def __init__(self, names: Sequence[str], given: Sequence[str] = ()) -> None:
        self.names = tuple(name.strip() for name in names)
        self._plain = [plain_name(name) for name in self.names]
        self.units = [*given, *[""] * len(self.names)]
        self.remarks: list[tuple[str, str]] = []

    def find(self, alternatives: Sequence[str], convert: Callable[[float], float] = float) -> Source | None:
        for name in alternatives:
            plain = plain_name(name)
            if plain and plain in self._plain:
                index = self._plain.index(plain)
                return Source(index, self.names[index], convert)
        return None

    def find_sensors(self, settings: AirQuantity | None, quantity: units.Quantity) -> tuple[Source, ...]:
        """Columns of the sensors; a unit in the header has priority over that of the format."""
        found = []
        for sensor in settings.sensors if settings else ():
            if (source := self.find([sensor.column])) is None:
                continue
            written = self.units[source.index]
            known = canonical(written)
            if known and not units.measures(quantity, known):
                self.remarks.append((source.name, f"{written!r} is no unit of {quantity}: the column is not read"))
                continue
            if written and not known:
                self.remarks.append((source.name, f"the unit {written!r} is unknown, {sensor.unit} is used"))
            elif known not in ("", sensor.unit) and not {known, sensor.unit} <= {"hPa", "mb", "mbar"}:
                remark = f"the header says {written}, the format {sensor.unit}: {known} is used"
                self.remarks.append((source.name, remark))
            found.append(replace(source, convert=units.converter(quantity, known or sensor.unit)))
        return tuple(found)

    def find_tubes(self, alternatives: Sequence[str]) -> dict[int, Source]:
        """Columns by tube number: those that match a pattern with ``{tube}``, or a plain name as tube 1."""
        for name in alternatives:
            before, tube, after = name.partition(TUBE)
            pattern = re.compile(rf"{plain_name(before)}0*(\d{{1,3}}){plain_name(after)}", re.ASCII)
            found: dict[int, Source] = {}
            if not tube and (single := self.find([name])):
                found[1] = single
            for index, plain in enumerate(self._plain if tube else ()):
                if match := pattern.fullmatch(plain):
                    found.setdefault(int(match[1]), Source(index, self.names[index]))
            if found:
                return dict(sorted(found.items()))
        return {}


def is_header(logger: LoggerFormat, fields: Sequence[str]) -> bool:
    """True if a line is a header: one of its fields is the name of a time column."""
    known = {plain_name(part) for name in logger.time.columns for part in name.split("+")}
    return any(plain_name(field) in known for field in fields)


def build_layout(logger: LoggerFormat, names: Sequence[str], given_units: Sequence[str] = ()) -> Layout:
    """Find the columns of a format in a header.

    :raises MissingColumnsError: if the time, the counts or a required position is missing
    """
    columns, place = _Columns(names, given_units), logger.position
    stamps = [[columns.find([part]) for part in name.split("+")] for name in logger.time.columns]
    time = next((tuple(filter(None, parts)) for parts in stamps if all(parts)), ())
    counts = columns.find_tubes(logger.counts.columns)
    position = {key: source for key in _PLACE if place and (source := columns.find(getattr(place, key)))}
    found = position if {"latitude", "longitude"} <= position.keys() else {}
    missing = [] if time else [f"of the time ({_or(logger.time.columns)})"]
    missing += [] if counts else [f"of the counts ({_or(logger.counts.columns)})"]
    if place and place.required and not found:
        missing.append(f"of the position ({_or([*place.latitude, *place.longitude])})")
    if missing:
        raise MissingColumnsError(missing)
    rates = [text for source in counts.values() for text in (columns.units[source.index], source.name)]
    return Layout(
        names=columns.names, time=time, record_number=columns.find(logger.record_number), tubes=tuple(counts),
        counts=tuple(counts.values()), live=_find_live(columns, logger, tuple(counts)),
        air={quantity: columns.find_sensors(air, quantity) for quantity, air in logger.air.items()},
        position=found, count_rate=next(filter(None, map(units.rate_of, rates)), ""),
        remarks=tuple(columns.remarks),
    )  # fmt: skip


def _or(names: Sequence[str]) -> str:
    return " or ".join(repr(name) for name in names)


def _find_live(columns: _Columns, logger: LoggerFormat, tubes: Sequence[int]) -> tuple[Source | None, ...]:
    live = logger.live_time
    convert = units.to_seconds(live.unit)
    per_record = columns.find([name for name in live.columns if TUBE not in name], convert)
    per_tube = columns.find_tubes([name for name in live.columns if TUBE in name])
    if len(per_tube) == 1:  # one clock for all tubes
        per_record = per_record or replace(*per_tube.values(), convert=convert)
    found: list[Source | None] = []
    for tube in tubes:
        shared = [number for number in per_tube if number <= tube < number + live.covers]
        source = per_tube[max(shared)] if shared else None
        found.append(Source(source.index, source.name, convert) if source else per_record)
    return tuple(found)


# The header lines of one log: names and units of the columns, and values such as the serial number --------------


@dataclass(frozen=True)
class LogHeader:
    """Parts of a header that the lines of a log need: names, units, serial number and record period as written.

    :param stored_s: when an earlier header was stored [s since 1970 UTC], NaN if unknown
    """

    names: tuple[str, ...]
    units: tuple[str, ...] = ()
    values: dict[str, str] = field(default_factory=dict)
    stored_s: float = field(default=NAN, compare=False)


class HeaderReader:
    """Reads the header lines of one log; a header may be repeated at any time."""

    def __init__(self, logger: LoggerFormat) -> None:
        self._format, self._settings = logger, logger.header
        self.names: list[str] = list(logger.header.columns)
        """Names of the columns."""
        self.units: list[str] = []
        """Units of the columns, empty without a line of units."""
        self.metadata: dict[str, str] = {}
        """Values by their key as written."""
        self.is_new = bool(self.names)
        """True if names or units have changed; reset by the reader of the records."""
        self._values: dict[str, str] = {}
        self._continued: set[str] = set()
        self._lines_left = 0
        self._after_names = False

    def value_of(self, key: str) -> str:
        """Value of a key, empty if it has none."""
        return self._values.get(plain_name(key), "") if key else ""

    @property
    def content(self) -> LogHeader:
        """The header so far."""
        keys = (self._format.serial_key, self._format.record_period.header_key)
        values = {key: value for key in keys if (value := self.value_of(key))}
        return LogHeader(tuple(self.names), tuple(self.units), values)

    def take_values(self, header: LogHeader) -> None:
        """Use the values of an earlier header until others come."""
        for key, value in header.values.items():
            self._set(key, value)

    def fields_of(self, text: str) -> list[str] | None:
        """Fields of a line; ``None`` if it is part of the header, and was read."""
        comment, bare = self._settings.comment, text.lstrip()
        if comment and bare.startswith(comment):
            self._take_comment(bare[len(comment) :])
            return None
        fields = split_fields(text, self._format.delimiter)
        return None if self._takes(fields) else fields

    def _takes(self, fields: list[str]) -> bool:
        """Read a line without a comment mark, and return whether it is part of the header."""
        starts_with_digit = fields[0][:1].isdigit()
        if self._lines_left and not starts_with_digit:
            first = self._lines_left == self._settings.lines_after_names
            self._lines_left -= 1
            if first and self._settings.units_line and fields != self.units:
                self.units, self.is_new = fields, True
            return True
        self._lines_left = 0
        if self._after_names and not any(any(map(str.isdigit, field)) for field in fields):
            # Units or kinds of values, of a table whose format does not announce them.
            if not self.units and any(map(canonical, fields)):
                self.units, self.is_new = fields, True
            return True
        self._after_names = False
        environment = self._settings.environment
        if environment and fields[0] == environment[0]:
            for key, value in zip(environment[1:], fields[1:], strict=False):
                self._set(key, value)
            return True
        if starts_with_digit or not is_header(self._format, fields):
            return False
        self._take_names(list(fields))
        return True

    def _take_comment(self, text: str) -> None:
        """Read a line with a comment mark, given without the mark."""
        names = split_fields(text, self._format.delimiter)
        while names and not names[-1]:
            names.pop()
        if not names:
            return
        first = plain_name(names[0])
        if is_header(self._format, names):
            self._take_names(names)
        elif self.names and first in map(plain_name, self._settings.continued_by):
            if first not in self._continued and first not in map(plain_name, self.names):
                self.names = self.names + names
                self.is_new = True
            self._continued.add(first)
        elif match := _KEY_AND_VALUE.fullmatch(text):
            self._set(match[1], match[2])

    def _set(self, key: str, value: str) -> None:
        if len(self.metadata) < MAX_METADATA:
            self.metadata[key] = value
            self._values[plain_name(key)] = value

    def _take_names(self, names: list[str]) -> None:
        while names and not names[-1]:
            names.pop()
        self._lines_left, self._after_names = self._settings.lines_after_names, True
        known = self.names[: len(names)] if self._settings.continued_by else self.names
        if names != known:
            self.names, self.units, self.is_new = names, [], True
            self._continued.clear()
