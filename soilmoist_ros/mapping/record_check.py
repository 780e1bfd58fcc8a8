# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Which records can be part of a map, and why the others are left out."""

from __future__ import annotations

import enum
import math
from dataclasses import dataclass
from typing import TYPE_CHECKING

from soilmoist_ros.foundation import direction, distance_text
from soilmoist_ros.sensing import CountRecord

if TYPE_CHECKING:
    from shapely.geometry.base import BaseGeometry

MAX_RATE_CPS = 1e4
"""Rate that no cosmic-ray neutron sensor reaches, by orders of magnitude [counts/s]."""
MAX_RECORD_S = 86400.0
"""Exposure beyond which a record counts as a mistake [s]."""
MAX_PLANE_M = 100_000.0
"""Distance beyond which the plane of a field has no true distances [m]."""
FACTORS = (0.01, 100.0)
"""Products of the correction factors beyond which a record counts as a mistake."""


class Skip(enum.Enum):
    """Why a record is not in the map; the value is the name that users see."""

    NO_POSITION = "no position"
    OUTSIDE = "outside the field"
    IMPLAUSIBLE = "implausible record"
    STAMP = "impossible stamp"
    UNREADABLE = "unreadable message"
    OTHER_FRAME = "other frame"
    QUARANTINED = "quarantined"
    UNEXPECTED = "unexpected count"

    @property
    def remedy(self) -> str:
        """What the user can do about it."""
        return {
            Skip.NO_POSITION: "check the GNSS receiver and its view of the sky",
            Skip.OUTSIDE: "check that the driver and the mapper have the same field file",
            Skip.IMPLAUSIBLE: "check the neutron logger and the site file of the driver",
            Skip.STAMP: "check the clocks of computer and logger; play recordings with their clock",
            Skip.UNREADABLE: "check what publishes the counts, and its version",
            Skip.OTHER_FRAME: "give driver, mapper and planner one frame, and one field file",
            Skip.QUARANTINED: "read the reason in the table of records, and check the sensor",
            Skip.UNEXPECTED: "measure there again: a second record that agrees brings the first into the map",
        }[self]


def check_record(record: CountRecord, area: BaseGeometry) -> tuple[Skip | None, str]:
    """Why a record is left out, as a code and in words; ``None`` if it can be used.

    :param record: the record
    :param area: the field and its margin [m]
    """
    import shapely

    if record.quarantine:
        return Skip.QUARANTINED, record.quarantine
    exposure_s, effective_s = record.exposure_s, record.effective_exposure_s
    for name, seconds in (("exposure", exposure_s), ("effective exposure", effective_s)):
        if not 0 < seconds < math.inf:
            return Skip.IMPLAUSIBLE, f"{name} of {seconds:g} s"
    if exposure_s > MAX_RECORD_S:
        return Skip.IMPLAUSIBLE, f"exposure of {exposure_s:g} s"
    if not FACTORS[0] <= exposure_s / effective_s <= FACTORS[1]:
        return Skip.IMPLAUSIBLE, f"correction by a factor of {exposure_s / effective_s:g}"
    if not 0 <= record.raw_counts <= MAX_RATE_CPS * effective_s:
        return Skip.IMPLAUSIBLE, f"{record.raw_counts} counts in {effective_s:g} s"
    if not (math.isfinite(record.x_m) and math.isfinite(record.y_m)):
        return Skip.NO_POSITION, "no position"
    if not shapely.contains_xy(area, record.x_m, record.y_m):
        return Skip.OUTSIDE, f"at x = {record.x_m:.1f} m, y = {record.y_m:.1f} m, {_way_to(record, area)}"
    return None, ""


def _way_to(record: CountRecord, area: BaseGeometry) -> str:
    """Distance and direction of a record from the field and its margin, in words."""
    import shapely

    centre = area.centroid
    bearing_deg = math.degrees(math.atan2(record.x_m - centre.x, record.y_m - centre.y)) % 360
    distance_m = float(shapely.distance(area, shapely.Point(record.x_m, record.y_m)))
    far = distance_text(distance_m) if distance_m < MAX_PLANE_M else f"more than {distance_text(MAX_PLANE_M)}"
    return f"{far} {direction(bearing_deg)} of the field"


@dataclass(frozen=True)
class StampLimits:
    """Stamps that a record can have.

    :param max_ahead_s: how far a stamp may lie in the future [s]; 0 for no limit
    :param max_age_s: how far it may lie in the past [s]; 0 for no limit
    """

    max_ahead_s: float = 3600.0
    max_age_s: float = 86400.0

    def fault(self, stamp_s: float, clock_s: float) -> str:
        """Why a stamp is impossible, in words; empty if it is not.

        :param stamp_s: the stamp [s]
        :param clock_s: time of the clock that stamps records [s]; nothing is impossible while that is 0
        """
        if not (math.isfinite(stamp_s) and stamp_s):
            return "a record without a stamp"
        ahead_s = stamp_s - clock_s
        if clock_s > 0 and 0 < self.max_ahead_s < ahead_s:
            return f"a record stamped {ahead_s:.0f} s ahead of the clock"
        if clock_s > 0 and 0 < self.max_age_s < -ahead_s:
            return f"a record stamped {-ahead_s:.0f} s behind the clock"
        return ""
