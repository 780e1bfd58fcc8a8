# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Positions of a receiver from a file, known by its content: NMEA, GPX, a table (CSV), or a solution of RTKLIB."""

from __future__ import annotations

import csv
import math
import re
from collections.abc import Mapping, Sequence
from dataclasses import replace
from itertools import pairwise
from pathlib import Path
from typing import NamedTuple
from xml.etree import ElementTree

from soilmoist_ros.foundation import DAY_S, InputError, Mistake
from soilmoist_ros.sensing.formats.log_values import (
    decode_line,
    likely_time_formats,
    read_coordinate,
    read_number,
    read_time,
)
from soilmoist_ros.sensing.gnss import STATUS_OF_QUALITY, Fix, FixStatus, NoPlace, is_place
from soilmoist_ros.sensing.lines import read_lines
from soilmoist_ros.sensing.position.nmea import parse_nmea
from soilmoist_ros.sensing.problems import Kind, Problem
from soilmoist_ros.sensing.records import NAN, Position, utc_text

_HEAD = 50  # number of lines in which the header of a table is searched
_LEAP_S = 18.0  # GPS time minus UTC since 2017 [s]
_GPS_EPOCH_S = 315_964_800.0  # 1980-01-06, from which GPS counts its weeks [s since 1970]
_KNOWN: Mapping[str, Sequence[str]] = {
    "lat": ("latitude", "lat", "y_lat", "gps_lat", "gps_latitude", "latitude_n"),
    "lon": ("longitude", "lon", "lng", "long", "gps_lon", "gps_long", "gps_longitude", "longitude_e"),
    "alt": ("altitude", "alt", "elevation", "ele", "height", "ellipsoidal_height", "gps_alt", "msl"),
    "time": ("time_utc", "utc_time", "utc", "utc_datetime", "date_time_utc", "datetime_utc", "utc_t",
             "timestamp_utc", "time", "timestamp", "datetime", "date_time", "gps_time", "iso_time",
             "gpst", "unix_time", "unix", "epoch", "stamp"),
    "date": ("utc_date", "date_utc", "utc_d", "date", "day"),
    "quality": ("quality", "fix_quality", "fixquality", "gps_quality", "gga_quality"),  # of GGA
    # Whether there is a fix, in words; or by 0, and by -1 in NavSatStatus.
    "state": ("fix", "fix_type", "fixtype", "gps_fix", "fix_status", "solution_status", "solution", "rmc_status",
              "valid", "validity", "status", "status_status"),
    "sdn": ("sdn",), "sde": ("sde",), "hrms": ("hrms", "h_rms"),
}  # fmt: skip
"""Names of the columns of each quantity, the best first."""
_ZERO_IS_NO_FIX = ("fix", "fix_type", "fixtype", "gps_fix", "valid")
_NO_FIX = {"none", "no", "no fix", "no_fix", "nofix", "no solution", "invalid", "void", "v", "false", "-1"}
_GGA_OF_RTKLIB = {0: 0, 1: 4, 2: 5, 3: 9, 4: 2, 5: 1, 6: 2}
"""Quality of GGA by the Q of RTKLIB: 1 fix, 2 float, 3 SBAS, 4 DGPS, 5 single, 6 PPP."""
_PARTS = re.compile(r"(lat|lon|lng|latitude|longitude)_?(min|sec)[a-z]*")
"""Names of columns of minutes and seconds, next to one of degrees."""
_RTKLIB_HEADER = (
    "%  GPST latitude(deg) longitude(deg) height(m) Q ns sdn(m) sde(m) sdu(m) sdne(m) sdeu(m) sdun(m) age(s) ratio"
)
_DEGREES = "give decimal degrees, such as 53.2680 and -0.5245"


