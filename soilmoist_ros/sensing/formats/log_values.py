# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Converts bytes to text, and text to numbers and times; none of these functions raises."""

from __future__ import annotations

import math
import re
from collections.abc import Sequence
from datetime import UTC, datetime, timedelta, timezone
from functools import reduce
from operator import xor

MAX_LINE = 65_536
"""Maximum length of a line [bytes]; longer lines are noise and are dropped."""
_NUMBER = re.compile(r"[+-]?(?:\d+\.?\d*|\.\d+)(?:[eE][+-]?\d{1,3})?", re.ASCII)
_ISO = re.compile(
    r"(\d{4})-(\d\d)-(\d\d)[T ](\d\d):(\d\d)(?::(\d\d)(?:[.,](\d{1,9}))?)?\s?(Z|[+-]\d\d:?\d\d)?", re.ASCII
)
_EPOCH = datetime(1970, 1, 1, tzinfo=UTC)
UTF8_BOM = b"\xef\xbb\xbf"


def decode_line(line: bytes) -> str:
    """Text of a line: UTF-8 (a byte order mark is dropped), else Latin-1."""
    line = line.removeprefix(UTF8_BOM)
    try:
        return line.decode("utf-8")
    except UnicodeDecodeError:
        return line.decode("latin-1")


def split_lines(data: bytes) -> tuple[list[bytes], bool]:
    """Lines of a file without line ends (LF, CR LF or CR), and whether the last line had an end.

    UTF-16 with a byte order mark, common in Windows tools, is converted to UTF-8.
    """
    if data[:2] in (b"\xff\xfe", b"\xfe\xff"):
        data = data.decode("utf-16", errors="replace").encode("utf-8", errors="replace")
    return data.splitlines(), data.endswith((b"\n", b"\r"))


def nmea_checksum(body: bytes) -> int:
    """Exclusive or of all bytes."""
    return reduce(xor, body, 0)


def strip_checksum(line: bytes) -> bytes | None:
    """The line without its ``*hh``; ``None`` if the checksum is absent or wrong."""
    body, star, digits = line.rstrip(b"\r\n").removeprefix(UTF8_BOM).rpartition(b"*")
    if not star or not re.fullmatch(rb"[0-9A-Fa-f]{2}", digits):
        return None
    return body if nmea_checksum(body) == int(digits, 16) else None


def read_number(text: str) -> float | None:
    """A finite decimal number, or ``None``. Stricter than ``float``: no ``1_000``, ``inf`` or ``nan``."""
    text = text.strip()
    if len(text) > 40 or not _NUMBER.fullmatch(text):
        return None
    value = float(text)
    return value if math.isfinite(value) else None


def read_time(text: str, formats: Sequence[str], utc_offset_hours: float = 0.0) -> float | None:
    """Seconds since 1970 UTC of a time stamp, by the first format that fits; ``None`` if no format fits.

    :param formats: ``iso8601``, ``unix_s``, ``unix_ms`` or formats of ``strptime``
    :param utc_offset_hours: clock minus UTC [h], for stamps without a time zone
    """
    text = text.strip()
    if len(text) > 60:
        return None
    for name in formats:
        if name == "iso8601":
            stamp = _read_iso(text, utc_offset_hours)
        elif name in ("unix_s", "unix_ms"):
            number = read_number(text)
            stamp = None if number is None else number * (0.001 if name == "unix_ms" else 1.0)
        else:
            stamp = _read_formatted(text, name, utc_offset_hours)
        if stamp is not None:
            return stamp
    return None


def _read_iso(text: str, utc_offset_hours: float) -> float | None:
    match = _ISO.fullmatch(text)
    if match is None:
        return None
    *parts, fraction, zone = match.groups()
    year, month, day, hour, minute, second = (int(part or 0) for part in parts)
    leap = second == 60  # a leap second becomes the first second of the next minute
    try:
        moment = datetime(year, month, day, hour, minute, 59 if leap else second, tzinfo=UTC)
    except ValueError:
        return None
    offset_s = _zone_s(zone) if zone else utc_offset_hours * 3600
    seconds = (moment - _EPOCH) // timedelta(seconds=1) + leap - offset_s
    return seconds + (float(f"0.{fraction}") if fraction else 0.0)


def _zone_s(zone: str) -> float:
    if zone == "Z":
        return 0.0
    sign = -1 if zone[0] == "-" else 1
    return sign * (int(zone[1:3]) * 3600 + int(zone[-2:]) * 60)


def _read_formatted(text: str, layout: str, utc_offset_hours: float) -> float | None:
    try:
        moment = datetime.strptime(text, layout)
    except ValueError:
        return None
    if moment.tzinfo is None:
        moment = moment.replace(tzinfo=timezone(timedelta(hours=utc_offset_hours)))
    return (moment - _EPOCH).total_seconds()
