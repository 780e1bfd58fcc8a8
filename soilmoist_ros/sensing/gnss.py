# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""A GNSS fix with its error, and what has come of a receiver: so why there is no position."""

from __future__ import annotations

import enum
import math
from collections import Counter
from dataclasses import dataclass
from typing import Any

from soilmoist_ros.foundation import DAY_S, Mistake
from soilmoist_ros.sensing.records import NAN, Position, utc_text

Row = tuple[float, float, float]
Covariance = tuple[Row, Row, Row]
FIX_TYPE = "sensor_msgs/msg/NavSatFix"
"""Type of the topic ``fix``."""
UNKNOWN_COVARIANCE: Covariance = ((NAN, NAN, NAN),) * 3
EARLIEST_DATE_S = 946_684_800.0
"""2000-01-01: receivers without a date start in 1980, and simulated time in 1970 [s since 1970 UTC]."""
ROLLOVER_S = 1024 * 7 * DAY_S  # period of the week number of GPS, after which old receivers begin again [s]
SINCE_1980_S = 315_964_782.0
"""Seconds since 1970 UTC minus seconds of GPS time since 1980, with 18 leap seconds [s]."""
MAX_EDGE_S = 120.0  # largest difference of the ends of two spans of one survey [s]
MAX_ZONE_H = 14.0
MAX_REASONS = 50  # number of reasons that are counted apart: a live receiver may send any number
ROLLED_OVER = "exactly 1024 weeks earlier: the receiver's date has rolled over"
_OTHER_TIMES = {
    ROLLOVER_S: ROLLED_OVER, 2 * ROLLOVER_S: ROLLED_OVER.replace("1024", "2048"),
    SINCE_1980_S: "seconds of GPS time, which begins in 1980",
}  # fmt: skip
"""Times that receivers are wrong by [s], and their meaning."""
SIMULATED = "simulated time, or the time since the device was switched on"


class FixStatus(enum.IntEnum):
    """Fix and its augmentation, or none; sensor_msgs/NavSatStatus has these numbers."""

    NO_FIX = -1
    FIX = 0
    SBAS = 1
    """Differential corrections, from a satellite or otherwise."""
    RTK = 2
    """Real-time kinematic, fixed or float (ground-based augmentation)."""


class CovarianceKind(enum.IntEnum):
    """Source of a position covariance; the numbers are those of sensor_msgs/NavSatFix."""

    UNKNOWN = 0
    APPROXIMATED = 1
    """From HDOP and a user-equivalent range error."""
    DIAGONAL_KNOWN = 2
    """The receiver's standard deviations (GST without an error ellipse)."""
    KNOWN = 3
    """The receiver's error ellipse (GST)."""


class NoPlace(enum.StrEnum):
    """Reason code of an epoch without a position, with a text and a remedy."""

    NO_FIX = (
        "no_fix", "no fix",
        "begin the survey when the receiver has a fix; check the antenna and its view of the sky",
    )  # fmt: skip
    STATUS_UNKNOWN = (
        "status_unknown", "unknown whether there is a fix",
        "set the driver that published the positions up to say so, or give the receiver's sentences with --nmea",
    )  # fmt: skip
    QUALITY_UNKNOWN = (
        "quality_unknown", "a quality of unknown meaning",
        "look the number up in the manual of the receiver; known as a fix are 1 to 6, 8 and 9",
    )  # fmt: skip
    TYPED_IN = "typed_in", "typed in by hand", "switch the receiver from manual input to its own fix"
    NO_COORDINATES = (
        "no_coordinates", "no possible latitude and longitude", "check the receiver: it says that it has a fix",
    )  # fmt: skip

    text: str
    remedy: str

    def __new__(cls, code: str, text: str, remedy: str) -> NoPlace:
        """The value of a member is its code."""
        reason = str.__new__(cls, code)
        reason._value_ = code
        reason.text, reason.remedy = text, remedy
        return reason


# By the quality of NMEA GGA: 1 autonomous, 2 differential, 3 PPS, 4 RTK fixed, 5 RTK float, 6 dead reckoning,
# 8 simulator; 9 is SBAS at NovAtel. 0 (none) and 7 (typed in by hand) are no fix.
STATUS_OF_QUALITY: dict[int, FixStatus] = {
    1: FixStatus.FIX, 2: FixStatus.SBAS, 3: FixStatus.FIX, 4: FixStatus.RTK, 5: FixStatus.RTK, 6: FixStatus.FIX,
    8: FixStatus.FIX, 9: FixStatus.SBAS,
}  # fmt: skip