def read_positions(path: Path | str, log_s: tuple[float, float] | None = None) -> tuple[list[Fix], list[Problem]]:
    """Read the positions and problems of a file.

    :param log_s: first and last time of the log for which the positions are [s since 1970 UTC], if known
    :raises InputError: if it has no positions that can be read
    """
    path = Path(path)
    lines, _ = read_lines(path, binary=True)
    head = b"\n".join(lines[:_HEAD]).lower()
    if b"<gpx" in head:
        return _read_gpx(path)
    if b"<kml" in head:
        raise InputError("is a KML file, which is not read", "export the track with its times as GPX or CSV", path)
    if b"$" not in head:
        for number, raw in enumerate(lines[:_HEAD], 1):
            for delimiter in ";\t, ":
                if (table := _table(decode_line(raw), delimiter, number, path)) is not None:
                    return _read_table(path, table, lines)
        if (why := _why_no_table("\n".join(map(decode_line, lines[:_HEAD])))) is not None:
            raise InputError(*why, path)
    return parse_nmea(lines, path, log_s)


def _why_no_table(head: str) -> tuple[str, str] | None:
    """Reason why a table has no latitude and longitude, and what to do; ``None`` for what is no table."""
    if "-ecef(m)" in head or "e-baseline(m)" in head:
        what = "from the centre of the earth" if "-ecef(m)" in head else "relative to a base"
        return f"has coordinates {what}, not latitude and longitude", "let RTKLIB write Lat/Lon/Height"
    solution = r"^\s*\d{4}(/\d\d/\d\d +\d\d:\d\d:\d\d(\.\d*)?| +\d{1,6}\.\d+)( +-?\d+\.\d+){3} +\d "
    if re.search(solution, head, re.M):
        what = "looks like a solution of RTKLIB without its header: GPS time or UTC, and degrees, are not stated"
        return what, f"put the header in front, with GPST or UTC: {_RTKLIB_HEADER!r}"
    first = next((line for line in head.splitlines() if line.strip() and not line.startswith("sep=")), "")
    names = [name.strip() for name in re.split("[;\t,]", first)]
    if len(names) > 2 and all(re.fullmatch(r"[^<>{}$*\d][^<>{}$*]{0,60}", name) for name in names if name):
        remedy = "name the columns of decimal degrees 'lat' and 'lon'; convert coordinates of another kind first"
        return f"is a table without columns of latitude and longitude: {', '.join(names)[:200]}", remedy
    return None


def _read_gpx(path: Path) -> tuple[list[Fix], list[Problem]]:
    try:
        root = ElementTree.fromstring(path.read_bytes())
    except ElementTree.ParseError as error:
        raise InputError(f"is a damaged GPX file: {error}", "export the track again", path) from None
    fixes, times = [], _Times(path)
    for point in root.iter():
        if point.tag.rpartition("}")[2] not in ("trkpt", "rtept", "wpt"):
            continue
        inside = {child.tag.rpartition("}")[2]: (child.text or "").strip() for child in point}
        stamp_s = times.stamp_s(inside.get("time", ""), 0)
        if inside.get("fix", "").lower() == "none":
            fixes.append(Fix.without_place(stamp_s, NoPlace.NO_FIX, "GPX fix none"))
            continue
        latitude, longitude = read_number(point.get("lat", "")), read_number(point.get("lon", ""))
        fixes.append(_fix(stamp_s, latitude, longitude, read_number(inside.get("ele", ""))))
    if not fixes:
        raise InputError("is a GPX file without points", "export the track, not only its outline", path)
    times.check(fixes)
    return fixes, times.problems


def _fix(
    stamp_s: float, latitude: float | None, longitude: float | None, altitude: float | None, sd_m: float = NAN
) -> Fix:
    if latitude is None or longitude is None or not is_place(latitude, (longitude + 180) % 360 - 180):
        return Fix.without_place(stamp_s, NoPlace.NO_COORDINATES, f"latitude {latitude}, longitude {longitude}")
    longitude = longitude - 360.0 if longitude > 180 else longitude
    return Fix(stamp_s, Position(latitude, longitude, NAN if altitude is None else altitude, sd_m), FixStatus.FIX)


