# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Converts bytes to text, text to numbers, coordinates and times, and units; none of these functions raises."""

from __future__ import annotations

import math
import re
from collections.abc import Callable, Sequence
from datetime import datetime, timedelta
from functools import reduce
from operator import xor
from typing import Literal
from zoneinfo import ZoneInfo

Decimal = Literal["auto", "point", "comma"]

_NUMBER = re.compile(r"[+-]?(?:\d+\.?\d*|\.\d+)(?:[eE][+-]?\d{1,3})?", re.ASCII)
_ISO = re.compile(
    r"(\d{4})-(\d\d)-(\d\d)[T ](\d\d):(\d\d)(?::(\d\d)(?:[.,](\d{1,9}))?)?\s?(Z|[+-]\d\d:?\d\d)?", re.ASCII
)
_WALL_EPOCH = datetime(1970, 1, 1)  # the time of a clock on a wall, in any zone
_MIDNIGHT = re.compile(r"(?<![\d:])24:00(?P<seconds>:00(?:[.,]0+)?)?(?![\d:])")
_ZONE = re.compile(r"(.*\d(?: ?[AaPp][Mm])?)\s*(UTC|GMT|Z|[+-]\d\d:?\d\d)", re.ASCII | re.IGNORECASE)
_EXCEL_EPOCH_DAYS = 25_569
_LAST_WALL_S = 2e11
_THOUSANDS = {"auto": "", "point": ",", "comma": "."}  # separator of thousands, besides blanks and apostrophes
_GROUPED = {  # three digits after each separator, and never the decimal separator itself
    decimal: re.compile(
        rf"[+-]?\d{{1,3}}(?:[{more}' ]\d{{3}})+(?:{',' if decimal == 'comma' else '[.]'}\d*)?", re.ASCII
    )
    for decimal, more in _THOUSANDS.items()
}
_DEGREES = re.compile(
    r"([NSEW])?\s*([+-]?)\s*(\d{1,3})\s*[°d: ]\s*(\d{1,2}(?:\.\d+)?)\s*(?:['′m: ]\s*(\d{1,2}(?:\.\d+)?)?)?"
    r"\s*[\"″s']*\s*([NSEW])?",
    re.IGNORECASE | re.ASCII,
)
COMMON_TIME_FORMATS = (
    "iso8601", "%Y/%m/%d %H:%M:%S", "%Y/%m/%d %H:%M",
    "%d.%m.%Y %H:%M:%S", "%d.%m.%Y %H:%M", "%d.%m.%y %H:%M:%S", "%d.%m.%y %H:%M",
    "%d/%m/%Y %H:%M:%S", "%d/%m/%Y %H:%M", "%m/%d/%Y %H:%M:%S", "%m/%d/%Y %H:%M",
    "%d/%m/%y %H:%M:%S", "%d/%m/%y %H:%M", "%m/%d/%y %H:%M:%S", "%m/%d/%y %H:%M",
    "%m/%d/%Y %I:%M:%S %p", "%m/%d/%Y %I:%M %p", "%d/%m/%Y %I:%M:%S %p", "%d/%m/%Y %I:%M %p",
    "%d-%m-%Y %H:%M:%S", "%d-%m-%Y %H:%M", "%m-%d-%Y %H:%M:%S", "%m-%d-%Y %H:%M", "%d-%b-%Y %H:%M:%S",
    "%d-%b-%Y %H:%M", "%d %b %Y %H:%M:%S", "%d %b %Y %H:%M", "%Y%m%d%H%M%S", "%Y%m%d%H%M", "%Y%m%d %H%M%S",
    "%Y%m%d %H%M", "%Y%m%d %H:%M:%S", "%Y%m%d %H:%M", "%Y-%m-%d", "%d.%m.%Y", "%d/%m/%Y", "%m/%d/%Y", "%Y/%m/%d",
)  # fmt: skip
"""Formats of stamps that loggers and spreadsheets write."""
_BLANKS = dict.fromkeys(map(ord, "\u00a0\u2007\u2009\u202f"), " ")
"""Blanks that do not break a line, which spreadsheets write between thousands."""
UTF8_BOM = b"\xef\xbb\xbf"
Converter = Callable[[float], float]
Quantity = Literal["pressure", "temperature", "humidity"]
DURATIONS = {"s": 1.0, "ms": 0.001, "min": 60.0, "h": 3600.0}
_SCALES: dict[Quantity, dict[str, float]] = {
    "pressure": {"hPa": 1.0, "mb": 1.0, "mbar": 1.0, "Pa": 0.01, "kPa": 10.0, "mmHg": 1.33322, "inHg": 33.8639},
    "temperature": {"degC": 1.0, "degF": 1.0, "K": 1.0}, "humidity": {"percent": 0.01, "fraction": 1.0},
}  # fmt: skip
_SPELLINGS = {
    spelling: unit
    for unit, spellings in {
        "hPa": "hpa hectopascal", "mb": "mb", "mbar": "mbar millibar", "Pa": "pa pascal", "kPa": "kpa",
        "mmHg": "mmhg torr", "inHg": "inhg", "degC": "c degc celsius degreescelsius degcelsius",
        "degF": "f degf fahrenheit", "K": "k kelvin", "percent": "% percent pct %rh", "fraction": "fraction",
        "V": "volt volts v", "counts": "count counts", "m": "m", "mm": "mm", "m/s": "m/s", "W/m2": "w/m2",
    }.items()
    for spelling in spellings.split()
}  # fmt: skip
_RATE = re.compile(
    r"cp([smh])(?![a-z])|(?:/|per)_?(s|sec|seconds?|min|minutes?|h|hrs?|hours?|heure)(?![a-z])"
    r"|(?<![a-z])(h|s|min)_?\^?(?:-1|⁻¹)"
)
_RATES = {"s": "counts_per_second", "m": "counts_per_minute", "h": "counts_per_hour"}


