# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Parses NMEA 0183 (GGA, RMC and GST) of a GNSS receiver into one fix per epoch.

:data:`SENTENCES` has the fields and converters of each sentence type. Sentences with one time of day form an
epoch. No line makes the parser raise; faults are reported and counted.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from datetime import UTC, datetime
from pathlib import Path

import pynmea2

from soilmoist_ros.foundation import DAY_S
from soilmoist_ros.foundation.errors import InputError, Mistake
from soilmoist_ros.sensing.formats.log_file import read_lines
from soilmoist_ros.sensing.formats.log_values import read_number
from soilmoist_ros.sensing.gnss import (
    DEFAULT_UERE_M,
    STATUS_OF_QUALITY,
    UNKNOWN_COVARIANCE,
    Covariance,
    CovarianceKind,
    Fix,
    FixStatus,
    covariance_of_ellipse,
    diagonal_covariance,
    horizontal_sd,
)
from soilmoist_ros.sensing.problems import Kind, Problem
from soilmoist_ros.sensing.records import NAN, Position

MAX_SENTENCE = 512  # the standard allows 82 characters; receivers send more
KNOTS_MPS = 1852.0 / 3600.0
VERTICAL_PER_HORIZONTAL = 2.0  # without GST: usual error of the altitude per error of each coordinate
EARLIEST_DATE_S = 946_684_800.0  # 2000-01-01: receivers without a date start in 1980
QUALITY_OF_MODE = {"A": 1, "D": 2, "P": 3, "R": 4, "F": 5, "E": 6, "M": 7, "S": 8, "N": 0}

Values = dict[str, float | None]


class _BadFieldError(ValueError):
    """A field with an impossible value."""


def _number(text: str) -> float | None:
    if not text.strip():
        return None
    value = read_number(text)
    if value is None:
        raise _BadFieldError(f"{text[:30]!r} is not a number")
    return value


def _time_of_day(text: str) -> float | None:
    """Seconds since midnight of ``hhmmss.ss``."""
    value = _number(text)
    if value is None:
        return None
    clock = text.strip().partition(".")[0]
    if len(clock) != 6 or not clock.isdigit():
        raise _BadFieldError(f"{text[:30]!r} is not a time of day")
    hours, minutes, seconds = int(clock[:2]), int(clock[2:4]), value % 100
    if hours > 23 or minutes > 59 or seconds >= 61:
        raise _BadFieldError(f"{text[:30]!r} is not a time of day")
    return hours * 3600.0 + minutes * 60.0 + seconds


def _date(text: str) -> float | None:
    """Midnight of ``ddmmyy`` [s since 1970 UTC]."""
    if not text.strip():
        return None
    try:
        stamp_s = datetime.strptime(text.strip()[:10], "%d%m%y").replace(tzinfo=UTC).timestamp()
    except ValueError:
        raise _BadFieldError(f"{text[:30]!r} is not a date") from None
    return stamp_s if stamp_s >= EARLIEST_DATE_S else None


def _degrees(text: str) -> float | None:
    """Decimal degrees of ``dddmm.mmmm``."""
    value = _number(text)
    if value is None:
        return None
    degrees, minutes = divmod(value, 100.0)
    if minutes >= 60.0 or value < 0:
        raise _BadFieldError(f"{text[:30]!r} is not degrees and minutes")
    return degrees + minutes / 60.0


def _hemisphere(text: str) -> float | None:
    signs = {"N": 1.0, "E": 1.0, "S": -1.0, "W": -1.0, "": None}
    try:
        return signs[text.strip().upper()]
    except KeyError:
        raise _BadFieldError(f"{text[:30]!r} is none of N, S, E, W") from None


def _status(text: str) -> float | None:
    return 1.0 if text.strip().upper() == "A" else 0.0


def _mode(text: str) -> float | None:
    quality = QUALITY_OF_MODE.get(text.strip().upper())
    return None if quality is None else float(quality)


def _speed(text: str) -> float | None:
    knots = _number(text)
    return None if knots is None else knots * KNOTS_MPS


