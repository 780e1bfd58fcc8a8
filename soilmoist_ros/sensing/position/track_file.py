# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Positions of a receiver from a file, known by its content: NMEA, GPX, a table (CSV), or a solution of RTKLIB."""

from __future__ import annotations

import csv
import math
import re
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from itertools import pairwise
from pathlib import Path
from typing import NamedTuple
from xml.etree import ElementTree

from soilmoist_ros.foundation import DAY_S, InputError, Mistake
from soilmoist_ros.sensing.formats.log_values import (
    Decimal,
    decode_line,
    likely_time_formats,
    read_coordinate,
    read_number,
    read_time,
)
from soilmoist_ros.sensing.gnss import STATUS_OF_QUALITY, Fix, FixStatus, NoPlace, is_place, utc_text
from soilmoist_ros.sensing.lines import read_lines
from soilmoist_ros.sensing.position.nmea import parse_nmea
from soilmoist_ros.sensing.problems import Kind, Problem
from soilmoist_ros.sensing.records import NAN, Position

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
_PARTS = {"_min": ("_min", "_minutes", "_mins"), "_sec": ("_sec", "_seconds", "_secs")}
_RTKLIB_HEADER = (
    "%  GPST latitude(deg) longitude(deg) height(m) Q ns sdn(m) sde(m) sdu(m) sdne(m) sdeu(m) sdun(m) age(s) ratio"
)


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
        raise InputError("is a KML file, which is not read", "export the track with its times as GPX or CSV", path)
    if b"$" not in head:
        if (table := _table(lines, path)) is not None:
            return _read_table(path, table, lines, log_s)
        if (why := _why_no_table("\n".join(map(decode_line, lines[:_HEAD])))) is not None:
            raise InputError(*why, path)
    return parse_nmea(lines, path, log_s)


def _why_no_table(head: str) -> tuple[str, str] | None:
    """Reason why a table has no latitude and longitude, and what to do; ``None`` for what is no table."""
    if "-ecef(m)" in head or "e-baseline(m)" in head:
        what = "from the centre of the earth" if "-ecef(m)" in head else "relative to a base"
        return f"has coordinates {what}, not latitude and longitude", "let RTKLIB write Lat/Lon/Height"
    if re.search(
        r"^\s*\d{4}(/\d\d/\d\d +\d\d:\d\d:\d\d(\.\d*)?| +\d{1,6}\.\d+)( +-?\d+\.\d+){3} +\d ", head, re.M
    ):
        message = (
            "looks like a solution of RTKLIB without its header: GPS time or UTC, and degrees, are not stated"
        )
        return message, f"put the header in front, with GPST or UTC: {_RTKLIB_HEADER!r}"
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
    _require_times(fixes, path)
    zones.require_one_shift(fixes)
    return fixes, zones.problems


def _fix(
    stamp_s: float, latitude: float | None, longitude: float | None, altitude: float | None, sd_m: float = NAN
) -> Fix:
    if latitude is None or longitude is None or not is_place(latitude, (longitude + 180) % 360 - 180):
        return Fix.without_place(stamp_s, NoPlace.NO_COORDINATES, f"latitude {latitude}, longitude {longitude}")
    longitude = longitude - 360.0 if longitude > 180 else longitude
    return Fix(stamp_s, Position(latitude, longitude, NAN if altitude is None else altitude, sd_m), FixStatus.FIX)


def _require_times(fixes: Sequence[Fix], path: Path) -> None:
    """Check that a position has a time."""
    if fixes and all(math.isnan(fix.stamp_s) for fix in fixes):
        remedy = "export the recorded track with its times, not a planned route"
        raise InputError(f"has {len(fixes)} points, but not one time", remedy, path)


