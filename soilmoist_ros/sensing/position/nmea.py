# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Parses NMEA 0183 (GGA, GNS, RMC, GLL, GST and ZDA) of a GNSS receiver into one fix per epoch.

:data:`SENTENCES` has the fields of each sentence type. Sentences with one time of day form an
epoch. No line makes the parser raise; faults are reported and counted.
"""

from __future__ import annotations

import contextlib
import math
import re
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from datetime import UTC, datetime, timedelta
from pathlib import Path

import pynmea2

from soilmoist_ros.foundation import DAY_S, InputError, Mistake
from soilmoist_ros.sensing.formats.log_values import read_number, read_time, strip_checksum
from soilmoist_ros.sensing.gnss import (
    EARLIEST_DATE_S,
    STATUS_OF_QUALITY,
    UNKNOWN_COVARIANCE,
    Covariance,
    CovarianceKind,
    Fix,
    FixStatus,
    NoPlace,
    covariance_of_ellipse,
    horizontal_sd,
    is_place,
)
from soilmoist_ros.sensing.problems import Kind, Problem
from soilmoist_ros.sensing.records import NAN, Position, utc_text

MAX_SENTENCE = 512  # the standard allows 82 characters; receivers send more
MAX_SD_M = 1e5  # standard deviation from which on it is impossible [m]
KNOTS_MPS = 1852.0 / 3600.0
VERTICAL_PER_HORIZONTAL = 2.0  # without GST: usual error of the altitude per error of each coordinate
QUALITY_OF_MODE = {"R": 4, "F": 5, "P": 3, "D": 2, "A": 1, "E": 6, "S": 8, "M": 7, "N": 0}
"""Quality as in GGA of a mode, the best mode first: GNS has one for each constellation."""
_CHECKED = re.compile(rb"\$[^$*]*\*[0-9A-Fa-f]{2}")
_DATE_BEFORE = re.compile(rb"(\d{4}[-/]\d\d[-/]\d\d[T ]\d\d:\d\d:\d\d)[^$]*\$")

Values = dict[str, float]  # values of a sentence by their names; NaN where a field is empty


def _bad(text: str, what: str) -> ValueError:
    return ValueError(f"{text[:30]!r} is {what}")


def _number(text: str) -> float:
    if (value := read_number(text)) is None:
        raise _bad(text, "not a number")
    return value


def _time_of_day(text: str) -> float:
    """Seconds since midnight of ``hhmmss.ss``."""
    value, clock = _number(text), text.partition(".")[0]
    seconds = value % 100
    if len(clock) != 6 or not clock.isdigit() or clock[:2] > "23" or clock[2:4] > "59" or seconds >= 61:
        raise _bad(text, "not a time of day")
    return int(clock[:2]) * 3600.0 + int(clock[2:4]) * 60.0 + seconds


def _date(text: str) -> float:
    """Midnight of ``ddmmyy`` [s since 1970 UTC]; NaN of a receiver without a date."""
    try:
        stamp_s = datetime.strptime(text[:10], "%d%m%y").replace(tzinfo=UTC).timestamp()
    except ValueError:
        raise _bad(text, "not a date") from None
    return stamp_s if stamp_s >= EARLIEST_DATE_S else NAN


def _degrees(text: str) -> float:
    """Decimal degrees of ``dddmm.mmmm``."""
    degrees, minutes = divmod(_number(text), 100.0)
    if minutes >= 60.0 or degrees < 0:
        raise _bad(text, "not degrees and minutes")
    return degrees + minutes / 60.0


def _hemisphere(text: str) -> float:
    if text.upper() not in ("N", "E", "S", "W"):
        raise _bad(text, "none of N, S, E, W")
    return 1.0 if text.upper() in "NE" else -1.0


def _mode(text: str) -> float:
    return next((float(quality) for mode, quality in QUALITY_OF_MODE.items() if mode in text.upper()), NAN)


_CONVERTERS: Mapping[str, Callable[[str], float]] = {
    "time": _time_of_day, "date": _date, "latitude": _degrees, "north": _hemisphere, "longitude": _degrees,
    "east": _hemisphere, "valid": lambda text: float(text.upper() == "A"), "mode": _mode,
    "speed": lambda text: _number(text) * KNOTS_MPS,
}  # fmt: skip
"""Converters of quantities that are no plain numbers."""
_PLACE = {"time": "timestamp", "latitude": "lat", "north": "lat_dir", "longitude": "lon", "east": "lon_dir"}
SENTENCES: Mapping[str, Mapping[str, str]] = {
    "GGA": _PLACE | {"quality": "gps_qual", "satellites": "num_sats", "hdop": "horizontal_dil",
                     "altitude": "altitude", "geoid": "geo_sep"},
    "GNS": _PLACE | {"mode": "mode_indicator", "satellites": "num_sats", "hdop": "hdop",
                     "altitude": "altitude", "geoid": "geo_sep"},
    "RMC": _PLACE | {"date": "datestamp", "valid": "status", "mode": "mode_indicator", "speed": "spd_over_grnd"},
    "GLL": _PLACE | {"valid": "status", "mode": "faa_mode"},
    "ZDA": {"time": "timestamp", "day": "day", "month": "month", "year": "year"},
    "GST": {"time": "timestamp", "major_sd": "std_dev_major", "minor_sd": "std_dev_minor",
            "orientation": "orientation", "north_sd": "std_dev_latitude", "east_sd": "std_dev_longitude",
            "up_sd": "std_dev_altitude"},
}  # fmt: skip
"""Quantities of each sentence, and their fields as pynmea2 names them."""

_PLACES = ("GGA", "GNS", "RMC", "GLL")  # sentences with a position, the best first


@dataclass
class _Epoch:
    """Sentences of one time of day."""

    time_of_day_s: float
    sentences: dict[str, Values] = field(default_factory=dict)
    sent: bool = False

    def value(self, sentence: str, name: str) -> float:
        return self.sentences.get(sentence, {}).get(name, NAN)

    def best(self, name: str) -> float:
        """Value of the best sentence with a position that has it."""
        return next((v for kind in _PLACES if not math.isnan(v := self.value(kind, name))), NAN)

    @property
    def midnight_s(self) -> float:
        """Begin of its day [s since 1970 UTC], NaN if no sentence has a date."""
        with contextlib.suppress(ValueError, OverflowError):  # of NaN and inf, too
            year, month, day = (int(self.value("ZDA", name)) for name in ("year", "month", "day"))
            stamp_s = datetime(year, month, day, tzinfo=UTC).timestamp()
            if stamp_s >= EARLIEST_DATE_S:
                return stamp_s
        return self.value("RMC", "date")


class NmeaParser:
    """Parses sentences into fixes, one line at a time.

    A fix is complete when the epoch has all sentence types of the previous epoch, at the latest when the next
    epoch begins. GGA has no date: the date of the last RMC is used, and advances at midnight. Before the first one
    the time of day is that next to the present time, if known.

    :param reference_stamp_s: a time within 12 h of the first epoch [s since 1970 UTC], if known; until a date is
        known, the stamps of fixes are NaN
    :param require_checksum: whether sentences without a checksum are dropped
    :param on_problem: called with each problem; by default problems are collected in :attr:`problems`
    :param path: source of the lines, for messages
    """

    def __init__(
        self,
        reference_stamp_s: float = NAN,
        require_checksum: bool = True,
        on_problem: Callable[[Problem], None] | None = None,
        path: Path | None = None,
    ) -> None:
        self.problems: list[Problem] = []
        self.sentences_read = 0
        self.line_number = 0
        self._last_stamp_s = reference_stamp_s
        self._has_date, self._now_s = False, NAN
        self.first_dated_s = NAN
        """Time of the first epoch with a date of its own [s since 1970 UTC], NaN before it."""
        self._require_checksum = require_checksum
        self._on_problem = on_problem or self.problems.append
        self._path = path
        self._epoch: _Epoch | None = None
        self._expected: set[str] = set()

    def feed(self, line: bytes, now_s: float = NAN) -> Fix | None:
        """Parse one line; returns the fix that it completes, if any. The present time may be unknown [s since 1970
        UTC].
        """
        self._now_s = now_s
        self.line_number += 1
        found = self._read(line)
        if found is None:
            return None
        kind, values = found
        time_of_day_s = values["time"]
        if math.isnan(time_of_day_s):
            return None  # the receiver is starting
        finished = None
        if self._epoch is None or self._epoch.time_of_day_s != time_of_day_s:
            finished = self.flush()
            self._epoch = _Epoch(time_of_day_s)
        self._epoch.sentences.setdefault(kind, values)
        complete = self._expected and self._expected <= set(self._epoch.sentences)
        if finished is None and not self._epoch.sent and complete:
            self._epoch.sent = True
            return self._fix(self._epoch)
        return finished

    def flush(self) -> Fix | None:
        """The fix of the current epoch, if it was not returned yet."""
        epoch, self._epoch = self._epoch, None
        if epoch is None:
            return None
        if epoch.sentences.keys().isdisjoint(_PLACES):
            self._stamp(epoch)
            return None
        self._expected = set(epoch.sentences)
        return None if epoch.sent else self._fix(epoch)

    def _read(self, line: bytes) -> tuple[str, Values] | None:
        """Type and values of a sentence, ``None`` if its type is not used or it is damaged."""
        start = line.rfind(b"$")
        if start < 0:
            if line.strip() and not _is_other_message(line):
                self._report(Kind.UNREADABLE, "no NMEA sentence")
            return None
        whole = _CHECKED.match(line, start)
        found = line[start:] if whole is None else whole[0][:-2] + whole[0][-2:].upper()
        text = found.decode("latin-1").strip().rstrip("'\"\\")
        kind = text[3:6]
        if len(text) > MAX_SENTENCE and not _is_other_message(found):
            self._report(Kind.TOO_LONG, f"the sentence has {len(text)} bytes")
            return None
        try:
            message = pynmea2.parse(text, check=self._require_checksum)
        except pynmea2.ChecksumError:
            self._report(Kind.CHECKSUM, "the checksum is absent or wrong")
            return None
        except pynmea2.SentenceTypeError:
            self.sentences_read += 1
            return None  # an intact sentence of an unused type
        except (pynmea2.ParseError, ValueError, IndexError):
            if not (_is_other_message(found) or _is_other_message(line)):
                self._report(Kind.UNREADABLE, "the sentence is damaged")
            return None
        self.sentences_read += 1
        if kind not in SENTENCES or "timestamp" not in message.name_to_idx:
            return None
        try:
            return kind, _values(message, SENTENCES[kind])
        except ValueError as error:
            self._report(Kind.NOT_A_NUMBER, str(error), kind)
            return None

    def _report(self, kind: Kind, message: str, column: str = "") -> None:
        mistake = Mistake(message, "", self._path, self.line_number, column)
        self._on_problem(Problem(kind, mistake, lost=True))

    def _fix(self, epoch: _Epoch) -> Fix:
        stamp_s = self._stamp(epoch)
        quality, said = _quality(epoch)
        place = _place(epoch)
        status = STATUS_OF_QUALITY.get(quality, FixStatus.NO_FIX)
        if status is FixStatus.NO_FIX:
            why = {0: NoPlace.NO_FIX, 7: NoPlace.TYPED_IN}.get(quality, NoPlace.QUALITY_UNKNOWN)
            return Fix.without_place(stamp_s, why, said, quality)
        if place is None:
            return Fix.without_place(stamp_s, NoPlace.NO_COORDINATES, said, quality)
        hdop, satellites = epoch.best("hdop"), epoch.best("satellites")
        covariance, known = _covariance(epoch, quality, hdop)
        sd = math.sqrt((covariance[0][0] + covariance[1][1]) / 2)
        return Fix(
            stamp_s=stamp_s, position=Position(*place, epoch.best("altitude"), sd), status=status,
            quality=quality, satellites=-1 if math.isnan(satellites) else int(satellites), hdop=hdop,
            speed_mps=epoch.value("RMC", "speed"), geoid_separation_m=epoch.best("geoid"),
            covariance_m2=covariance, covariance_kind=known,
        )  # fmt: skip

    def _stamp(self, epoch: _Epoch) -> float:
        """Time of the epoch: with the date of its sentences, else within 12 h of the previous epoch, or of now."""
        stamp_s = epoch.midnight_s + epoch.time_of_day_s
        if math.isfinite(stamp_s):
            if not self._has_date:
                self.first_dated_s = stamp_s
            self._has_date, self._last_stamp_s = True, stamp_s
            return stamp_s
        if not self._has_date and math.isfinite(self._now_s):
            self._last_stamp_s = self._now_s  # each time anew: the clock may have been wrong before
        if math.isnan(self._last_stamp_s):
            self._report(Kind.NO_DATE, "no date yet")
        else:
            ahead_s = (epoch.time_of_day_s - self._last_stamp_s + DAY_S / 2) % DAY_S - DAY_S / 2
            self._last_stamp_s += ahead_s
        return self._last_stamp_s


def _covariance(epoch: _Epoch, quality: int, hdop: float) -> tuple[Covariance, CovarianceKind]:
    names = ("major_sd", "minor_sd", "orientation", "east_sd", "north_sd", "up_sd")
    major, minor, orientation, east, north, up_sd = (epoch.value("GST", name) for name in names)
    if 0 < major < MAX_SD_M and 0 < minor < MAX_SD_M and not math.isnan(orientation):
        return covariance_of_ellipse(major, minor, orientation, up_sd), CovarianceKind.KNOWN
    if 0 < east < MAX_SD_M and 0 < north < MAX_SD_M:
        return covariance_of_ellipse(north, east, 0.0, up_sd), CovarianceKind.DIAGONAL_KNOWN
    sd = horizontal_sd(quality, hdop)
    if math.isnan(sd):
        return UNKNOWN_COVARIANCE, CovarianceKind.UNKNOWN
    return covariance_of_ellipse(sd, sd, 0.0, VERTICAL_PER_HORIZONTAL * sd), CovarianceKind.APPROXIMATED


def _values(message: pynmea2.NMEASentence, fields: Mapping[str, str]) -> Values:
    values: Values = {}
    for name, attribute in fields.items():
        index = message.name_to_idx[attribute]
        text = message.data[index].strip() if index < len(message.data) else None
        known = text or (text is not None and name == "valid")  # an empty status says that there is no fix
        values[name] = _CONVERTERS.get(name, _number)(text or "") if known else NAN
    return values


def _quality(epoch: _Epoch) -> tuple[int, str]:
    """Quality of GGA, else of the mode of GNS, RMC or GLL, and what the receiver said. A void RMC is no fix."""
    for kind in ("RMC", "GLL"):
        if epoch.value(kind, "valid") == 0.0 and (kind == "RMC" or "GGA" not in epoch.sentences):
            return 0, f"{kind} status V"
    for kind in _PLACES:
        if kind in epoch.sentences:
            name = "quality" if kind == "GGA" else "mode"
            quality = epoch.value(kind, name)
            if math.isnan(quality):
                quality = 0.0 if kind in ("GGA", "GNS") else 1.0
            return int(quality), f"{kind} {name} {quality:.0f}"
    return 0, "no quality"


def _place(epoch: _Epoch) -> tuple[float, float] | None:
    """Latitude and longitude [deg] of the best sentence that has them."""
    for sentence in _PLACES:
        names = ("latitude", "north", "longitude", "east")
        latitude, north, longitude, east = (epoch.value(sentence, name) for name in names)
        if is_place(latitude, longitude) and not math.isnan(north + east):
            return latitude * north, longitude * east
    return None


def _is_other_message(line: bytes) -> bool:
    """True if bytes are no NMEA, but what receivers send between its sentences: binary, or ASCII of NovAtel."""
    return line[:1] in b"#%!" or 10 * sum(not (32 <= byte < 127 or byte in b"\t\r\n") for byte in line) > len(line)


def parse_nmea(
    lines: Sequence[bytes], path: Path, log_s: tuple[float, float] | None = None
) -> tuple[list[Fix], list[Problem]]:
    """Read the fixes and problems of lines with NMEA sentences, in their order.

    Epochs before the first date are dated from the first date; without any date, from a date that stands before a
    sentence, else from the times of a log. Other messages between the sentences are skipped, text is reported.

    :param log_s: first and last time of the log for which the positions are [s since 1970 UTC], if known
    :raises InputError: if there is no NMEA sentence, or the day is not clear
    """
    pieces = list(_pieces(lines))
    fixes, parser = _parsed(pieces, path, NAN)
    if parser.sentences_read == 0:
        fixes, parser = _parsed(pieces, path, NAN, require_checksum=False)
        if not fixes:
            raise InputError(*_no_sentence(lines), path)
        unchecked = Mistake("no sentence has a checksum: damaged ones are not noticed", "", path)
        parser.problems.append(Problem(Kind.CHECKSUM, unchecked))
    checked = not any(one.kind is Kind.CHECKSUM and not one.lost for one in parser.problems)
    if not any(math.isnan(fix.stamp_s) for fix in fixes):
        return fixes, parser.problems
    first_s = parser.first_dated_s
    placed = any(math.isnan(fix.stamp_s) and fix.no_place is None for fix in fixes)
    if math.isnan(first_s):
        before = next((match[1].decode() for _, line in pieces if (match := _DATE_BEFORE.search(line))), "")
        first_s = read_time(before.replace("/", "-"), ("iso8601",)) or NAN
    assumed = []
    if math.isnan(first_s) and log_s is not None and placed:
        first_s = log_s[0] + DAY_S * _day_of(_parsed(pieces, path, log_s[0], checked)[0], log_s, path)
        day = utc_text(first_s)[:10]
        message = f"the sentences have no date (neither RMC nor ZDA): the day is that of the log, {day}"
        assumed = [Problem(Kind.ASSUMED_TIME, Mistake(message, "", path))]
    if math.isfinite(first_s):
        fixes, parser = _parsed(pieces, path, first_s, checked)
    return fixes, [*parser.problems, *assumed]


def _day_of(fixes: Sequence[Fix], log_s: tuple[float, float], path: Path) -> int:
    """Days to add to positions that are dated from the begin of a log."""
    first_s, last_s = (of(fix.stamp_s for fix in fixes) for of in (min, max))
    days = math.ceil((log_s[1] - log_s[0]) / DAY_S) + 1
    found = [k for k in range(-days, days + 1) if first_s + k * DAY_S < log_s[1] and last_s + k * DAY_S > log_s[0]]
    if len(found) == 1:
        return found[0]
    clock = f"{utc_text(first_s)[11:]} to {utc_text(last_s)[11:]}"
    other = "several of its days fit" if found else "it has no record at these times of day"
    raise InputError(
        f"has positions, but no date (neither RMC nor ZDA): they are from {clock}, the log from "
        f"{utc_text(log_s[0])} to {utc_text(log_s[1])}: {other}",
        "let the receiver send RMC or ZDA, too" + ("; or map one day: --from, --to" if found else ""),
        path,
    )


def _parsed(
    pieces: Sequence[tuple[int, bytes]], path: Path, reference_stamp_s: float, require_checksum: bool = True
) -> tuple[list[Fix], NmeaParser]:
    parser = NmeaParser(reference_stamp_s=reference_stamp_s, require_checksum=require_checksum, path=path)
    fixes = []
    for number, line in pieces:
        parser.line_number = number - 1
        fixes.append(parser.feed(line))
    fixes.append(parser.flush())
    return [fix for fix in fixes if fix is not None], parser


def _pieces(lines: Sequence[bytes]) -> Iterator[tuple[int, bytes]]:
    """Number and bytes of each sentence: a line may have several, and a sentence several lines."""
    begun = b""
    for number, line in enumerate(lines, 1):
        rest = line.rstrip().rstrip(b"'\"")
        if begun and b"$" not in line and strip_checksum(begun.rpartition(b"$")[2] + rest) is not None:
            yield number, begun + line
            begun = b""
            continue
        if begun:
            yield number - 1, begun
        *whole, begun = re.split(rb"(?=\$[A-Z]{5},)", line) if line.count(b"$") > 1 else [line]
        yield from ((number, piece) for piece in whole if piece.strip())
        if b"$" not in begun or b"*" in begun:
            yield number, begun
            begun = b""
    if begun:
        yield len(lines), begun


_LOOKS = (
    (rb"\xb5b", "binary messages of u-blox (UBX)", "convert them to NMEA, such as with u-center"),
    (rb"\$@", "binary messages of Septentrio (SBF)", "convert them to NMEA, such as with SBF Converter"),
    (rb"\xaaD[\x12\x13]", "binary messages of NovAtel", "convert them to NMEA, such as with NovAtel Convert"),
    (rb"#[A-Z]{3,}[A-D]?,", "ASCII messages of NovAtel or Unicore", "log GPGGA and GPZDA, too"),
    (rb'{"class" *:', "JSON of gpsd", "record NMEA: gpspipe -r"),
    (rb"<TrainingCenter", "a track of Garmin (TCX)", "export the track as GPX"),
    (rb'"Feature(Collection)?"', "GeoJSON", "export the points as CSV with the columns time,lat,lon"),
    (rb"RINEX VERSION", "raw observations (RINEX)", "compute positions from them first, such as with RTKLIB"),
    (rb"\xd3\x00", "correction messages (RTCM), which have no position", "record the output of the rover"),
    (rb"[\x00-\x08\x80-\xff]{8}", "binary messages of an unknown kind", "let the receiver send NMEA"),
)


def _no_sentence(lines: Sequence[bytes]) -> tuple[str, str]:
    """Reason why lines hold no sentence, and what to do."""
    head = b"\n".join(lines[:200])
    for pattern, what, remedy in _LOOKS:
        if re.search(pattern, head):
            return f"has no NMEA sentence, but {what}", remedy
    return (
        "has no NMEA sentence with a correct checksum",
        "give the text that the GNSS receiver sent, with lines such as $GPGGA,...*hh, GPX, or a CSV file that "
        "begins with time,lat,lon,alt",
    )


# Sentences of a receiver that is simulated, or in a phone -------------------------------------------------------


def nmea_sentences(stamp_s: float, position: Position, speed_mps: float = NAN, rtk: bool = True) -> list[str]:
    """RMC, GGA and GST of one epoch [s since 1970 UTC], of an RTK receiver or of one without corrections, whose
    altitude is above the ellipsoid. Times are written to 0.01 s.
    """
    quality, mode, seen, geoid = ("4", "R", ("18", "0.7"), "48.0") if rtk else ("1", "A", ("", ""), "0.0")
    clock, date = _clock_and_date(stamp_s)
    latitude, north = _degrees_minutes(position.latitude_deg, 2), "N" if position.latitude_deg >= 0 else "S"
    longitude, east = _degrees_minutes(position.longitude_deg, 3), "E" if position.longitude_deg >= 0 else "W"
    place = (latitude, north, longitude, east)
    sd, up = f"{position.horizontal_sd_m:.3f}", f"{2 * position.horizontal_sd_m:.3f}"
    altitude, speed = _text(position.altitude_m), _text(speed_mps / KNOTS_MPS)
    gga = (clock, *place, quality, *seen, altitude, "M", geoid, "M", "", "")
    return [
        str(pynmea2.RMC("GN", "RMC", (clock, "A", *place, speed, "", date, "", "", mode))),
        str(pynmea2.GGA("GN", "GGA", gga)), str(pynmea2.GST("GN", "GST", (clock, sd, sd, sd, "0.0", sd, sd, up))),
    ]  # fmt: skip


def sentences_without_fix(stamp_s: float) -> list[str]:
    """RMC and GGA of an epoch [s since 1970 UTC] with a time but no position."""
    clock, date = _clock_and_date(stamp_s)
    nowhere = ("", "", "", "")
    return [
        str(pynmea2.RMC("GN", "RMC", (clock, "V", *nowhere, "", "", date, "", "", "N"))),
        str(pynmea2.GGA("GN", "GGA", (clock, *nowhere, "0", "03", "", "", "M", "", "M", "", ""))),
    ]


def _text(value: float) -> str:
    return f"{value:.3f}" if math.isfinite(value) else ""


def _clock_and_date(stamp_s: float) -> tuple[str, str]:
    time = datetime(1970, 1, 1, tzinfo=UTC) + timedelta(milliseconds=10 * round(stamp_s * 100))
    return f"{time:%H%M%S}.{time.microsecond // 10_000:02d}", f"{time:%d%m%y}"


def _degrees_minutes(degrees: float, width: int) -> str:
    # Whole units of 1e-7 minutes, so that rounding never prints 60 minutes.
    units = round(abs(degrees) * 600_000_000)
    whole, rest = divmod(units, 600_000_000)
    return f"{whole:0{width}d}{rest / 1e7:010.7f}"
