# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""A GNSS fix, and its error from the receiver's quality figures."""

from __future__ import annotations

import enum
import math
from dataclasses import dataclass
from typing import Any

from soilmoist_ros.sensing.records import NAN, Position

Row = tuple[float, float, float]
Covariance = tuple[Row, Row, Row]
FIX_TYPE = "sensor_msgs/msg/NavSatFix"
"""Type of the topic ``fix``."""
UNKNOWN_COVARIANCE: Covariance = ((NAN, NAN, NAN),) * 3


class FixStatus(enum.IntEnum):
    """Whether there is a fix, and its augmentation; the numbers are those of sensor_msgs/NavSatStatus."""

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
        "no_fix",
        "no fix",
        "begin the survey when the receiver has a fix; check the antenna and its view of the sky",
    )
    STATUS_UNKNOWN = (
        "status_unknown",
        "unknown whether there is a fix",
        "the driver that published the positions does not say whether there is a fix: set it up so that it does, "
        "or give the sentences of the receiver with --nmea",
    )
    QUALITY_UNKNOWN = (
        "quality_unknown",
        "a quality of unknown meaning",
        "look the number up in the manual of the receiver; known as a fix are 1 to 6, 8 and 9",
    )
    TYPED_IN = "typed_in", "typed in by hand", "switch the receiver from manual input to its own fix"
    NO_COORDINATES = (
        "no_coordinates",
        "no possible latitude and longitude",
        "check the receiver: it says that it has a fix",
    )

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
    1: FixStatus.FIX,
    2: FixStatus.SBAS,
    3: FixStatus.FIX,
    4: FixStatus.RTK,
    5: FixStatus.RTK,
    6: FixStatus.FIX,
    8: FixStatus.FIX,
    9: FixStatus.SBAS,
}

# User-equivalent range error [m], one standard deviation, by GGA quality: usual values of single-frequency
# receivers under open sky. Replace them if the receiver is known.
DEFAULT_UERE_M: dict[int, float] = {1: 4.0, 2: 1.5, 3: 3.0, 4: 0.02, 5: 0.4, 6: 20.0, 8: 4.0, 9: 1.5}


def horizontal_sd(quality: int, hdop: float, uere_m: dict[int, float] | None = None) -> float:
    """Standard deviation of each horizontal coordinate [m], NaN if unknown.

    ``HDOP^2 = (var_east + var_north) / UERE^2``, so each coordinate has ``HDOP * UERE / sqrt(2)``.

    :param quality: as in NMEA GGA
    :param hdop: horizontal dilution of precision, > 0
    :param uere_m: user-equivalent range error by quality [m]; :data:`DEFAULT_UERE_M` if not given
    """
    error = (DEFAULT_UERE_M if uere_m is None else uere_m).get(quality, math.nan)
    if not (0 < hdop < 100):
        return math.nan
    return hdop * error / math.sqrt(2)


@dataclass(frozen=True, slots=True)
class Fix:
    """One epoch of a GNSS receiver.

    :param stamp_s: time of the epoch [s since 1970-01-01 UTC], NaN while the receiver has no date
    :param position: position, NaN without a fix
    :param status: whether there is a fix, and its augmentation
    :param quality: quality as in NMEA GGA; 0 is none
    :param satellites: number of satellites in use, -1 if unknown
    :param hdop: horizontal dilution of precision, NaN if unknown
    :param speed_mps: speed over ground [m/s], NaN if unknown
    :param course_deg: course over ground, clockwise from true north [deg], NaN if unknown
    :param geoid_separation_m: geoid above ellipsoid [m], NaN if unknown; the height above the ellipsoid is the
        altitude above mean sea level plus this separation
    :param covariance_m2: covariance of east, north, up [m^2], rows; NaN where unknown
    :param covariance_kind: source of the covariance
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
    course_deg: float = NAN
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
    """Whether these can be coordinates of a receiver: 0, 0 is what some send without a fix."""
    possible = abs(latitude_deg) <= 90 and abs(longitude_deg) <= 180
    return possible and not latitude_deg == longitude_deg == 0


def covariance_of_ellipse(major_m: float, minor_m: float, orientation_deg: float, up_m: float) -> Covariance:
    """Covariance in east, north, up of an error ellipse [m^2].

    With ``a`` along the direction ``t`` (clockwise from north) and ``b`` across it:
    ``EE = a^2 sin^2 t + b^2 cos^2 t``,
    ``NN = a^2 cos^2 t + b^2 sin^2 t``, ``EN = (a^2 - b^2) sin t cos t``.

    :param major_m: standard deviation along the semi-major axis [m]
    :param minor_m: standard deviation along the semi-minor axis [m]
    :param orientation_deg: direction of the semi-major axis, clockwise from true north [deg]
    :param up_m: standard deviation of the altitude [m]
    """
    sine, cosine = math.sin(math.radians(orientation_deg)), math.cos(math.radians(orientation_deg))
    a2, b2 = major_m**2, minor_m**2
    east, north = a2 * sine**2 + b2 * cosine**2, a2 * cosine**2 + b2 * sine**2
    mixed = (a2 - b2) * sine * cosine
    return (east, mixed, 0.0), (mixed, north, 0.0), (0.0, 0.0, up_m**2)


def diagonal_covariance(east_m: float, north_m: float, up_m: float) -> Covariance:
    """Covariance of uncorrelated errors with these standard deviations [m^2]."""
    return (east_m**2, 0.0, 0.0), (0.0, north_m**2, 0.0), (0.0, 0.0, up_m**2)


def fix_from_message(message: Any, received_s: float = NAN) -> Fix:
    """Fix of a message. An impossible place means no fix, and a stamp of zero the time of receipt.

    Altitudes are above the ellipsoid: the message has no geoid separation.

    :param message: a sensor_msgs/NavSatFix, or a gps_msgs/GPSFix, decoded by ROS or by rosbags
    :param received_s: time at which it was received [s since 1970 UTC]; NaN if unknown
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
    covariance, kind = _covariance_of(message)
    return Fix(
        stamp_s=stamp_s,
        position=Position(latitude_deg, longitude_deg, float(message.altitude), _horizontal_sd(covariance)),
        status=status,
        geoid_separation_m=0.0,
        covariance_m2=covariance,
        covariance_kind=kind,
    )


def stamp_of(message: Any) -> float:
    """Stamp in the header of a message [s since 1970 UTC]; zero if it has none."""
    stamp = message.header.stamp
    return float(stamp.sec + stamp.nanosec * 1e-9)


_NAV_SAT = {int(status): status for status in FixStatus}
# gps_msgs/GPSStatus has more of them: 18 DGPS, 19 and 20 RTK fixed and float, 33 WAAS
_GPS_FIX = {**_NAV_SAT, 18: FixStatus.SBAS, 19: FixStatus.RTK, 20: FixStatus.RTK, 33: FixStatus.SBAS}


def _covariance_of(message: Any) -> tuple[Covariance, CovarianceKind]:
    numbers = [float(value) for value in message.position_covariance]
    known = {int(kind) for kind in CovarianceKind if kind is not CovarianceKind.UNKNOWN}
    if message.position_covariance_type not in known:
        return UNKNOWN_COVARIANCE, CovarianceKind.UNKNOWN
    east, north, up = ((numbers[row], numbers[row + 1], numbers[row + 2]) for row in (0, 3, 6))
    return (east, north, up), CovarianceKind(int(message.position_covariance_type))


def _horizontal_sd(covariance: Covariance) -> float:
    mean = (covariance[0][0] + covariance[1][1]) / 2
    return math.sqrt(mean) if mean >= 0 else NAN
