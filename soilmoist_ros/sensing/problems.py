# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Faults in a readable log; they are recorded, never raised."""

from __future__ import annotations

import enum
from dataclasses import dataclass
from pathlib import Path
from typing import Literal

from soilmoist_ros.foundation import Mistake

Consequence = Literal["lost", "quarantined", "kept"]
"""``lost``: the record was dropped; ``quarantined``: it is listed, but not used; ``kept``: it is used."""


class Severity(enum.IntEnum):
    """Severity of a problem."""

    NOTE = 0
    """Expected in the field, nothing to do."""
    WARNING = 1
    """The record is kept, but check the instrument."""
    ERROR = 2
    """Data were lost."""


class Kind(enum.StrEnum):
    """Reason codes of problems, each with a text and the severity if the record is kept."""

    NO_HEADER = "no_header", "no header", Severity.WARNING
    BAD_HEADER = "bad_header", "header without the columns needed", Severity.ERROR
    TOO_LONG = "too_long", "line too long", Severity.WARNING
    UNREADABLE = "unreadable", "not text", Severity.WARNING
    CHECKSUM = "checksum", "wrong checksum", Severity.WARNING
    TRUNCATED = "truncated", "truncated line", Severity.WARNING
    WRONG_FIELDS = "wrong_fields", "wrong number of fields", Severity.WARNING
    BAD_TIME = "bad_time", "no valid time", Severity.WARNING
    LOCAL_TIME = "local_time", "local time that occurs twice or never", Severity.NOTE
    FOREIGN_TEXT = "foreign_text", "foreign text before a record", Severity.WARNING
    NOT_A_NUMBER = "not_a_number", "not a number", Severity.WARNING
    NEGATIVE_COUNT = "negative_count", "negative count", Severity.WARNING
    NOT_WHOLE = "not_whole", "count that is not whole", Severity.WARNING
    ROUNDED_COUNT = "rounded_count", "count rounded", Severity.NOTE
    OUT_OF_RANGE = "out_of_range", "value out of range", Severity.WARNING
    SENTINEL = "sentinel", "value marked as missing", Severity.NOTE
    MISSING_COLUMN = "missing_column", "no column of a quantity", Severity.WARNING
    OTHER_UNIT = "other_unit", "unit differs from the logger format", Severity.WARNING
    MISSING_VALUE = "missing_value", "no value", Severity.NOTE
    MISSING_TUBE = "missing_tube", "tube without counts", Severity.WARNING
    NO_COUNTS = "no_counts", "no tube with counts", Severity.WARNING
    SHORT_LIVE_TIME = "short_live_time", "short live time", Severity.NOTE
    ASSUMED_LIVE_TIME = "assumed_live_time", "live time assumed", Severity.WARNING
    NO_LIVE_TIME = "no_live_time", "no live time", Severity.WARNING
    DUPLICATE = "duplicate", "duplicate record", Severity.NOTE
    SAME_TIME = "same_time", "other record of the same time", Severity.WARNING
    CLOCK_BACKWARDS = "clock_backwards", "clock went backwards", Severity.WARNING
    OVERLAP = "overlap", "more counting time than time", Severity.WARNING
    LIVE_TIME_UNIT = "live_time_unit", "live time perhaps in another unit", Severity.WARNING
    NOT_COUNTS = "not_counts", "numbers that may not be raw counts", Severity.WARNING
    OTHER_TUBE = "other_tube", "tube that may not be the moderated one", Severity.WARNING
    GAP = "gap", "records missing", Severity.NOTE
    BAD_POSITION = "bad_position", "position that cannot be read", Severity.WARNING
    NO_FIX = "no_fix", "no position fix", Severity.NOTE
    CLOCK_OFFSET = "clock_offset", "logger clock differs from GNSS time", Severity.WARNING
    NO_POSITION = "no_position", "no position", Severity.WARNING
    NO_CORRECTION = "no_correction", "cannot be corrected", Severity.WARNING
    NO_DATE = "no_date", "no date yet", Severity.NOTE
    ASSUMED_TIME = "assumed_time", "time of positions assumed", Severity.WARNING
    CHOSEN_POSITIONS = "chosen_positions", "positions chosen among several", Severity.NOTE
    DOUBTFUL_POSITIONS = "doubtful_positions", "positions of doubtful accuracy", Severity.WARNING
    NOISY_TUBE = "noisy_tube", "tube counts too much", Severity.WARNING
    DEAD_TUBE = "dead_tube", "tube counts too little", Severity.WARNING
    STUCK_TUBE = "stuck_tube", "tube repeats a number", Severity.WARNING  # of older bags
    IMPOSSIBLE_COUNT = "impossible_count", "impossible count", Severity.WARNING
    IMPOSSIBLE_WEATHER = "impossible_weather", "impossible weather", Severity.WARNING
    FROZEN_PRESSURE = "frozen_pressure", "pressure never changes", Severity.WARNING  # of older bags
    PLACE_JUMP = "place_jump", "jump of place", Severity.WARNING
    PLACE_DOUBT = "place_doubt", "place not trusted", Severity.WARNING
    CLOCK_DRIFT = "clock_drift", "logger clock drifts against GNSS time", Severity.WARNING  # of older bags
    OVERDISPERSED = "overdispersed", "counts scatter more than counting statistics", Severity.WARNING
    RATE_JUMP = "rate_jump", "count unlike the records before", Severity.WARNING
    UNEXPECTED_COUNT = "unexpected_count", "unexpected count", Severity.WARNING

    text: str
    severity: Severity

    def __new__(cls, code: str, text: str, severity: Severity) -> Kind:
        """The value of a member is its code."""
        kind = str.__new__(cls, code)
        kind._value_ = code
        kind.text = text
        kind.severity = severity
        return kind


