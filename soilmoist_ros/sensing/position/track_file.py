# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Positions of a receiver from a file, known by its content: NMEA, GPX, a table (CSV), or a solution of RTKLIB."""

from __future__ import annotations

import csv
import math
import re
from collections.abc import Iterator, Sequence
from dataclasses import replace
from pathlib import Path
from xml.etree import ElementTree

from soilmoist_ros.foundation import DAY_S
from soilmoist_ros.foundation.errors import InputError, Mistake
from soilmoist_ros.sensing.formats.log_file import read_lines
from soilmoist_ros.sensing.formats.log_values import decode_line, read_number, read_time
from soilmoist_ros.sensing.gnss import STATUS_OF_QUALITY, Fix, FixStatus, NoPlace, is_place
from soilmoist_ros.sensing.position.nmea import parse_nmea
from soilmoist_ros.sensing.problems import Kind, Problem
from soilmoist_ros.sensing.records import NAN, Position

_HEAD = 50
"""Number of lines in which the header of a table is searched."""
_LEAP_S = 18.0
"""GPS time minus UTC since 2017 [s]."""
_GPS_EPOCH_S = 315_964_800.0
"""1980-01-06, from which GPS counts its weeks [s since 1970]."""
_LATITUDE = ("latitude", "lat", "y_lat", "gps_lat", "gps_latitude", "latitude_n")
_LONGITUDE = ("longitude", "lon", "lng", "long", "gps_lon", "gps_long", "gps_longitude", "longitude_e")
_ALTITUDE = ("altitude", "alt", "elevation", "ele", "height", "ellipsoidal_height", "gps_alt", "msl")
_TIME = (
    "time", "timestamp", "datetime", "date_time", "time_utc", "utc_time", "utc", "utc_datetime", "gps_time",
    "iso_time", "gpst", "date_time_utc", "utc_t", "unix_time", "unix", "epoch", "stamp",
)  # fmt: skip
_QUALITY = ("quality", "fix_quality", "gps_quality", "gga_quality")
"""Columns with the quality of GGA."""
_DATE = ("date", "utc_date", "date_utc", "day", "utc_d")


def read_positions(path: Path | str, log_s: tuple[float, float] | None = None) -> tuple[list[Fix], list[Problem]]:
    """Read the positions and problems of a file.

    :param path: the file
    :param log_s: first and last time of the log for which the positions are [s since 1970 UTC], if known
    :raises InputError: if it has no positions that can be read
    """
    path = Path(path)
    lines, _ = read_lines(path, binary=True)
    head = b"\n".join(lines[:_HEAD]).lower()
    if b"<gpx" in head:
        return _read_gpx(path)
    if b"<kml" in head:
        raise InputError("is a KML file, whose points have no times", "export the track as GPX or CSV", path)
    if b"$" not in head and (table := _table(lines)) is not None:
        return _read_table(path, *table)
    return parse_nmea(lines, path, log_s)


def _read_gpx(path: Path) -> tuple[list[Fix], list[Problem]]:
    try:
        root = ElementTree.fromstring(path.read_bytes())
    except ElementTree.ParseError as error:
        raise InputError(f"is a damaged GPX file: {error}", "export the track again", path) from None
    fixes, zones = [], _Zones(path)
    for point in root.iter():
        kind = point.tag.rpartition("}")[2]
        if kind not in ("trkpt", "rtept", "wpt"):
            continue
        inside = {child.tag.rpartition("}")[2]: (child.text or "").strip() for child in point}
        stamp_s = zones.stamp_s(inside.get("time", ""), 0)
        if inside.get("fix", "").lower() == "none":
            fixes.append(Fix.without_place(stamp_s, NoPlace.NO_FIX, "GPX fix none"))
            continue
        latitude, longitude = read_number(point.get("lat", "")), read_number(point.get("lon", ""))
        fixes.append(_fix(stamp_s, latitude, longitude, read_number(inside.get("ele", ""))))
    if not fixes:
        raise InputError("is a GPX file without points", "export the track, not only its outline", path)
    return fixes, zones.problems


def _fix(
    stamp_s: float, latitude: float | None, longitude: float | None, altitude: float | None, sd_m: float = NAN
) -> Fix:
    if latitude is None or longitude is None or not is_place(latitude, (longitude + 180) % 360 - 180):
        return Fix.without_place(stamp_s, NoPlace.NO_COORDINATES, f"latitude {latitude}, longitude {longitude}")
    longitude = longitude - 360.0 if longitude > 180 else longitude
    return Fix(stamp_s, Position(latitude, longitude, NAN if altitude is None else altitude, sd_m), FixStatus.FIX)


class _Zones:
    """Times of a file; notes once if they have no zone."""

    def __init__(self, path: Path) -> None:
        self._path = path
        self.problems: list[Problem] = []

    def stamp_s(self, text: str, line: int, known: bool = False) -> float:
        """Time of a text [s since 1970 UTC], NaN if it is empty.

        :param known: whether the file states the zone elsewhere
        :raises InputError: if it cannot be understood
        """
        said = re.sub(r"\s*(UTC|GMT)$", "Z", text.strip().strip('"'))
        said = re.sub(r"^(\d{4})/(\d\d)/(\d\d)", r"\1-\2-\3", said)
        if not said:
            return NAN
        number = read_number(said)
        if number is not None and number > 1e8:
            return float(number / 10 ** (3 * max(0, math.floor(math.log10(number) / 3) - 3)))  # s, ms, us or ns
        stamp_s = read_time(said, ("iso8601",))
        if stamp_s is None:
            remedy = "write times as 2026-05-14T09:00:10Z, or as seconds since 1970: day and month are not guessed"
            raise InputError([Mistake(f"{text[:40]!r} is no time that can be read", remedy, self._path, line)])
        if not known and not self.problems and not re.search(r"(Z|[+-]\d\d:?\d\d)$", said):
            message = f"times such as {text[:40]!r} have no time zone: they are read as UTC"
            self.problems.append(Problem(Kind.ASSUMED_TIME, Mistake(message, "if not: --gnss-shift", self._path)))
        return stamp_s