def decode_line(line: bytes) -> str:
    """Text of a line: UTF-8 (a byte order mark is dropped), else Latin-1; all blanks are ordinary ones."""
    line = line.removeprefix(UTF8_BOM)
    try:
        text = line.decode("utf-8")
    except UnicodeDecodeError:
        text = line.decode("latin-1")
    return text if text.isascii() else text.translate(_BLANKS)


def nmea_checksum(body: bytes) -> int:
    """Exclusive or of all bytes."""
    return reduce(xor, body, 0)


def strip_checksum(line: bytes) -> bytes | None:
    """The line without its ``*hh``; ``None`` if the checksum is absent or wrong."""
    body, star, digits = line.rstrip(b"\r\n").removeprefix(UTF8_BOM).rpartition(b"*")
    if not star or not re.fullmatch(rb"[0-9A-Fa-f]{2}", digits):
        return None
    return body if nmea_checksum(body) == int(digits, 16) else None


def read_number(text: str, decimal: Decimal = "auto") -> float | None:
    """A finite decimal number, or ``None``. Stricter than ``float``: no ``1_000``, ``inf`` or ``nan``.

    With ``auto`` there is a decimal point, and only blanks between thousands.

    >>> read_number("985,3"), read_number("985,3", "comma"), read_number("1,649", "point"), read_number("1 649")
    (None, 985.3, 1649.0, 1649.0)
    """
    text = text.strip()
    if len(text) > 40:
        return None
    if not text.isascii():
        text = text.translate(_BLANKS)
    if decimal != "comma" and _NUMBER.fullmatch(text):
        pass
    elif _GROUPED[decimal].fullmatch(text):
        text = re.sub(rf"[{_THOUSANDS[decimal]}' ]", "", text)
    elif decimal == "comma" and "." in text:
        return None
    text = text.replace(",", ".") if decimal == "comma" else text
    if not _NUMBER.fullmatch(text):
        return None
    value = float(text)
    return value if math.isfinite(value) else None


def read_coordinate(text: str, packed: bool = False, decimal: Decimal = "auto") -> float | None:
    """Latitude or longitude [deg]; south and west are negative. ``None`` if it cannot be read.

    >>> read_coordinate("5121.0 N", packed=True), read_coordinate("51° 21.0' S"), read_coordinate("-43.6")
    (51.35, -51.35, -43.6)

    :param packed: whether the last two digits before the decimal point are minutes, as in NMEA
    """
    text = text.strip()
    letter = "".join(side for side in (text[:1], text[-1:]) if side and side in "NSEWnsew")[:1].upper()
    value = read_number(text.strip("NSEWnsew \t"), decimal)
    if value is not None and packed:
        degrees, minutes = divmod(abs(value), 100.0)
        value = None if minutes >= 60 else math.copysign(degrees + minutes / 60.0, value)
    elif value is None and (match := _DEGREES.fullmatch(text.replace(",", ".") if decimal == "comma" else text)):
        minutes, seconds = float(match[4]), float(match[5] or 0)
        if minutes >= 60 or seconds >= 60:
            return None
        value = int(match[3]) + minutes / 60.0 + seconds / 3600.0
        value = -value if match[2] == "-" else value
    return value if value is None or not letter or value < 0 else value * (-1.0 if letter in "SW" else 1.0)