class _Times:
    """Times of a file; notes once if they have no zone."""

    def __init__(self, path: Path, formats: Sequence[str] = ()) -> None:
        self._path = path
        self._formats = ("iso8601", *formats)
        self.problems: list[Problem] = []

    def stamp_s(self, text: str, line: int, known: bool = False) -> float:
        """Time of a text [s since 1970 UTC], NaN if it is empty.

        :raises InputError: if it cannot be understood
        """
        said = re.sub(r"\s*(UTC|GMT)$", "Z", text.strip().strip('"'))
        said = re.sub(r"^(\d{4})/(\d\d)/(\d\d)", r"\1-\2-\3", said)
        if not said:
            return NAN
        number = read_number(said)
        if number is not None and number > 1e8:
            return float(number / 10 ** (3 * max(0, math.floor(math.log10(number) / 3) - 3)))  # s, ms, us or ns
        stamp_s = read_time(said, self._formats)
        if stamp_s is None:
            remedy = "write times as 2026-05-14T09:00:10Z, or as seconds since 1970"
            raise InputError([Mistake(f"{text[:40]!r} is no time that can be read", remedy, self._path, line)])
        if not known and not self.problems and not re.search(r"(Z|[+-]\d\d:?\d\d)$", said):
            message = f"times such as {text[:40]!r} have no time zone: they are read as UTC"
            remedy = "if they are local time or GPS time: --gnss-shift, such as -2h or -18s"
            self.problems.append(Problem(Kind.ASSUMED_TIME, Mistake(message, remedy, self._path)))
        return stamp_s

    def check(self, fixes: Sequence[Fix]) -> None:
        """Check that a position has a time, and that one shift corrects times without a zone.

        :raises InputError: if not: local time goes back by an hour in autumn
        """
        stamps = [fix.stamp_s for fix in fixes if math.isfinite(fix.stamp_s)]
        if fixes and not stamps:
            remedy = "export the recorded track with its times, not a planned route"
            raise InputError(f"has {len(fixes)} points, but not one time", remedy, self._path)
        back = [(after, before) for before, after in pairwise(stamps) if after < before]
        if self.problems and len(back) == 1 and 3300 < back[0][1] - back[0][0] <= 3600:
            after, before = map(utc_text, back[0])
            message = (
                f"its times have no zone and go back from {before} to {after}: local time at the end of summer"
            )
            raise InputError(message, "export the track in UTC, or with its zone", self._path)


def _plain(name: str) -> str:
    name = re.sub(r"\(.*?\)|\[.*?\]|°", "", name.lower().strip().strip("\"'%# "))
    name = re.sub(r"[\s./-]+", "_", name.strip()).strip("_")
    return re.sub(r"_(deg|degrees|m|dd|s|ms|us|ns)$", "", name)


def _split(line: str, delimiter: str) -> list[str]:
    return line.split() if delimiter == " " else next(csv.reader([line], delimiter=delimiter), [])


class _Table(NamedTuple):
    """Columns of a table.

    :param header: number of the line with their names
    :param columns: index of each column, -1 without one
    :param sides: letters of the hemispheres that the header states
    :param scale: of its times: ``GPS``, ``UTC``, or empty
    """

    delimiter: str
    header: int
    columns: dict[str, int]
    sides: dict[str, str]
    names: Sequence[str]
    scale: str
    rtklib: bool


