# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Records of one counting interval, raw or corrected and geo-tagged."""

from __future__ import annotations

import math
from dataclasses import dataclass
from datetime import UTC, datetime

NAN = math.nan
FIRST_STAMP_S = -62_135_596_800.0
LAST_STAMP_S = 253_402_300_799.0  # the years 1 to 9999, which Python's calendar has [s since 1970 UTC]


def utc_text(stamp_s: float) -> str:
    """Date and time in UTC."""
    try:
        return f"{datetime.fromtimestamp(stamp_s, UTC):%Y-%m-%d %H:%M:%S}"
    except (ValueError, OverflowError, OSError):
        return f"{stamp_s:g} s after 1970"


@dataclass(frozen=True, slots=True)
class Position:
    """A GNSS position (WGS-84).

    :param latitude_deg: latitude, north positive [deg]
    :param longitude_deg: longitude, east positive [deg]
    :param altitude_m: altitude above mean sea level [m], NaN if unknown
    :param horizontal_sd_m: one standard deviation of each horizontal coordinate [m], NaN if unknown
    """

    latitude_deg: float
    longitude_deg: float
    altitude_m: float = NAN
    horizontal_sd_m: float = NAN


@dataclass(frozen=True, slots=True, repr=False)
class LoggerRecord:
    """One raw record of a neutron logger, checked and in this package's units.

    :param stamp_s: end of the counting interval [s since 1970-01-01 UTC]
    :param tube_counts: counts of each detector tube in the order of the format; NaN where a tube is missing
    :param tube_live_s: live time of each tube [s]; NaN where the tube is missing
    :param pressure_hpa: air pressure [hPa], NaN if unknown
    :param temperature_degc: air temperature [degC], NaN if unknown
    :param relative_humidity: relative humidity of the air [0..1], NaN if unknown
    :param position: position logged with the record, ``None`` without a fix
    :param line: line of the log, counted from 1; 0 without a file
    :param record_number: running number from the logger, -1 if there is none
    :param clock_ahead_s: logger's clock minus GNSS time [s], 0 if unknown
    """

    stamp_s: float
    tube_counts: tuple[float, ...]
    tube_live_s: tuple[float, ...]
    pressure_hpa: float = NAN
    temperature_degc: float = NAN
    relative_humidity: float = NAN
    position: Position | None = None
    line: int = 0
    record_number: int = -1
    clock_ahead_s: float = 0.0

    def __repr__(self) -> str:
        present = [count for count in self.tube_counts if not math.isnan(count)]
        tubes = f"{len(present)} of {len(self.tube_counts)} tubes"
        return f"LoggerRecord({utc_text(self.stamp_s)}Z, {sum(present):g} counts of {tubes}, line {self.line})"


@dataclass(frozen=True, slots=True, repr=False)
class CountRecord:
    """One geo-tagged record with its correction factors and effective exposure.

    ``raw_counts ~ Poisson(rate * effective_exposure_s)``, where ``rate`` is the *corrected* count rate of
    all tubes together. The raw counts stay unchanged, so the counting statistics stay exact.

    :param stamp_s: end of the counting interval [s since 1970-01-01 UTC]
    :param x_m: east of the field's datum [m], at the middle of the counting interval
    :param y_m: north of the field's datum [m]
    :param z_m: above the field's datum [m], NaN if unknown
    :param raw_counts: counts of all working tubes
    :param exposure_s: live time that makes ``raw_counts / exposure_s`` the rate of *all* tubes [s]
    :param effective_exposure_s: ``exposure_s / (f_pressure * f_humidity * f_intensity)``, divided by the constant
        factors of the site (plants, road), too [s]
    :param f_pressure: pressure factor [-]
    :param f_humidity: humidity factor [-]
    :param f_intensity: incoming cosmic-ray intensity factor [-]
    :param quarantine: code of a :class:`Kind` of a bad record, which is kept and shown, but used by no map or
        mean; empty for a good record
    """

    stamp_s: float
    x_m: float
    y_m: float
    z_m: float
    raw_counts: int
    exposure_s: float
    effective_exposure_s: float
    f_pressure: float = 1.0
    f_humidity: float = 1.0
    f_intensity: float = 1.0
    quarantine: str = ""

    @property
    def corrected_rate(self) -> float:
        """Corrected count rate of the whole sensor [counts/s]."""
        return self.raw_counts / self.effective_exposure_s

    def __repr__(self) -> str:
        place = f"x={self.x_m:.1f} m, y={self.y_m:.1f} m"
        counts = f"{self.raw_counts} counts, {self.corrected_rate:.2f} counts/s"
        quarantine = f", {self.quarantine}" if self.quarantine else ""
        return f"CountRecord({utc_text(self.stamp_s)}Z, {place}, {counts}{quarantine})"