def read_time(
    text: str, formats: Sequence[str], clock: float | ZoneInfo = 0.0, after_s: float = math.nan
) -> float | None:
    """Seconds since 1970 UTC of a time stamp, by the first format that fits; ``None`` if no format fits.

    :param formats: ``iso8601``, ``unix_s``, ``unix_ms``, ``excel_days`` or formats of ``strptime``
    :param clock: clock minus UTC [h] or its time zone, for stamps without a time zone
    :param after_s: stamp of the record before; in autumn it tells the two hours of one name apart
    """
    found = _read_wall_time(text.strip(), formats)
    if found is None:
        return None
    wall_s, zone_s = found
    if zone_s is not None:
        return wall_s - zone_s
    if isinstance(clock, ZoneInfo):
        return utc_of(wall_s, clock, after_s)[0] if 0 < wall_s < _LAST_WALL_S else wall_s
    return wall_s - clock * 3600


def utc_of(wall_s: float, zone: ZoneInfo, after_s: float = math.nan) -> tuple[float, float]:
    """Seconds since 1970 UTC of a local time [s since 1970 of the wall clock], and of its other reading.

    Both are equal on all but two days a year; the first comes after the stamp of the record before.
    """
    moment = _WALL_EPOCH + timedelta(seconds=math.floor(wall_s))
    offsets_s = [moment.replace(tzinfo=zone, fold=fold).utcoffset() or timedelta() for fold in (0, 1)]
    first_s, second_s = (wall_s - offset.total_seconds() for offset in offsets_s)
    return (second_s, first_s) if first_s <= after_s < second_s else (first_s, second_s)


def zone_doubt(text: str, formats: Sequence[str], zone: ZoneInfo, stamp_s: float) -> str:
    """Reason to doubt a local time: its zone does not have it, or twice; empty on all but two days."""
    found = _read_wall_time(text.strip(), formats)
    if found is None or found[1] is not None:
        return ""
    first_s, other_s = utc_of(found[0], zone)
    if first_s == other_s:
        return ""
    if first_s > other_s:
        return f"does not exist in {zone.key}: this clock does not change to summer time as its zone does"
    return f"occurs twice in {zone.key}: read as the {'first' if stamp_s == first_s else 'second'}"


def _read_wall_time(text: str, formats: Sequence[str]) -> tuple[float, float | None] | None:
    """Time of the wall clock [s], and its distance from UTC [s] where the stamp has a zone."""
    if len(text) > 60:
        return None
    days = 0
    if "24:00" in text and (match := _MIDNIGHT.search(text)):
        text, days = f"{text[: match.start()]}00:00{match['seconds'] or ''}{text[match.end() :]}", 1
    zoned = _ZONE.fullmatch(text)
    for name in formats:
        if name == "iso8601":
            found = _read_iso(f"{zoned[1]}Z" if zoned and zoned[2].upper() in ("UTC", "GMT") else text)
        elif name in ("unix_s", "unix_ms", "excel_days"):
            number = read_number(text.replace(",", ".") if name == "excel_days" else text)
            if number is None:
                continue
            excel = name == "excel_days"
            number = round((number - _EXCEL_EPOCH_DAYS) * 86_400, 3) if excel else number
            found = number * (0.001 if name == "unix_ms" else 1.0), None if excel else 0.0
        else:
            found = _read_formatted(text, name)
            if found is None and zoned and (bare := _read_formatted(zoned[1], name)):
                found = bare[0], _zone_s(zoned[2].upper())
        if found is not None:
            return found[0] + 86_400 * days, found[1]
    return None


