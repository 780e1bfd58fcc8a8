# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""The header lines of one log: names and units of the columns, and values such as the serial number."""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass, field

from soilmoist_ros.sensing.formats.log_layout import is_header, plain_name, split_fields
from soilmoist_ros.sensing.formats.logger_format import LoggerFormat
from soilmoist_ros.sensing.formats.units import canonical
from soilmoist_ros.sensing.records import NAN

MAX_METADATA = 500
_KEY_AND_VALUE = re.compile(r"\s*([^=:]{1,80}?)\s*[=:]\s*(\S.*?)\s*")


@dataclass(frozen=True)
class Header:
    """What a log's lines need of its header.

    :param names: names of the columns
    :param units: units of the columns, empty without a line of units
    :param values: serial number and record period as written, by their keys
    :param stored_s: when an earlier header was stored [s since 1970 UTC], NaN if unknown
    """

    names: tuple[str, ...]
    units: tuple[str, ...] = ()
    values: dict[str, str] = field(default_factory=dict)
    stored_s: float = field(default=NAN, compare=False)


class HeaderReader:
    """Reads the header lines of one log; a header may be repeated at any time.

    :param logger: format of the log
    """

    def __init__(self, logger: LoggerFormat) -> None:
        self._format, self._settings = logger, logger.header
        self.names: list[str] = list(logger.header.columns)
        """Names of the columns."""
        self.units: list[str] = []
        """Units of the columns, empty without a line of units."""
        self.metadata: dict[str, str] = {}
        """Values by their key as written."""
        self.is_new = bool(self.names)
        """Whether names or units have changed; reset by the reader of the records."""
        self._values: dict[str, str] = {}
        self._continued: set[str] = set()
        self._lines_left = 0
        self._after_names = False

    def value_of(self, key: str) -> str:
        """Value of a key, empty if it has none."""
        return self._values.get(plain_name(key), "") if key else ""

    @property
    def content(self) -> Header:
        """The header so far."""
        keys = (self._format.serial_key, self._format.record_period.header_key)
        values = {key: value for key in keys if (value := self.value_of(key))}
        return Header(tuple(self.names), tuple(self.units), values)

    def take_values(self, header: Header) -> None:
        """Use the values of an earlier header until others come."""
        for key, value in header.values.items():
            self._set(key, value)

    def takes(self, fields: Sequence[str]) -> bool:
        """Read a line without a comment mark, and return whether it is part of the header."""
        starts_with_digit = fields[0][:1].isdigit()
        if self._lines_left and not starts_with_digit:
            first = self._lines_left == self._settings.lines_after_names
            self._lines_left -= 1
            if first and self._settings.units_line and list(fields) != self.units:
                self.units, self.is_new = list(fields), True
            return True
        self._lines_left = 0
        if self._after_names and not any(any(map(str.isdigit, field)) for field in fields):
            # Units or kinds of values, of a table whose format does not announce them.
            if not self.units and any(map(canonical, fields)):
                self.units, self.is_new = list(fields), True
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

    def take_comment(self, text: str) -> None:
        """Read a line with a comment mark, given without the mark."""
        names = split_fields(self._format, text)
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