def _table(line: str, delimiter: str, number: int, path: Path) -> _Table | None:
    """Columns that a line names, ``None`` if it is no header."""
    rtklib, blanks = line.startswith("%") and "latitude(" in line, delimiter == " "
    given = _split(re.sub(r"\(.*?\)", "", line.lstrip("% ")) if blanks else line, delimiter)
    names = [_plain(name) for name in given]
    columns = {key: next((names.index(one) for one in known if one in names), -1) for key, known in _KNOWN.items()}
    bare = [re.sub(r"_[nsew]$", "", name) for name in names]
    for key in ("lat", "lon"):
        known = _KNOWN[key]
        same = [at for at, name in enumerate(bare) if name in known]
        same = same or [at for at, name in enumerate(bare) if name.endswith((f"_{known[0]}", f"_{known[1]}"))]
        columns[key] = same[0] if same else -1
        if len(same) > 1:
            several = ", ".join(given[at].strip() for at in same)
            raise InputError(f"has several columns of the {known[0]}: {several}", "rename those not meant", path)
    if columns["lat"] < 0 or columns["lon"] < 0:
        return None
    if (parts := next(filter(_PARTS.fullmatch, names), "")) or (rtklib and "(d'" in line):
        raise InputError(f"has degrees and minutes in columns of their own {parts}".rstrip(), _DEGREES, path)
    if rtklib and "q" in names:
        columns["quality"] = names.index("q")
    if columns["state"] < 0:
        columns["state"] = next((at for at, name in enumerate(names) if name.endswith("_status_status")), -1)
    sides = {key: _side(given[columns[key]]) for key in ("lat", "lon")}
    its = [names[at] for at in (columns["time"], columns["date"]) if at >= 0]
    scale = "GPS" if "gpst" in its else "UTC" if any("utc" in name for name in its) else ""
    if rtklib and blanks:  # date and time are two fields, one name
        columns = {key: at + (at > 0) for key, at in columns.items()} | {"date": 0, "time": 1}
        names = ["", *names]
    return _Table(delimiter, number, columns, sides, names, scale, rtklib)


def _side(name: str) -> str:
    """Letter of the hemisphere in the name of a column; empty without one."""
    found = re.search(
        r"(?:lat|lon|lng)[a-z]*[^a-z].*?(?<![a-z])(north|south|east|west|[nsew])(?![a-z])", name.lower()
    )
    return found[1][0].upper() if found else ""


def _letter_columns(rows: Sequence[tuple[int, list[str]]], names: Sequence[str]) -> dict[str, int]:
    """Columns whose fields are letters of hemispheres."""
    found: dict[str, int] = {}
    for at, name in enumerate(names):
        letters = {cells[at].strip().upper() for _, cells in rows if at < len(cells)} - {""}
        # Directions of travel have these letters, too.
        named = len(letters) == 1 or re.search(r"^(n_?s|e_?w)|lat|lon|lng|hemi", name)
        for key, sides in (("lat", {"N", "S"}), ("lon", {"E", "W"})):
            if letters and letters <= sides and named:
                found.setdefault(key, at)
    return found if "lon" in found else {}


def _read_table(path: Path, table: _Table, lines: Sequence[bytes]) -> tuple[list[Fix], list[Problem]]:
    columns = table.columns
    if columns["time"] < 0 and columns["date"] < 0:
        remedy = "name the times 'time' or 'timestamp' in the header, as 2026-05-14T09:00:10Z"
        raise InputError("has latitudes and longitudes, but no column of times", remedy, path)
    decoded = ((number, decode_line(raw)) for number, raw in enumerate(lines[table.header :], table.header + 1))
    rows = [
        (number, _split(line, table.delimiter))
        for number, line in decoded
        if line.strip() and not line.lstrip().startswith(("%", "#"))
    ]
    letters = _letter_columns(rows, table.names)
    texts = [
        (number, cells, {key: cells[at].strip() if 0 <= at < len(cells) else "" for key, at in columns.items()})
        for number, cells in rows
    ]
    fixes, times = [], _Times(path, _time_formats([_time(text) for _, _, text in texts], path))
    shift_s = _LEAP_S * (table.scale == "GPS")
    for number, cells, text in texts:
        if any(cell.strip() for cell in cells[len(table.names) :]):
            remedy = "give each column a name; write decimal points, or semicolons between the columns"
            message = f"has {len(cells)} fields, the header names {len(table.names)}"
            raise InputError([Mistake(message, remedy, path, number)])
        if re.fullmatch(r"\d{3,4}", text["date"]) and (of_week_s := read_number(text["time"])) is not None:
            stamp_s = _GPS_EPOCH_S + 7 * DAY_S * int(text["date"]) + of_week_s - shift_s
        else:
            stamp_s = times.stamp_s(_time(text), number, bool(table.scale)) - shift_s
        sides = {key: cells[at].strip() if 0 <= (at := letters.get(key, -1)) < len(cells) else side
                 for key, side in table.sides.items()}  # fmt: skip
        fixes.append(_fix_of_row(stamp_s, text, sides, table, path, number))
    times.check(fixes)
    if table.scale == "GPS":
        message = f"the times are GPS time: {_LEAP_S:g} leap seconds are taken off for UTC"
        times.problems.append(Problem(Kind.ASSUMED_TIME, Mistake(message, "", path)))
    return fixes, times.problems