class _Zones:
    """Times of a file; notes once if they have no zone.

    :param formats: formats of its times, other than ISO 8601
    """

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

    def require_one_shift(self, fixes: Sequence[Fix]) -> None:
        """Check that times without a zone do not go back by an hour, as local time does in autumn.

        :raises InputError: if they do: one shift cannot correct them
        """
        stamps = [fix.stamp_s for fix in fixes if math.isfinite(fix.stamp_s)]
        back = [(after, before) for before, after in pairwise(stamps) if after < before]
        if not self.problems or len(back) != 1 or not 3300 < back[0][1] - back[0][0] <= 3600:
            return
        after, before = (utc_text(stamp_s) for stamp_s in back[0])
        message = (
            f"its times have no zone and go back from {before} to {after}: local time at the end of summer time"
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
    :param names: names of the fields of a row
    :param scale: of its times: ``GPS``, ``UTC``, or empty
    :param rtklib: whether it is a solution of RTKLIB
    :param zero_is_no_fix: whether 0 in the column of states means that there is no fix
    """

    delimiter: str
    header: int
    columns: dict[str, int]
    sides: dict[str, str]
    names: Sequence[str]
    scale: str
    rtklib: bool
    zero_is_no_fix: bool


def _table(lines: Sequence[bytes], path: Path) -> _Table | None:
    """Columns of a table, ``None`` without a header."""
    for number, raw in enumerate(lines[:_HEAD], 1):
        for delimiter in ";\t, ":
            if (table := _columns(decode_line(raw), delimiter, number, path)) is not None:
                return table
    return None


def _columns(line: str, delimiter: str, number: int, path: Path) -> _Table | None:
    """Columns that a line names, ``None`` if it is no header."""
    rtklib, blanks = line.startswith("%") and "latitude(" in line, delimiter == " "
    in_parts = rtklib and "(d'" in line  # degrees, minutes and seconds are three fields, one name
    given = _split(re.sub(r"\(.*?\)", "", line.lstrip("% ")) if blanks else line, delimiter)
    if in_parts:
        given = [
            one for name in given for one in ([name, "", ""] if name[:3].lower() in ("lat", "lon") else [name])
        ]
    names = [_plain(name) for name in given]
    found = {
        key: next((names.index(name) for name in known if name in names), -1) for key, known in _KNOWN.items()
    }
    for key in ("lat", "lon"):
        known, bare = _KNOWN[key], [re.sub(r"_[nsew]$", "", name) for name in names]
        same = [at for at, name in enumerate(bare) if name in known]
        same = same or [at for at, name in enumerate(bare) if name.endswith((f"_{known[0]}", f"_{known[1]}"))]
        found[key] = same[0] if same else -1
        if len(same) > 1:
            several = ", ".join(given[at].strip() for at in same)
            raise InputError(f"has several columns of the {known[0]}: {several}", "rename those not meant", path)
    if found["lat"] < 0 or found["lon"] < 0:
        return None
    if rtklib and "q" in names:
        found["quality"] = names.index("q")
    if found["state"] < 0:
        found["state"] = next((at for at, name in enumerate(names) if name.endswith("_status_status")), -1)
    zero = found["state"] >= 0 and names[found["state"]] in _ZERO_IS_NO_FIX
    sides = {key: _side(given[found[key]]) for key in ("lat", "lon")}
    for key, stems in (("lat", _KNOWN["lat"][:2]), ("lon", _KNOWN["lon"][:4])):
        for nth, (part, endings) in enumerate(_PARTS.items(), 1):
            at = (names.index(f"{a}{b}") for a in stems for b in endings if f"{a}{b}" in names)
            found[key + part] = next(at, found[key] + nth if in_parts else -1)
    its = [names[at] for at in (found["time"], found["date"]) if at >= 0]
    scale = "GPS" if "gpst" in its else "UTC" if any("utc" in name for name in its) else ""
    if rtklib and blanks:  # date and time are two fields, one name
        found = {key: at + (at > 0) for key, at in found.items()} | {"date": 0, "time": 1}
        names = ["", *names]
    return _Table(delimiter, number, found, sides, names, scale, rtklib, zero)


def _side(name: str) -> str:
    """Letter of the hemisphere in the name of a column; empty without one."""
    found = re.search(
        r"(?:lat|lon|lng)[a-z]*[^a-z].*?(?<![a-z])(north|south|east|west|[nsew])(?![a-z])", name.lower()
    )
    return found[1][0].upper() if found else ""


def _letter_columns(rows: Sequence[tuple[int, list[str]]], table: _Table) -> dict[str, int]:
    """Columns whose fields are letters of hemispheres."""
    found: dict[str, int] = {}
    for at, name in enumerate(table.names):
        letters = {cells[at].strip().upper() for _, cells in rows if at < len(cells)} - {""}
        for key, sides in (("lat", {"N", "S"}), ("lon", {"E", "W"})):
            named = re.search(
                r"^(n_?s|e_?w)|lat|lon|lng|hemi", name
            )  # directions of travel have these letters, too
            if letters and letters <= sides and (named or len(letters) == 1):
                found.setdefault(key, at)
    return found if "lon" in found else {}


def _read_table(
    path: Path, table: _Table, lines: Sequence[bytes], log_s: tuple[float, float] | None
) -> tuple[list[Fix], list[Problem]]:
    columns, scale = table.columns, table.scale
    if columns["time"] < 0 and columns["date"] < 0:
        raise InputError(
            "has latitudes and longitudes, but no column of times",
            "name the times 'time' or 'timestamp' in the header, as 2026-05-14T09:00:10Z",
            path,
        )
    rows = list(_rows(lines[table.header :], table.header, table.delimiter))
    letters = _letter_columns(rows, table)
    formats, chosen = _time_formats([_time(cells, columns) for _, cells in rows], log_s, path)
    fixes, zones = [], _Zones(path, formats)
    shift_s = _LEAP_S * (scale == "GPS")
    for number, cells in rows:
        if any(cell.strip() for cell in cells[len(table.names) :]):
            remedy = "give each column a name; write decimal points, or semicolons between the columns"
            message = f"has {len(cells)} fields, the header names {len(table.names)}"
            raise InputError([Mistake(message, remedy, path, number)])
        text = {key: cells[at].strip() if 0 <= at < len(cells) else "" for key, at in columns.items()}
        if re.fullmatch(r"\d{3,4}", text["date"]) and (of_week_s := read_number(text["time"])) is not None:
            stamp_s = _GPS_EPOCH_S + 7 * DAY_S * int(text["date"]) + of_week_s - shift_s
        else:
            stamp_s = zones.stamp_s(_time(cells, columns), number, bool(scale)) - shift_s
        decimal: Decimal = "comma" if table.delimiter == ";" and "," in text["lat"] + text["lon"] else "auto"
        latitude, longitude = (
            _coordinate(key, text, cells, table, letters, decimal, path, number) for key in ("lat", "lon")
        )
        altitude = read_number(text["alt"].replace(",", ".") if table.delimiter == ";" else text["alt"])
        quality = read_number(text["quality"])
        if quality is not None and table.rtklib:
            quality = _GGA_OF_RTKLIB.get(int(quality), -1)
        status = None if quality is None else STATUS_OF_QUALITY.get(int(quality))
        state = text["state"].lower()
        if quality is not None and status is None:
            why = NoPlace.QUALITY_UNKNOWN if quality else NoPlace.NO_FIX
            fixes.append(Fix.without_place(stamp_s, why, f"quality {text['quality']}"))
            continue
        if state in _NO_FIX or (state == "0" and table.zero_is_no_fix):
            fixes.append(Fix.without_place(stamp_s, NoPlace.NO_FIX, f"{text['state']!r}"))
            continue
        sds = [read_number(text[key]) for key in ("sdn", "sde")]
        sd_m = math.hypot(sds[0], sds[1]) / math.sqrt(2) if sds[0] is not None and sds[1] is not None else NAN
        if (rms_m := read_number(text["hrms"])) is not None:
            sd_m = rms_m / math.sqrt(2)
        fix = _fix(stamp_s, latitude, longitude, altitude, sd_m)
        if quality is not None and status is not None and fix.no_place is None:
            fix = replace(fix, status=status, quality=int(quality))
        fixes.append(fix)
    _require_times(fixes, path)
    zones.require_one_shift(fixes)
    if scale == "GPS":
        message = f"the times are GPS time: {_LEAP_S:g} leap seconds are taken off for UTC"
        zones.problems.append(Problem(Kind.ASSUMED_TIME, Mistake(message, "", path)))
    return fixes, [*chosen, *zones.problems]


def _coordinate(
    key: str,
    text: Mapping[str, str],
    cells: Sequence[str],
    table: _Table,
    letters: Mapping[str, int],
    decimal: Decimal,
    path: Path,
    line: int,
) -> float | None:
    """Latitude or longitude of a row [deg], ``None`` if it is empty."""
    if not text[key]:
        return None
    name, limit = ("latitude", 90.0) if key == "lat" else ("longitude", 360.0)
    at = letters.get(key, -1)
    side = cells[at].strip() if 0 <= at < len(cells) else table.sides[key]
    said = " ".join(filter(None, (text[key], text[f"{key}_min"], text[f"{key}_sec"])))
    value = read_coordinate(
        f"{said} {side}" if side and said[-1:].upper() not in "NSEW" else said, decimal=decimal
    )
    if value is None or abs(value) > limit:
        remedy = "give decimal degrees, such as 53.2680 and -0.5245"
        packed = read_coordinate(f"{said} {side}".strip(), packed=True, decimal=decimal)
        if packed is not None and abs(packed) <= limit:
            remedy += f"; read as degrees and minutes, as NMEA writes them, it is {packed:.5f}"
        raise InputError([Mistake(f"{said[:40]!r} is no {name} in degrees", remedy, path, line)])
    return value


def _time(cells: Sequence[str], columns: Mapping[str, int]) -> str:
    """Date and time of a row."""
    date, time = (
        cells[columns[key]].strip() if 0 <= columns[key] < len(cells) else "" for key in ("date", "time")
    )
    return time if re.search(r"\d[-/.]\d+[-/.]\d", time) else " ".join(filter(None, (date, time)))


def _time_formats(
    texts: Sequence[str], log_s: tuple[float, float] | None, path: Path
) -> tuple[list[str], list[Problem]]:
    """Format of times that are not in ISO 8601, if all of a file have one, and a note if the log decided it."""
    texts = [text for text in texts if text]
    if not texts or not re.match(r"\d{1,2}[-/. ][\dA-Za-z]{1,3}[-/. ]\d{2,4}\b", texts[0]):
        return [], []
    readings = {tuple(read_time(text, [one]) for text in texts): one for one in likely_time_formats(texts[0])}
    fitting = [one for times, one in readings.items() if None not in times]
    if len(fitting) < 2:
        return fitting, []
    if log_s is not None:
        near = [
            one
            for one in fitting
            if any(log_s[0] - DAY_S <= (read_time(text, [one]) or 0.0) <= log_s[1] + DAY_S for text in texts)
        ]
        if len(near) == 1:
            words = "day before month" if near[0].index("%d") < near[0].index("%m") else "month before day"
            message = f"dates such as {texts[0][:40]!r} are read with the {words}, which is the date of the log"
            return near, [Problem(Kind.ASSUMED_TIME, Mistake(message, "", path))]
    both = " or ".join(f"{utc_text(read_time(texts[0], [one]) or 0.0)[:10]}" for one in fitting[:2])
    message = f"dates such as {texts[0][:40]!r} have two meanings: {both}"
    raise InputError(message, "write times as 2026-05-14T09:00:10Z", path)


def _rows(lines: Sequence[bytes], header: int, delimiter: str) -> Iterator[tuple[int, list[str]]]:
    for number, raw in enumerate(lines, header + 1):
        line = decode_line(raw)
        if line.strip() and not line.lstrip().startswith(("%", "#")):
            yield number, _split(line, delimiter)