_PLACE = {
    "latitude": ("lat", _degrees),
    "north": ("lat_dir", _hemisphere),
    "longitude": ("lon", _degrees),
    "east": ("lon_dir", _hemisphere),
}
# Sentence -> quantity -> its field (as pynmea2 names it) and converter.
SENTENCES: Mapping[str, Mapping[str, tuple[str, Callable[[str], float | None]]]] = {
    "GGA": {
        "time": ("timestamp", _time_of_day),
        **_PLACE,
        "quality": ("gps_qual", _number),
        "satellites": ("num_sats", _number),
        "hdop": ("horizontal_dil", _number),
        "altitude": ("altitude", _number),
        "geoid": ("geo_sep", _number),
    },
    "RMC": {
        "time": ("timestamp", _time_of_day),
        "date": ("datestamp", _date),
        **_PLACE,
        "valid": ("status", _status),
        "mode": ("mode_indicator", _mode),
        "speed": ("spd_over_grnd", _speed),
        "course": ("true_course", _number),
    },
    "GST": {
        "time": ("timestamp", _time_of_day),
        "major_sd": ("std_dev_major", _number),
        "minor_sd": ("std_dev_minor", _number),
        "orientation": ("orientation", _number),
        "north_sd": ("std_dev_latitude", _number),
        "east_sd": ("std_dev_longitude", _number),
        "up_sd": ("std_dev_altitude", _number),
    },
}


@dataclass
class _Epoch:
    """Sentences of one time of day."""

    time_of_day_s: float
    sentences: dict[str, Values] = field(default_factory=dict)
    sent: bool = False

    def value(self, sentence: str, name: str) -> float | None:
        return self.sentences.get(sentence, {}).get(name)