def likely_time_formats(text: str) -> list[str]:
    """Common formats that read a stamp.

    >>> likely_time_formats("1525184048000")
    ['unix_ms']
    """
    number = read_number(text)
    if number is not None and not re.fullmatch(r"(19|20)\d{10}|(19|20)\d{12}", text.strip()):
        limits = {"excel_days": (32_000, 60_000), "unix_s": (6e8, 4.1e9), "unix_ms": (6e11, 4.1e12)}
        return [name for name, (low, high) in limits.items() if low < number < high]
    return [name for name in COMMON_TIME_FORMATS if _read_wall_time(text.strip(), [name]) is not None]


def _read_iso(text: str) -> tuple[float, float | None] | None:
    match = _ISO.fullmatch(text)
    if match is None:
        return None
    *parts, fraction, zone = match.groups()
    year, month, day, hour, minute, second = (int(part or 0) for part in parts)
    leap = second == 60  # a leap second becomes the first second of the next minute
    try:
        moment = datetime(year, month, day, hour, minute, 59 if leap else second)
    except ValueError:
        return None
    seconds = (moment - _WALL_EPOCH) // timedelta(seconds=1) + leap
    return seconds + (float(f"0.{fraction}") if fraction else 0.0), _zone_s(zone) if zone else None


def _zone_s(zone: str) -> float:
    if zone in ("Z", "UTC", "GMT"):
        return 0.0
    sign = -1 if zone[0] == "-" else 1
    return sign * (int(zone[1:3]) * 3600 + int(zone[-2:]) * 60)


def _read_formatted(text: str, layout: str) -> tuple[float, float | None] | None:
    try:
        moment = datetime.strptime(text, layout)
    except ValueError:
        return None
    offset, wall = moment.utcoffset(), moment.replace(tzinfo=None)
    return (wall - _WALL_EPOCH).total_seconds(), None if offset is None else offset.total_seconds()


# Conversion from the units of loggers to the units of this package ----------------------------------------------


def canonical(text: str) -> str:
    """A unit as a format file spells it, such as degC for ``Deg C``; empty if the unit is unknown.

    >>> canonical("Deg C"), canonical("mBar"), canonical("furlong")
    ('degC', 'mbar', '')
    """
    return _SPELLINGS.get(re.sub(r"[\s.°^_]|^[\[(]|[\])]$", "", text.casefold()), "")


def measures(quantity: Quantity, unit: str) -> bool:
    """True if a unit is one of a quantity."""
    return unit in _SCALES[quantity]


def rate_of(text: str) -> str:
    """Unit of a count rate in the name or the unit of a column, such as counts_per_hour; empty without one.

    >>> rate_of("Neutrons [1/h]"), rate_of("CPM"), rate_of("n_per_sample"), rate_of("counts/15min")
    ('counts_per_hour', 'counts_per_minute', '', '')
    """
    plain = re.sub(r"[\s._]+", "_", text.casefold()).replace("hz", "cps").replace("stunde", "h")
    match = _RATE.search(plain)
    return _RATES[next(filter(None, match.groups()))[0]] if match else ""


def converter(quantity: Quantity, unit: str) -> Converter:
    """Converter of a unit to hPa, degC or a fraction."""
    if unit == "K":
        return lambda value: value - 273.15
    if unit == "degF":
        return lambda value: (value - 32.0) / 1.8
    factor = _SCALES[quantity][unit]
    if factor == 0.01:
        return lambda value: value / 100.0  # dividing keeps 965.0 hPa exactly 965.0
    return lambda value: value * factor


def to_seconds(unit: str) -> Converter:
    """Converter of a unit of duration to seconds."""
    factor = DURATIONS[unit]
    return lambda value: value * factor


def remedy_of_unit(quantity: Quantity, value: float, low: float, high: float, otherwise: str) -> str:
    """Remedy for an impossible value: units in which it would be possible come first.

    >>> remedy_of_unit("pressure", 99000.0, 300.0, 1085.0, "check the sensor")
    "if it is in Pa, write 'unit: Pa' into the logger format; else check the sensor"
    """
    units = [unit for unit in _SCALES[quantity] if low <= converter(quantity, unit)(value) <= high]
    if not units:
        return otherwise
    keys = " or ".join(f"'unit: {unit}'" for unit in units)
    return f"if it is in {' or '.join(units)}, write {keys} into the logger format; else {otherwise}"