@dataclass(frozen=True)
class Problem:
    """One fault in a log or stream.

    :param kind: reason code
    :param mistake: message, place (file, line, column) and remedy
    :param lost: whether the record or sentence was dropped
    :param quarantined: whether the record is kept, but no map or mean uses it
    """

    kind: Kind
    mistake: Mistake
    lost: bool = False
    quarantined: bool = False

    @property
    def severity(self) -> Severity:
        """Severity of the problem; a dropped duplicate is no loss."""
        if self.lost and self.kind is not Kind.DUPLICATE:
            return Severity.ERROR
        return self.kind.severity

    @property
    def consequence(self) -> Consequence:
        """Consequence of the problem for its record."""
        return "lost" if self.lost else "quarantined" if self.quarantined else "kept"

    def __str__(self) -> str:
        return str(self.mistake)


def reason_text(code: str) -> str:
    """Text of a reason code, such as that of a quarantined record; the code itself if it is unknown.

    >>> reason_text("noisy_tube")
    'tube counts too much'
    """
    return next((kind.text for kind in Kind if kind == code), code)


@dataclass(frozen=True)
class Finding:
    """A fault of a record.

    :param kind: reason code
    :param message: what is wrong, with values
    :param remedy: what the user can do about it
    :param bad: whether the record is bad as a whole
    :param column: name of the column, empty if it concerns the whole line
    """

    kind: Kind
    message: str
    remedy: str = ""
    bad: bool = False
    column: str = ""

    def at(self, path: Path | None = None, line: int = 0, lost: bool = False) -> Problem:
        """Problem of the record in a line, or of a whole log."""
        mistake = Mistake(self.message, self.remedy, path, line, self.column)
        return Problem(self.kind, mistake, lost, quarantined=self.bad and not lost)


class LostRecordError(Exception):
    """A line is damaged, or its record cannot be corrected or placed."""

    def __init__(self, kind: Kind, message: str, column: str = "", remedy: str = "") -> None:
        self.finding = Finding(kind, message, remedy, column=column)
        super().__init__(message)