# User-equivalent range error [m], one standard deviation, by GGA quality: usual values of single-frequency
# receivers under open sky.
DEFAULT_UERE_M: dict[int, float] = {1: 4.0, 2: 1.5, 3: 3.0, 4: 0.02, 5: 0.4, 6: 20.0, 8: 4.0, 9: 1.5}


def horizontal_sd(quality: int, hdop: float) -> float:
    """Standard deviation of each horizontal coordinate [m] by the quality of GGA, NaN if unknown.

    ``HDOP^2 = (var_east + var_north) / UERE^2``, so each coordinate has ``HDOP * UERE / sqrt(2)``.
    """
    error = DEFAULT_UERE_M.get(quality, math.nan)
    if not (0 < hdop < 100):
        return math.nan
    return hdop * error / math.sqrt(2)


@dataclass(frozen=True, slots=True)
class Fix:
    """One epoch of a GNSS receiver.

    :param stamp_s: time of the epoch [s since 1970-01-01 UTC], NaN while the receiver has no date
    :param position: position, NaN without a fix
    :param quality: quality as in NMEA GGA; 0 is none
    :param satellites: number of satellites in use, -1 if unknown
    :param geoid_separation_m: geoid above ellipsoid [m], NaN if unknown; added to the altitude above mean sea
        level it gives the height above the ellipsoid
    :param covariance_m2: covariance of east, north, up [m^2], rows; NaN where unknown
    :param no_place: why there is no position; ``None`` with one
    :param said: what the receiver said about that, such as ``GGA quality 0``
    """

    stamp_s: float
    position: Position
    status: FixStatus
    quality: int = 0
    satellites: int = -1
    hdop: float = NAN
    speed_mps: float = NAN
    geoid_separation_m: float = NAN
    covariance_m2: Covariance = UNKNOWN_COVARIANCE
    covariance_kind: CovarianceKind = CovarianceKind.UNKNOWN
    no_place: NoPlace | None = None
    said: str = ""

    @classmethod
    def without_place(cls, stamp_s: float, why: NoPlace, said: str, quality: int = 0) -> Fix:
        """An epoch without a position."""
        return cls(stamp_s, Position(NAN, NAN), FixStatus.NO_FIX, quality, no_place=why, said=said)


def is_place(latitude_deg: float, longitude_deg: float) -> bool:
    """True if these can be coordinates of a receiver: 0, 0 is what some send without a fix."""
    possible = abs(latitude_deg) <= 90 and abs(longitude_deg) <= 180
    return possible and not latitude_deg == longitude_deg == 0


def covariance_of_ellipse(major_m: float, minor_m: float, orientation_deg: float, up_m: float) -> Covariance:
    """Covariance in east, north, up of an error ellipse [m^2].

    With ``a`` along the direction ``t`` (clockwise from true north) and ``b`` across it:
    ``EE = a^2 sin^2 t + b^2 cos^2 t``,
    ``NN = a^2 cos^2 t + b^2 sin^2 t``, ``EN = (a^2 - b^2) sin t cos t``.
    """
    sine, cosine = math.sin(math.radians(orientation_deg)), math.cos(math.radians(orientation_deg))
    a2, b2 = major_m**2, minor_m**2
    east, north = a2 * sine**2 + b2 * cosine**2, a2 * cosine**2 + b2 * sine**2
    mixed = (a2 - b2) * sine * cosine
    return (east, mixed, 0.0), (mixed, north, 0.0), (0.0, 0.0, up_m**2)


def fix_from_message(message: Any, received_s: float = NAN) -> Fix:
    """Fix of a sensor_msgs/NavSatFix or a gps_msgs/GPSFix, decoded by ROS or by rosbags.

    An impossible place means no fix, and a stamp of zero the time of receipt. Altitudes are above the ellipsoid:
    the message has no geoid separation.
    """
    stamp_s = stamp_of(message) or received_s or NAN
    latitude_deg, longitude_deg = float(message.latitude), float(message.longitude)
    said = int(message.status.status)
    status = (_GPS_FIX if hasattr(message, "err_horz") else _NAV_SAT).get(said)
    if status is None:
        return Fix.without_place(stamp_s, NoPlace.STATUS_UNKNOWN, f"status {said}")
    if status is FixStatus.NO_FIX:
        return Fix.without_place(stamp_s, NoPlace.NO_FIX, f"status {said}")
    if not is_place(latitude_deg, longitude_deg):
        where = f"latitude {latitude_deg:g}, longitude {longitude_deg:g}"
        return Fix.without_place(stamp_s, NoPlace.NO_COORDINATES, where)
    covariance, kind = UNKNOWN_COVARIANCE, CovarianceKind.UNKNOWN
    if message.position_covariance_type in set(CovarianceKind) - {CovarianceKind.UNKNOWN}:
        numbers = [float(value) for value in message.position_covariance]
        east, north, up = ((numbers[row], numbers[row + 1], numbers[row + 2]) for row in (0, 3, 6))
        covariance, kind = (east, north, up), CovarianceKind(int(message.position_covariance_type))
    variance = (covariance[0][0] + covariance[1][1]) / 2
    sd_m = math.sqrt(variance) if variance >= 0 else NAN
    return Fix(
        stamp_s=stamp_s, position=Position(latitude_deg, longitude_deg, float(message.altitude), sd_m),
        status=status, geoid_separation_m=0.0, covariance_m2=covariance, covariance_kind=kind,
    )  # fmt: skip