class NmeaParser:
    """Parses sentences into fixes, one line at a time.

    A fix is complete when the epoch has all sentence types of the previous epoch, at the latest when the next
    epoch begins. :meth:`flush` returns the last fix. GGA has no date: the date of the last RMC is used, and
    advances at midnight. Before the first one the time of day is that next to the present time, if known.

    :param uere_m: user-equivalent range error by GGA quality [m], for receivers that send no GST
    :param reference_stamp_s: a time within 12 h of the first epoch [s since 1970 UTC], if known; until a date is
        known, the stamps of fixes are NaN
    :param require_checksum: whether sentences without a checksum are dropped
    :param on_problem: called with each problem; by default problems are collected in :attr:`problems`
    :param path: source of the lines, for messages
    """

    def __init__(
        self,
        uere_m: Mapping[int, float] = DEFAULT_UERE_M,
        reference_stamp_s: float = NAN,
        require_checksum: bool = True,
        on_problem: Callable[[Problem], None] | None = None,
        path: Path | None = None,
    ) -> None:
        self.problems: list[Problem] = []
        self.sentences_read = 0
        self.line_number = 0
        self._uere_m = dict(uere_m)
        self._last_stamp_s = reference_stamp_s
        self._has_date, self._now_s = False, NAN
        self._require_checksum = require_checksum
        self._on_problem = on_problem or self.problems.append
        self._path = path
        self._epoch: _Epoch | None = None
        self._expected: set[str] = set()

    def feed(self, line: bytes, now_s: float = NAN) -> Fix | None:
        """Parse one line; returns the fix that it completes, if any.

        :param now_s: present time, NaN if unknown [s since 1970 UTC]
        """
        self._now_s = now_s
        self.line_number += 1
        found = self._read(line)
        if found is None:
            return None
        kind, values = found
        time_of_day_s = values["time"]
        if time_of_day_s is None:
            return None  # the receiver is starting
        finished = None
        if self._epoch is None or self._epoch.time_of_day_s != time_of_day_s:
            finished = self.flush()
            self._epoch = _Epoch(time_of_day_s)
        self._epoch.sentences.setdefault(kind, values)
        if (
            finished is None
            and not self._epoch.sent
            and self._expected
            and self._expected <= set(self._epoch.sentences)
        ):
            self._epoch.sent = True
            return self._fix(self._epoch)
        return finished

    def flush(self) -> Fix | None:
        """The fix of the current epoch, if it was not returned yet."""
        epoch, self._epoch = self._epoch, None
        if epoch is None:
            return None
        self._expected = set(epoch.sentences)
        return None if epoch.sent else self._fix(epoch)

    def _read(self, line: bytes) -> tuple[str, Values] | None:
        """Type and values of a sentence, ``None`` if its type is not used or it is damaged."""
        start = line.rfind(b"$")
        if start < 0:
            if line.strip():
                self._report(Kind.UNREADABLE, "no NMEA sentence")
            return None
        text = line[start:].decode("latin-1").strip()
        kind = text[3:6]
        if len(text) > MAX_SENTENCE:
            self._report(Kind.TOO_LONG, f"the sentence has {len(text)} bytes")
            return None
        try:
            message = pynmea2.parse(text, check=self._require_checksum)
        except pynmea2.ChecksumError:
            self._report(Kind.CHECKSUM, "the checksum is absent or wrong")
            return None
        except pynmea2.SentenceTypeError:
            return None  # an intact sentence of an unused type
        except (pynmea2.ParseError, ValueError):
            self._report(Kind.UNREADABLE, "the sentence is damaged")
            return None
        self.sentences_read += 1
        if kind not in SENTENCES or not isinstance(message, pynmea2.TalkerSentence):
            return None
        try:
            return kind, _values(message, SENTENCES[kind])
        except _BadFieldError as error:
            self._report(Kind.NOT_A_NUMBER, str(error), kind)
            return None

    def _report(self, kind: Kind, message: str, column: str = "") -> None:
        mistake = Mistake(message, "", self._path, self.line_number, column)
        self._on_problem(Problem(kind, mistake, lost=True))

    def _fix(self, epoch: _Epoch) -> Fix:
        stamp_s = self._stamp(epoch)
        quality = _quality(epoch)
        place = _place(epoch)
        status = STATUS_OF_QUALITY.get(quality, FixStatus.NO_FIX)
        if place is None or status is FixStatus.NO_FIX:
            return Fix(stamp_s, Position(NAN, NAN), FixStatus.NO_FIX)
        hdop = _or_nan(epoch.value("GGA", "hdop"))
        satellites = epoch.value("GGA", "satellites")
        covariance, known = self._covariance(epoch, quality, hdop)
        sd = math.sqrt((covariance[0][0] + covariance[1][1]) / 2)
        return Fix(
            stamp_s=stamp_s,
            position=Position(*place, _or_nan(epoch.value("GGA", "altitude")), sd),
            status=status,
            quality=quality,
            satellites=-1 if satellites is None else int(satellites),
            hdop=hdop,
            speed_mps=_or_nan(epoch.value("RMC", "speed")),
            course_deg=_or_nan(epoch.value("RMC", "course")),
            geoid_separation_m=_or_nan(epoch.value("GGA", "geoid")),
            covariance_m2=covariance,
            covariance_kind=known,
        )

    def _stamp(self, epoch: _Epoch) -> float:
        """Time of the epoch: with the date of its RMC, else within 12 h of the previous epoch, or of now."""
        midnight_s = epoch.value("RMC", "date")
        if midnight_s is None and not self._has_date and math.isfinite(self._now_s):
            self._last_stamp_s = self._now_s  # each time anew: the clock may have been wrong before
        if midnight_s is not None:
            self._has_date, self._last_stamp_s = True, midnight_s + epoch.time_of_day_s
        elif not math.isnan(self._last_stamp_s):
            ahead_s = (epoch.time_of_day_s - self._last_stamp_s + DAY_S / 2) % DAY_S - DAY_S / 2
            self._last_stamp_s += ahead_s
        else:
            self._report(Kind.NO_DATE, "no date yet")
            return NAN
        return self._last_stamp_s

    def _covariance(self, epoch: _Epoch, quality: int, hdop: float) -> tuple[Covariance, CovarianceKind]:
        ellipse = [epoch.value("GST", name) for name in ("major_sd", "minor_sd", "orientation")]
        axes = [epoch.value("GST", name) for name in ("east_sd", "north_sd")]
        up_sd = _or_nan(epoch.value("GST", "up_sd"))
        if _all_known(ellipse, 2):
            major, minor, orientation = (_or_nan(value) for value in ellipse)
            return covariance_of_ellipse(major, minor, orientation, up_sd), CovarianceKind.KNOWN
        if _all_known(axes, 2):
            east, north = (_or_nan(value) for value in axes)
            return diagonal_covariance(east, north, up_sd), CovarianceKind.DIAGONAL_KNOWN
        sd = horizontal_sd(quality, hdop, self._uere_m)
        if math.isnan(sd):
            return UNKNOWN_COVARIANCE, CovarianceKind.UNKNOWN
        return diagonal_covariance(sd, sd, VERTICAL_PER_HORIZONTAL * sd), CovarianceKind.APPROXIMATED