def _fix_of_row(
    stamp_s: float, text: Mapping[str, str], sides: Mapping[str, str], table: _Table, path: Path, line: int
) -> Fix:
    points = {
        key: text[key].replace(",", ".") if table.delimiter == ";" else text[key] for key in ("lat", "lon", "alt")
    }
    degrees: dict[str, float | None] = {}
    for key, name, limit in (("lat", "latitude", 90.0), ("lon", "longitude", 360.0)):
        said, side = points[key], sides[key]
        value = read_coordinate(f"{said} {side}" if side and said[-1:].upper() not in "NSEW" else said)
        if said and (value is None or abs(value) > limit):
            packed = read_coordinate(f"{said} {side}".strip(), packed=True)
            known = packed is not None and abs(packed) <= limit
            also = f"; read as degrees and minutes, as NMEA writes them, it is {packed:.5f}" if known else ""
            raise InputError([Mistake(f"{text[key][:40]!r} is no {name} in degrees", _DEGREES + also, path, line)])
        degrees[key] = value
    state, quality = text["state"].lower(), read_number(text["quality"])
    if quality is not None and table.rtklib:
        quality = _GGA_OF_RTKLIB.get(int(quality), -1)
    status = None if quality is None else STATUS_OF_QUALITY.get(int(quality))
    if quality is not None and status is None:
        why = NoPlace.QUALITY_UNKNOWN if quality else NoPlace.NO_FIX
        return Fix.without_place(stamp_s, why, f"quality {text['quality']}")
    if state in _NO_FIX or (state == "0" and table.names[table.columns["state"]] in _ZERO_IS_NO_FIX):
        return Fix.without_place(stamp_s, NoPlace.NO_FIX, f"{text['state']!r}")
    rms_m, north_m, east_m = (read_number(text[key]) for key in ("hrms", "sdn", "sde"))
    if rms_m is None and north_m is not None and east_m is not None:
        rms_m = math.hypot(north_m, east_m)
    sd_m = NAN if rms_m is None else rms_m / math.sqrt(2)
    fix = _fix(stamp_s, degrees["lat"], degrees["lon"], read_number(points["alt"]), sd_m)
    if status is None or quality is None or fix.no_place is not None:
        return fix
    return replace(fix, status=status, quality=int(quality))


def _time(text: Mapping[str, str]) -> str:
    """Date and time of a row."""
    date, time = text["date"], text["time"]
    return time if re.search(r"\d[-/.]\d+[-/.]\d", time) else " ".join(filter(None, (date, time)))


def _time_formats(texts: Sequence[str], path: Path) -> list[str]:
    """Format of times that are not in ISO 8601, if all of a file have one."""
    texts = [text for text in texts if text]
    if not texts or not re.match(r"\d{1,2}[-/. ][\dA-Za-z]{1,3}[-/. ]\d{2,4}\b", texts[0]):
        return []
    readings = {tuple(read_time(text, [one]) for text in texts): one for one in likely_time_formats(texts[0])}
    fitting = {one: times for times, one in readings.items() if None not in times}
    if len(fitting) < 2:
        return list(fitting)
    both = " or ".join(utc_text(times[0] or 0.0)[:10] for times in list(fitting.values())[:2])
    message = f"dates such as {texts[0][:40]!r} have two meanings: {both}"
    raise InputError(message, "write times as 2026-05-14T09:00:10Z", path)