def stamp_of(message: Any) -> float:
    """Stamp in the header of a message [s since 1970 UTC]; zero if it has none."""
    stamp = message.header.stamp
    return float(stamp.sec + stamp.nanosec * 1e-9)


_NAV_SAT = {int(status): status for status in FixStatus}
# gps_msgs/GPSStatus has more of them: 18 DGPS, 19 and 20 RTK fixed and float, 33 WAAS
_GPS_FIX = {**_NAV_SAT, 18: FixStatus.SBAS, 19: FixStatus.RTK, 20: FixStatus.RTK, 33: FixStatus.SBAS}


class Heard:
    """Epochs of a receiver, counted by what they lack.

    ``without`` counts epochs without a position by reason and by what the receiver said, ``by_quality`` the others
    by the quality of GGA. ``other_type`` says what a topic has instead of positions. ``first_s`` and ``last_s``
    are the times of positions [s since 1970 UTC], shifted by ``shifted_s`` already, which remedies include.
    """

    def __init__(self) -> None:
        self.epochs = self.placed = 0
        self.without: Counter[tuple[NoPlace, str]] = Counter()
        self.by_quality: Counter[int] = Counter()
        self.other_type = ""
        self.first_s, self.last_s = math.inf, -math.inf
        self.shifted_s = 0.0

    def add(self, fix: Fix) -> None:
        """An epoch has come."""
        self.epochs += 1
        if fix.status is FixStatus.NO_FIX:
            key = fix.no_place or NoPlace.NO_FIX, fix.said or "no status"
            known = key in self.without or len(self.without) < MAX_REASONS
            self.without[key if known else (key[0], "others")] += 1
            return
        self.placed += 1
        self.by_quality[fix.quality] += 1
        if math.isfinite(fix.stamp_s):
            self.first_s, self.last_s = min(self.first_s, fix.stamp_s), max(self.last_s, fix.stamp_s)

    @property
    def odd(self) -> str:
        """Positions that are not of satellites, in words; empty if there are none."""
        what = {6: "dead reckoning", 8: "a simulator"}
        found = sorted(self.by_quality.items())
        return ", ".join(f"{n} are of {what[quality]} (GGA {quality})" for quality, n in found if quality in what)

    @property
    def gaps(self) -> str:
        """Number and most frequent reason of the epochs without a position, in words; empty if there are none."""
        if not self.without:
            return ""
        (reason, said), count = self.without.most_common(1)[0]
        lost = self.epochs - self.placed
        return f"{lost} of {self.epochs} epochs have none, {count} by {said}: {reason.text}"

    @property
    def span(self) -> str:
        """Times of the positions, and why there are none in between, in words."""
        times = f"{utc_text(self.first_s)} to {utc_text(self.last_s)} UTC"
        return f"its positions are from {times}{f'; {self.gaps}' if self.gaps else ''}"

    def why_none(self) -> Mistake | None:
        """Reason why there is no position with a time, ``None`` if there is one."""
        if self.first_s < math.inf:
            return None
        if not self.epochs and self.other_type:
            remedy = "publish the positions as sensor_msgs/NavSatFix, or set fix_topic or gnss_uri"
            return Mistake(self.other_type, remedy)
        if not self.epochs:
            remedy = "check that the receiver sends GGA or GNS with RMC or ZDA, or the topic of its positions"
            return Mistake("has no epoch of a receiver", remedy)
        if self.placed:
            message = f"has {self.placed} positions, but no date: neither RMC nor ZDA, nor stamps"
            return Mistake(message, "let the receiver send RMC or ZDA, too")
        common = self.without.most_common(3)
        reasons = ", ".join(f"{said}: {code.text} ({count})" for (code, said), count in common)
        return Mistake(f"has no position in {self.epochs} epochs: {reasons}", common[0][0][0].remedy)

    def why_not_at(self, first_s: float, last_s: float, clock_known: bool = False) -> Mistake | None:
        """Reason why positions and records do not belong together in time, ``None`` if they do.

        :param clock_known: whether it was stated which time the logger's clock shows
        """
        if (none := self.why_none()) is not None:
            return none
        both = (
            f"the positions are from {utc_text(self.first_s)} to {utc_text(self.last_s)}, "
            f"the records from {utc_text(first_s)} to {utc_text(last_s)} (UTC)"
        )

        def overlap_s(shift_s: float) -> float:
            """Time in common when the positions are later by a time [s]; 1 for a single epoch inside."""
            begin_s, end_s = max(self.first_s + shift_s, first_s), min(self.last_s + shift_s, last_s)
            return max(end_s - begin_s, 1.0) if end_s >= begin_s else 0.0

        if overlap_s(0.0) > 0:
            hours = round((first_s - self.first_s) / 3600)
            ends = (first_s - self.first_s, last_s - self.last_s)
            if clock_known or not hours or any(abs(end - 3600 * hours) > MAX_EDGE_S for end in ends):
                return None
            return Mistake(
                f"{both}: the same survey, {abs(hours)} h {'later' if hours > 0 else 'earlier'} by the logger's "
                "clock, or two surveys that overlap",
                f"say in the site file which time the logger's clock shows: 'logger_utc_offset_hours: {hours}', "
                f"or 0 for UTC; if the positions are in local time: {self._shift(3600 * hours)}",
            )
        for shift_s, what in _OTHER_TIMES.items():
            if overlap_s(shift_s) > 0:
                return Mistake(
                    f"{both}: {what}", f"correct the times of the positions with {self._shift(shift_s)}"
                )
        if self.last_s < EARLIEST_DATE_S:
            remedy = (
                "record positions and logger by one clock, or correct the times of the positions: --gnss-shift"
            )
            return Mistake(f"{both}: {SIMULATED}", remedy)
        needed_s = 0.8 * min(self.last_s - self.first_s, last_s - first_s)
        steps = [half / 2 for half in range(round(-2 * MAX_ZONE_H), round(2 * MAX_ZONE_H) + 1)]
        zone = max(steps, key=lambda hour: (overlap_s(3600 * hour), -(hour % 1), -abs(hour)))
        if overlap_s(3600 * zone) >= max(needed_s, 1.0):  # the logger's clock may be ahead by whole or half hours
            remedy = f"if it is the positions: {self._shift(3600 * zone)}"
            if not clock_known:
                key = f"'logger_utc_offset_hours: {zone:g}'"
                remedy = f"if it is the logger, say so in the site file: {key}; {remedy}"
            return Mistake(
                f"{both}: they fit if the logger's clock shows local time, UTC {zone:+g} h, "
                f"or the positions have local time, UTC {-zone:+g} h",
                remedy,
            )
        days = round((first_s - self.first_s) / DAY_S)
        if days and overlap_s(days * DAY_S) >= needed_s:
            remedy = f"give the positions of the same day; if a date is wrong: {self._shift(days * DAY_S)}"
            return Mistake(f"{both}: {abs(days)} days apart, at the same time of day", remedy)
        return Mistake(f"{both}: they do not overlap", "give the positions of the same survey")

    def _shift(self, shift_s: float) -> str:
        """The option that makes positions later by ``shift_s`` than they are now."""
        total_s = round(self.shifted_s + shift_s)
        if not total_s:
            return "no --gnss-shift"
        units = (7 * DAY_S, "w"), (DAY_S, "d"), (3600.0, "h"), (60.0, "min")
        size_s, unit = next((one for one in units if total_s % one[0] == 0), (1.0, "s"))
        return f"--gnss-shift {total_s / size_s:.0f}{unit}"


def clock_words(ahead_s: float) -> str:
    """Meaning of the time of a position minus the present [s]; empty if it is like nothing known."""
    if abs(ahead_s + ROLLOVER_S) < 3600:
        return ROLLED_OVER
    if 16.5 <= ahead_s <= 19.5:
        return "as GPS time is ahead of UTC by its leap seconds"
    hours = round(ahead_s / 1800) / 2
    if 0 < abs(hours) <= MAX_ZONE_H and abs(ahead_s - 3600 * hours) < MAX_EDGE_S:
        return f"{hours:+g} h: local time instead of UTC"
    return ""
