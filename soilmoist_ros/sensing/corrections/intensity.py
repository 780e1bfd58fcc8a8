# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Incoming cosmic-ray intensity: from a file of neutron monitors, and its scaling to the site.

A monitor and a probe respond differently to a change of the cosmic rays, depending on cutoff rigidity and
atmospheric depth. With the rate C of the monitor and its reference C0 the correction factor is
``1 / (1 + k (C / C0 - 1))``.
"""

from __future__ import annotations

import math
import re
from dataclasses import dataclass
from datetime import UTC, datetime
from functools import cache, lru_cache
from pathlib import Path
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from soilmoist_ros.foundation import InputError, Mistake, read_lines
from soilmoist_ros.sensing.corrections.factors import atmospheric_depth_gcm2
from soilmoist_ros.sensing.formats.log_values import read_number

Scaling = Literal["none", "hawdon2014", "mcjannet2023"]
TABLE = Path(__file__).with_name("cutoff_rigidity.csv")
MAX_GAP_S = 6 * 3600.0
_KEY_AND_VALUE = re.compile(r"#\s*([A-Z][A-Z .]{2,20}):\s*(.*?)\s*")
_DURATION = re.compile(r"(\d+)\s*(min|hour|day)")
_SECONDS = {"min": 60.0, "hour": 3600.0, "day": 86_400.0}
_MISSING = ("", "null", "nan", "na", "-")
_NOT_CORRECTED = re.compile(r"uncorr|press_|pressure_mbar|\b(R|1H)(COR+(?!\w*_E)|PRESS)", re.IGNORECASE)
"""Data types of NMDB that are not corrected for pressure and efficiency, such as RUNCORR; RCORR_E is."""
_CORRECTED = "export the rates 'corrected for pressure and efficiency' instead"
_EXPECTED = "export one station from nmdb.eu, or write rows such as '2018-05-01 14:00:00;151.2' (UTC)"


@dataclass(frozen=True)
class CosmicPlace:
    """Vertical cutoff rigidity [GV] and atmospheric depth [g/cm^2] of a place."""

    cutoff_rigidity_gv: float
    depth_gcm2: float


MONITORS: dict[str, tuple[str, float, float, float]] = {
    code: (name, float(latitude), float(longitude), float(altitude))
    for line in TABLE.with_name("neutron_monitors.csv").read_text(encoding="ascii").splitlines()[1:]
    for code, name, latitude, longitude, altitude in [line.split(",")]
}
"""Neutron monitors of the database NMDB (www.nmdb.eu): name, latitude, longitude [deg] and altitude [m]."""


def cosmic_place(
    latitude_deg: float, longitude_deg: float, altitude_m: float, rigidity_gv: float | None = None
) -> CosmicPlace:
    """Cutoff rigidity and atmospheric depth of a place.

    :raises ValueError: if a value is out of range
    """
    if rigidity_gv is None:
        rigidity_gv = cutoff_rigidity_gv(latitude_deg, longitude_deg)
    return CosmicPlace(rigidity_gv, atmospheric_depth_gcm2(latitude_deg, altitude_m))


def intensity_scale(scaling: Scaling, site: CosmicPlace, monitor: CosmicPlace) -> float:
    """Relative change of the intensity at the site for a relative change of 1 at the monitor, k [-].

    * ``none``: 1 (Zreda et al. 2012, Hydrology and Earth System Sciences 16:4079-4099)
    * ``hawdon2014``: ``1 - 0.075 (Rc_site - Rc_monitor)`` (Hawdon et al. 2014, Water Resources Research
      50:5029-5043)
    * ``mcjannet2023``: ``tau(site) / tau(monitor)`` (McJannet & Desilets 2023, Water Resources Research
      59:e2022WR033889), see :func:`_tau`

    :raises ValueError: if the scale is not positive
    """
    scale = 1.0
    if scaling == "hawdon2014":
        scale = 1 - 0.075 * (site.cutoff_rigidity_gv - monitor.cutoff_rigidity_gv)
    elif scaling == "mcjannet2023":
        scale = _tau(site) / _tau(monitor)
    if not scale > 0:
        raise ValueError(f"the intensity would be scaled by {scale:.2f}: the cutoff rigidities differ too much")
    return scale


def _tau(place: CosmicPlace) -> float:
    """Response of a neutron monitor to solar modulation, in proportion (McJannet & Desilets 2023) [-]."""
    depth = place.depth_gcm2
    # At low rigidity the atmosphere cuts the spectrum off; the formula is flat there.
    rigidity = max(place.cutoff_rigidity_gv, 0.01)
    return (-0.0009 * depth + 1.7699) * (
        1 - math.exp(-(0.0064 * depth + 1.8855) * rigidity ** (0.000013 * depth - 1.2237))
    )


# Vertical cutoff rigidity of a place, from a table of the world -------------------------------------------------


@lru_cache(maxsize=256)
def cutoff_rigidity_gv(latitude_deg: float, longitude_deg: float) -> float:
    """Effective vertical cutoff rigidity [GV], bilinear in the table.

    The table has one value per 5 x 10 degrees, for the field of 2020. It was computed by tracing particles through
    the International Geomagnetic Reference Field, IGRF-14 (``test/equipment/cutoff_rigidity_table.py`` of commit
    14ce8358). Between its values the error is about 0.1 GV, at most 0.3. Published values of other years differ by
    up to 0.5 GV.

    >>> round(cutoff_rigidity_gv(51.5, 0.0), 1)  # London
    3.0

    :raises ValueError: if the latitude is not within -90..90
    """
    if not abs(latitude_deg) <= 90:
        raise ValueError(f"the latitude must be within -90..90 degrees, got {latitude_deg}")
    latitudes, longitudes, table = _table()
    row = min(int(np.searchsorted(latitudes, latitude_deg, side="right")) - 1, len(latitudes) - 2)
    north = (latitude_deg - latitudes[row]) / (latitudes[row + 1] - latitudes[row])
    step = longitudes[1] - longitudes[0]
    turns, east = divmod(((longitude_deg - longitudes[0]) % 360) / step, 1)
    columns = [int(turns) % len(longitudes), (int(turns) + 1) % len(longitudes)]
    low, high = table[row : row + 2, columns] @ np.array([1 - east, east])
    return float(low + north * (high - low))


@cache
def _table() -> tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.float64]]:
    """Latitudes, ascending, longitudes and rigidities [GV]."""
    header, *rows = TABLE.read_text(encoding="ascii").splitlines()
    values = np.array([[float(cell) for cell in row.split(",")] for row in rows])[::-1]
    return values[:, 0], np.array([float(cell) for cell in header.split(",")[1:]]), values[:, 1:]


# Incoming cosmic-ray intensity from a file of neutron monitors, such as an export of the database NMDB ----------


@dataclass(frozen=True)
class NeutronMonitor:
    """A time series of incoming intensity.

    :param stamp_s: middle of each interval [s since 1970-01-01 UTC], shape (n,), ascending
    :param rate: neutron-monitor rate, any unit, shape (n,), > 0
    :param interval_s: duration of an interval [s], 0 if the rates are momentary
    :param max_gap_s: maximum time between neighbours of a rate that is interpolated [s]
    :param station: code of the station; empty if the file does not give it
    """

    stamp_s: NDArray[np.float64]
    rate: NDArray[np.float64]
    interval_s: float = 0.0
    max_gap_s: float = MAX_GAP_S
    station: str = ""

    def at(self, stamp_s: float) -> float | None:
        """Rate at a time; ``None`` outside the series or in a gap that is too long."""
        after = int(np.searchsorted(self.stamp_s, stamp_s))
        early_s = self.interval_s / 2 if after == 0 else 0.0
        if after < len(self.stamp_s) and self.stamp_s[after] - stamp_s <= early_s:
            return float(self.rate[after])
        if after == 0:
            return None
        if after == len(self.stamp_s):
            return float(self.rate[-1]) if stamp_s - self.stamp_s[-1] <= self.interval_s / 2 else None
        if self.stamp_s[after] - self.stamp_s[after - 1] > max(self.max_gap_s, self.interval_s):
            return None
        return float(np.interp(stamp_s, self.stamp_s, self.rate))

    @property
    def coverage(self) -> str:
        """The time of the series, in words."""
        first, last = (datetime.fromtimestamp(float(stamp), UTC) for stamp in (self.stamp_s[0], self.stamp_s[-1]))
        return f"the neutron monitor, {first:%Y-%m-%d %H:%M} to {last:%Y-%m-%d %H:%M} UTC,"

    def longest_gap_s(self, start_s: float, end_s: float) -> float:
        """Longest time without a rate between two times, the ends of the series included [s]."""
        if not len(self.stamp_s):
            return end_s - start_s
        before, after = self.stamp_s[self.stamp_s <= start_s], self.stamp_s[self.stamp_s >= end_s]
        inside = self.stamp_s[(self.stamp_s > start_s) & (self.stamp_s < end_s)]
        edges = [*(before[-1:] if len(before) else [start_s]), *inside, *(after[:1] if len(after) else [end_s])]
        return float(np.diff(edges).max()) - self.interval_s


def read_neutron_monitor(path: Path, station: str = "", max_gap_s: float = MAX_GAP_S) -> NeutronMonitor:
    """Read an ASCII export of the neutron monitor database NMDB (www.nmdb.eu/nest), or rows of time and rate.

    Times are ISO 8601 (UTC), the separator is ``;`` or ``,``. Rows with an empty or null rate are skipped. In an
    export, times are the beginnings of intervals, whose duration is in its head.

    :param station: code of the station that the file must be of, if it names one; any if empty
    :param max_gap_s: maximum duration of a gap that is interpolated [s]
    :raises InputError: if the file cannot be read, has uncorrected counts, several rates or no positive one, or is
        of another station
    """
    head: dict[str, str] = {}
    rows: list[tuple[int, float, str]] = []
    for number, line in enumerate(read_lines(path, "check 'file' under 'intensity'"), start=1):
        if "no data available" in line.lower():
            raise InputError("says that there are no data", "export another time or station from nmdb.eu", path)
        if match := _KEY_AND_VALUE.fullmatch(line.strip()):
            key, value = match[1].strip(), match[2]
            if key == "STATION" and head.setdefault(key, value) != value:
                what = f"has the stations {head[key]} and {value}, one after the other"
                raise InputError(what, _EXPECTED, path)
            head[key] = value
            continue
        cells = [cell.strip() for cell in re.split("[;,]", line)]
        if line.startswith("#") or not cells[0][:1].isdigit():
            if "start_date_time" in line or len(cells) == 2:  # a header names the station or the data type
                name = re.split(r'[;,\s"]+', line.rstrip(' ;,"\r\n'))[-1]
                key = "STATION" if name.upper() in MONITORS else "DATA TYPE"
                head[key] = head.get(key) or name
            continue
        if (stamp_s := _stamp(cells[0])) is None:
            remedy = "write times as 2018-05-01 14:00 (UTC), as in an export from nmdb.eu"
            raise InputError([Mistake(f"the time {cells[0]!r} cannot be read", remedy, path, number)])
        if len(cells) != 2:
            what = f"the row has {len(cells)} fields, not time and rate: {line.strip()[:60]!r}"
            raise InputError([Mistake(what, _EXPECTED, path, number)])
        rows.append((number, stamp_s, cells[1]))
    if _NOT_CORRECTED.search(head.get("DATA TYPE", "")):
        raise InputError(f"has the data type {head['DATA TYPE']}", _CORRECTED, path)
    of = head.get("STATION", "")
    if station and of and of.casefold() != station.casefold():
        remedy = "correct 'monitor' under 'intensity', or export the file of that station"
        raise InputError(f"is of the station {of}, not of {station}", remedy, path)
    rates: dict[float, float] = {}
    for number, stamp_s, cell in rows:
        if cell.casefold() in _MISSING:
            continue
        rate = read_number(cell) or 0.0
        if not rate > 0:
            remedy = "correct the row, or export counts per second, not relative units"
            remedy = "if it marks a gap, leave the rate empty" if cell in ("0", "-999") else remedy
            raise InputError([Mistake(f"rate {cell!r} is not a positive number", remedy, path, number)])
        rates[stamp_s] = rate
    if not rates:
        raise InputError("has no row of time and rate", _EXPECTED, path)
    interval = _DURATION.search(head.get("AVERAGING", "")) or _DURATION.search(head.get("ORIGINAL RES", ""))
    interval_s = int(interval[1]) * _SECONDS[interval[2]] if interval else 0.0
    stamps = np.array(sorted(rates))
    series = np.array([rates[stamp] for stamp in stamps])
    return NeutronMonitor(stamps + interval_s / 2, series, interval_s, max_gap_s, of)


def _stamp(text: str) -> float | None:
    try:
        time = datetime.fromisoformat(text.replace("Z", "+00:00"))
    except ValueError:
        return None
    # Neutron monitors exist since 1951.
    if not 1950 <= time.year < 2100:
        return None
    return (time if time.tzinfo else time.replace(tzinfo=UTC)).timestamp()
