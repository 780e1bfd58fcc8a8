# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""A simulated GNSS receiver: the NMEA 0183 sentences of an RTK rover."""

from __future__ import annotations

from datetime import UTC, datetime, timedelta

import numpy as np
import pynmea2

from soilmoist_ros.foundation import LocalFrame
from soilmoist_ros.sensing import Position

ALTITUDE_M = 30.0
"""Altitude of every surrogate field above mean sea level [m]."""


class VirtualGnss:
    """A receiver on the robot.

    :param frame: plane of the field
    :param start_s: time at which the simulation begins [s since 1970 UTC]
    :param position_sd_m: noise of each horizontal coordinate [m], >= 0
    :param rng: source of all randomness
    """

    def __init__(self, frame: LocalFrame, start_s: float, position_sd_m: float, rng: np.random.Generator) -> None:
        self._frame = frame
        self._start_s = start_s
        self._sd_m = position_sd_m
        self._rng = rng

    def sentences(self, elapsed_s: float, xy: tuple[float, float], has_fix: bool = True) -> list[str]:
        """Sentences of one epoch.

        :param elapsed_s: time since the start [s]
        :param xy: true position [m]
        :param has_fix: whether the receiver has a position fix
        """
        noise = self._rng.normal(0.0, self._sd_m, 2)  # always drawn: a lost fix must not change later noise
        if not has_fix:
            return sentences_without_fix(self._start_s + elapsed_s)
        latitude, longitude = self._frame.to_geographic(np.array(xy) + noise)[0].tolist()
        return nmea_sentences(self._start_s + elapsed_s, Position(latitude, longitude, ALTITUDE_M, self._sd_m))


def nmea_sentences(stamp_s: float, position: Position) -> list[str]:
    """RMC, GGA and GST of one epoch of an RTK receiver; times are written to 0.01 s.

    :param stamp_s: time of the epoch [s since 1970 UTC]
    :param position: position with its standard deviation
    """
    clock, date = _clock_and_date(stamp_s)
    latitude, north = _degrees_minutes(position.latitude_deg, 2), "N" if position.latitude_deg >= 0 else "S"
    longitude, east = _degrees_minutes(position.longitude_deg, 3), "E" if position.longitude_deg >= 0 else "W"
    place = (latitude, north, longitude, east)
    sd, up = f"{position.horizontal_sd_m:.3f}", f"{2 * position.horizontal_sd_m:.3f}"
    gga = (clock, *place, "4", "18", "0.7", f"{position.altitude_m:.3f}", "M", "48.0", "M", "", "")
    return [
        str(pynmea2.RMC("GN", "RMC", (clock, "A", *place, "", "", date, "", "", "R"))),
        str(pynmea2.GGA("GN", "GGA", gga)),
        str(pynmea2.GST("GN", "GST", (clock, sd, sd, sd, "0.0", sd, sd, up))),
    ]


def sentences_without_fix(stamp_s: float) -> list[str]:
    """RMC and GGA of an epoch with a time but no position.

    :param stamp_s: time of the epoch [s since 1970 UTC]
    """
    clock, date = _clock_and_date(stamp_s)
    nowhere = ("", "", "", "")
    return [
        str(pynmea2.RMC("GN", "RMC", (clock, "V", *nowhere, "", "", date, "", "", "N"))),
        str(pynmea2.GGA("GN", "GGA", (clock, *nowhere, "0", "03", "", "", "M", "", "M", "", ""))),
    ]


def _clock_and_date(stamp_s: float) -> tuple[str, str]:
    time = datetime(1970, 1, 1, tzinfo=UTC) + timedelta(milliseconds=10 * round(stamp_s * 100))
    return f"{time:%H%M%S}.{time.microsecond // 10_000:02d}", f"{time:%d%m%y}"


def _degrees_minutes(degrees: float, width: int) -> str:
    # Whole units of 1e-7 minutes, so that rounding never prints 60 minutes.
    units = round(abs(degrees) * 600_000_000)
    whole, rest = divmod(units, 600_000_000)
    return f"{whole:0{width}d}{rest / 1e7:010.7f}"
