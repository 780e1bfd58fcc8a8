# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Positions of a receiver from a file, known by its content: NMEA, GPX, or a table (CSV) of time, lat and lon."""

from __future__ import annotations

import csv
import math
import re
from collections.abc import Sequence
from itertools import pairwise
from pathlib import Path
from xml.etree import ElementTree

from soilmoist_ros.foundation import InputError, Mistake
from soilmoist_ros.sensing.formats.log_values import decode_line, read_number, read_time
from soilmoist_ros.sensing.gnss import Fix, FixStatus, NoPlace, is_place
from soilmoist_ros.sensing.lines import read_lines
from soilmoist_ros.sensing.position.nmea import parse_nmea
from soilmoist_ros.sensing.problems import Kind, Problem
from soilmoist_ros.sensing.records import NAN, Position, utc_text

_HEAD = 50  # number of lines in which the kind of a file is searched
_HEADERS = ("time,lat,lon,alt", "time,lat,lon")
_TABLE = (
    "give NMEA or GPX, or a CSV file with the columns time,lat,lon,alt alone: times as 2026-05-14T09:00:10Z, "
    "decimal degrees as 53.2680 and -0.5245; RTKLIB writes NMEA (rnx2rtkp -n), GPSBabel reads many tables (unicsv)"
)
_RTKLIB = re.compile(
    r"^% *(program +:|(GPST|UTC|JST)\b)"
    r"|^ *\d{4}(/\d\d/\d\d +\d\d:\d\d:\d\d(\.\d*)?| +\d{1,6}\.\d+)( +-?\d+\.\d+){3} +\d ",
    re.MULTILINE,
)
"""A line of the header of a solution, or of the solution without it: its times may be GPS time."""


def read_positions(path: Path | str, log_s: tuple[float, float] | None = None) -> tuple[list[Fix], list[Problem]]:
    """Read the positions and problems of a file.

    :param log_s: first and last time of the log for which the positions are [s since 1970 UTC], if known
    :raises InputError: if it has no positions that can be read
    """
    path = Path(path)
    lines, _ = read_lines(path, binary=True)
    text = "\n".join(map(decode_line, lines[:_HEAD]))
    if "<gpx" in text.lower():
        return _read_gpx(path)
    if "<kml" in text.lower():
        raise InputError("is a KML file, which is not read", "export the track with its times as GPX", path)
    if _RTKLIB.search(text):
        raise InputError("is a solution of RTKLIB, which is not read", _TABLE, path)
    first = next((line for line in text.splitlines() if line.strip() and not line.startswith("sep=")), "")
    if (header := re.sub(r'[\s"]', "", first.lower())) in _HEADERS:
        return _read_table(path, lines, len(header.split(",")))
    names = [name.strip(' "') for name in re.split("[;\t,]", first)]
    named = all(re.fullmatch(r"[^<>{}$*\d][^<>{}$*]{0,60}", name) for name in names if name)
    if "$" not in text and named and len(names) > 1:
        apart = "" if "," in first else ", which no commas separate"
        raise InputError(f"is a table with the columns {', '.join(names)[:200]}{apart}", _TABLE, path)
    return parse_nmea(lines, path, log_s)


def _read_table(path: Path, lines: Sequence[bytes], width: int) -> tuple[list[Fix], list[Problem]]:
    fixes, times = [], _Times(path)
    numbered = [(number, line) for number, line in enumerate(map(decode_line, lines), 1) if line.strip()]
    for number, line in [one for one in numbered if not one[1].startswith("sep=")][1:]:  # after the names
        cells = next(csv.reader([line]))
        if len(cells) != width:
            message = f"has {len(cells)} fields, the header names {width}"
            raise InputError([Mistake(message, "write decimal points, and commas between fields", path, number)])
        latitude, longitude = read_number(cells[1]), read_number(cells[2])
        for name, cell, value, limit in (
            ("latitude", cells[1], latitude, 90),
            ("longitude", cells[2], longitude, 360),
        ):
            if cell.strip() and (value is None or abs(value) > limit):
                raise InputError([Mistake(f"{cell[:40]!r} is no {name} in degrees", _TABLE, path, number)])
        altitude = read_number(cells[3]) if width > 3 else None
        fixes.append(_fix(times.stamp_s(cells[0], number), latitude, longitude, altitude))
    times.check(fixes)
    return fixes, times.problems


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


def _fix(stamp_s: float, latitude: float | None, longitude: float | None, altitude: float | None) -> Fix:
    if latitude is None or longitude is None or not is_place(latitude, (longitude + 180) % 360 - 180):
        return Fix.without_place(stamp_s, NoPlace.NO_COORDINATES, f"latitude {latitude}, longitude {longitude}")
    longitude = longitude - 360.0 if longitude > 180 else longitude
    return Fix(stamp_s, Position(latitude, longitude, NAN if altitude is None else altitude), FixStatus.FIX)


class _Times:
    """Times of a file; notes once if they have no zone."""

    def __init__(self, path: Path) -> None:
        self._path = path
        self.problems: list[Problem] = []

    def stamp_s(self, text: str, line: int) -> float:
        """Time of a text [s since 1970 UTC], NaN if it is empty.

        :raises InputError: if it cannot be understood
        """
        said = text.strip()
        if not said:
            return NAN
        number = read_number(said)
        if number is not None and number > 1e8:
            return float(number / 10 ** (3 * max(0, math.floor(math.log10(number) / 3) - 3)))  # s, ms, us or ns
        stamp_s = read_time(said, ("iso8601",))
        if stamp_s is None:
            remedy = "write times as 2026-05-14T09:00:10Z, or as seconds since 1970"
            raise InputError([Mistake(f"{text[:40]!r} is no time that can be read", remedy, self._path, line)])
        if not self.problems and not re.search(r"(Z|[+-]\d\d:?\d\d)$", said):
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