def _plain(name: str) -> str:
    name = re.sub(r"\(.*?\)|\[.*?\]|°", "", name.lower().strip().strip("\"'%# "))
    return re.sub(r"_(deg|degrees|m|dd|s|ms|us|ns)$", "", re.sub(r"[\s./-]+", "_", name.strip()))


def _split(line: str, delimiter: str) -> list[str]:
    return line.split() if delimiter == " " else next(csv.reader([line], delimiter=delimiter), [])


Table = tuple[str, int, dict[str, int], Sequence[bytes], str]


def _table(lines: Sequence[bytes]) -> Table | None:
    """Delimiter, line of the header, columns, lines, and the scale of its times; ``None`` without a header."""
    for number, raw in enumerate(lines[:_HEAD], 1):
        line = decode_line(raw)
        for delimiter in ";\t, ":
            text = line.lstrip("% ") if delimiter == " " else line
            names = [_plain(name) for name in _split(re.sub(r"\(.*?\)", "", text), delimiter)]
            found = {
                key: next((names.index(name) for name in known if name in names), -1)
                for key, known in (("lat", _LATITUDE), ("lon", _LONGITUDE), ("alt", _ALTITUDE), ("time", _TIME),
                                   ("date", _DATE), ("sdn", ("sdn",)), ("sde", ("sde",)),
                                   ("quality", _QUALITY), ("hrms", ("hrms", "h_rms")))
            }  # fmt: skip
            if found["lat"] >= 0 and found["lon"] >= 0:
                its = [names[at] for at in (found["time"], found["date"]) if at >= 0]
                scale = "GPS" if "gpst" in its else "UTC" if any("utc" in name for name in its) else ""
                if delimiter == " " and line.startswith("%"):  # of RTKLIB: date and time are two fields, one name
                    found = {key: at + (at > 0) for key, at in found.items()}
                    found["date"], found["time"] = 0, 1
                return delimiter, number, found, lines, scale
    return None


def _read_table(
    path: Path, delimiter: str, header: int, columns: dict[str, int], lines: Sequence[bytes], scale: str
) -> tuple[list[Fix], list[Problem]]:
    fixes, zones = [], _Zones(path)
    if columns["time"] < 0 and columns["date"] < 0:
        raise InputError(
            "has latitudes and longitudes, but no column of times",
            f"name the times {_TIME[0]!r} or {_TIME[1]!r} in the header, as 2026-05-14T09:00:10Z",
            path,
        )
    for number, cells in _rows(lines[header:], header, delimiter):
        text = {key: cells[at].strip() if 0 <= at < len(cells) else "" for key, at in columns.items()}
        time = " ".join(filter(None, (text["date"], text["time"])))
        if re.fullmatch(r"\d{3,4}", text["date"]) and (of_week_s := read_number(text["time"])) is not None:
            stamp_s = _GPS_EPOCH_S + 7 * DAY_S * int(text["date"]) + of_week_s
        else:
            stamp_s = zones.stamp_s(time, number, bool(scale))
        values = [text[key].replace(",", ".") if delimiter == ";" else text[key] for key in ("lat", "lon", "alt")]
        latitude, longitude, altitude = (read_number(value) for value in values)
        for key, name, value, limit in (
            ("lat", "latitude", latitude, 90.0),
            ("lon", "longitude", longitude, 360.0),
        ):
            if text[key] and (value is None or abs(value) > limit):
                remedy = "give decimal degrees, such as 53.2680 and -0.5245"
                raise InputError([Mistake(f"{text[key][:40]!r} is no {name} in degrees", remedy, path, number)])
        quality = read_number(text["quality"])
        if quality is not None and (status := STATUS_OF_QUALITY.get(int(quality))) is None:
            why = NoPlace.QUALITY_UNKNOWN if quality else NoPlace.NO_FIX
            fixes.append(Fix.without_place(stamp_s - _LEAP_S * (scale == "GPS"), why, f"quality {quality:g}"))
            continue
        sds = [read_number(text[key]) for key in ("sdn", "sde")]
        sd_m = math.hypot(sds[0], sds[1]) / math.sqrt(2) if sds[0] is not None and sds[1] is not None else NAN
        if (rms_m := read_number(text["hrms"])) is not None:
            sd_m = rms_m / math.sqrt(2)
        fix = _fix(stamp_s - _LEAP_S * (scale == "GPS"), latitude, longitude, altitude, sd_m)
        if quality is not None and fix.no_place is None:
            fix = replace(fix, status=status or FixStatus.FIX, quality=int(quality))
        fixes.append(fix)
    if scale == "GPS":
        message = f"the times are GPS time: {_LEAP_S:g} leap seconds are taken off for UTC"
        zones.problems.append(Problem(Kind.ASSUMED_TIME, Mistake(message, "", path)))
    return fixes, zones.problems


def _rows(lines: Sequence[bytes], header: int, delimiter: str) -> Iterator[tuple[int, list[str]]]:
    for number, raw in enumerate(lines, header + 1):
        line = decode_line(raw)
        if line.strip() and not line.lstrip().startswith(("%", "#")):
            yield number, _split(line, delimiter)