def _values(
    message: pynmea2.TalkerSentence, fields: Mapping[str, tuple[str, Callable[[str], float | None]]]
) -> Values:
    values: Values = {}
    for name, (attribute, convert) in fields.items():
        index = message.name_to_idx[attribute]
        values[name] = convert(message.data[index]) if index < len(message.data) else None
    return values


def _or_nan(value: float | None) -> float:
    return NAN if value is None else value


def _all_known(values: list[float | None], deviations: int) -> bool:
    """Whether all values are known, and the first ``deviations`` values are possible standard deviations."""
    known = [value for value in values if value is not None]
    return len(known) == len(values) and all(0 < value < 1e5 for value in known[:deviations])


def _quality(epoch: _Epoch) -> int:
    """Quality from GGA, else from the mode of RMC. A void RMC always means no fix."""
    if epoch.value("RMC", "valid") == 0.0:
        return 0
    quality = epoch.value("GGA", "quality")
    if "GGA" not in epoch.sentences:
        mode = epoch.value("RMC", "mode")
        quality = (1.0 if mode is None else mode) if "RMC" in epoch.sentences else 0.0
    return int(quality) if quality is not None and 0 <= quality <= 8 else 0


def _place(epoch: _Epoch) -> tuple[float, float] | None:
    """Latitude and longitude [deg] from GGA, else from RMC."""
    for sentence in ("GGA", "RMC"):
        values = [epoch.value(sentence, name) for name in ("latitude", "north", "longitude", "east")]
        latitude, north, longitude, east = (_or_nan(value) for value in values)
        if abs(latitude) <= 90 and abs(longitude) <= 180 and not math.isnan(north + east):
            return latitude * north, longitude * east
    return None


def read_nmea(path: Path | str) -> tuple[list[Fix], list[Problem]]:
    """Read the fixes and problems of a file of NMEA sentences, in the order of the file.

    Epochs before the first date are dated from the first date.

    :param path: the file; other lines between the sentences are reported and skipped
    :raises InputError: if the file cannot be read, or has no NMEA sentence
    """
    path = Path(path)
    lines, _ = read_lines(path)
    return parse_nmea(lines, path)


def parse_nmea(lines: Sequence[bytes], path: Path) -> tuple[list[Fix], list[Problem]]:
    """Parse the lines of a receiver; see :func:`read_nmea`.

    :param path: source of the lines, for messages
    """
    parser = NmeaParser(reference_stamp_s=_first_stamp(lines), path=path)
    fixes = [parser.feed(line) for line in lines]
    fixes.append(parser.flush())
    if parser.sentences_read == 0:
        raise InputError(
            "has no NMEA sentence with a correct checksum",
            "give the text that the GNSS receiver sent, with lines such as $GPGGA,...*hh",
            path,
        )
    return [fix for fix in fixes if fix is not None], parser.problems


def _first_stamp(lines: Sequence[bytes]) -> float:
    """Time of the first epoch with a date, NaN if there is none."""
    parser = NmeaParser(on_problem=lambda problem: None)
    for line in lines:
        fix = parser.feed(line) if b"RMC" in line else None
        if fix is not None and not math.isnan(fix.stamp_s):
            return fix.stamp_s
    last = parser.flush()
    return NAN if last is None else last.stamp_s
