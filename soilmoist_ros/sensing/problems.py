"""What can be wrong inside a log that is readable as a whole: recorded, never raised."""

from __future__ import annotations

import enum
from dataclasses import dataclass

from soilmoist_ros.foundation.errors import Mistake


class Severity(enum.IntEnum):
    """How much a problem matters."""

    NOTE = 0
    """As to be expected in the field, dealt with."""
    WARNING = 1
    """The record is kept, but look at the instrument."""
    ERROR = 2
    """Data were lost."""


class Kind(enum.Enum):
    """Kinds of problems, with the severity they have when the record is kept."""

    NO_HEADER = "no header", Severity.WARNING
    BAD_HEADER = "header without the columns needed", Severity.ERROR
    TOO_LONG = "line too long", Severity.WARNING
    UNREADABLE = "not text", Severity.WARNING
    CHECKSUM = "wrong checksum", Severity.WARNING
    TRUNCATED = "truncated line", Severity.WARNING
    WRONG_FIELDS = "wrong number of fields", Severity.WARNING
    BAD_TIME = "no valid time", Severity.WARNING
    NOT_A_NUMBER = "not a number", Severity.WARNING
    NEGATIVE_COUNT = "negative count", Severity.WARNING
    NOT_WHOLE = "count that is not whole", Severity.WARNING
    ROUNDED_COUNT = "count rounded", Severity.NOTE
    OUT_OF_RANGE = "value out of range", Severity.WARNING
    SENTINEL = "value marked as missing", Severity.NOTE
    MISSING_COLUMN = "no column of a quantity", Severity.WARNING
    MISSING_VALUE = "no value", Severity.NOTE
    MISSING_TUBE = "tube without counts", Severity.WARNING
    NO_COUNTS = "no tube with counts", Severity.WARNING
    SHORT_LIVE_TIME = "short live time", Severity.NOTE
    ASSUMED_LIVE_TIME = "live time assumed", Severity.WARNING
    NO_LIVE_TIME = "no live time", Severity.WARNING
    DUPLICATE = "duplicate record", Severity.NOTE
    SAME_TIME = "other record of the same time", Severity.WARNING
    CLOCK_BACKWARDS = "clock went backwards", Severity.WARNING
    GAP = "records missing", Severity.NOTE
    NO_FIX = "no position fix", Severity.NOTE
    CLOCK_OFFSET = "logger clock differs from GNSS time", Severity.WARNING
    NO_POSITION = "no position", Severity.WARNING
    NO_CORRECTION = "cannot be corrected", Severity.WARNING
    NO_DATE = "no date yet", Severity.NOTE

    severity: Severity

    def __new__(cls, text: str, severity: Severity) -> Kind:
        """The value of a member is its text."""
        kind = object.__new__(cls)
        kind._value_ = text
        kind.severity = severity
        return kind


@dataclass(frozen=True)
class Problem:
    """One fault in a log or stream.

    :param kind: what kind of fault
    :param mistake: what, where (file, line, column) and what to do
    :param lost: whether the record or sentence was dropped because of it
    """

    kind: Kind
    mistake: Mistake
    lost: bool = False

    @property
    def severity(self) -> Severity:
        """How much it matters; duplicates may be dropped without loss."""
        if self.lost and self.kind is not Kind.DUPLICATE:
            return Severity.ERROR
        return self.kind.severity

    def __str__(self) -> str:
        return str(self.mistake)
