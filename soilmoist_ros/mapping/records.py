# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Records: which can be part of a map, and how they become samples one by one, as they come."""

from __future__ import annotations

import enum
import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Final

import numpy as np
from numpy.typing import ArrayLike, NDArray

from soilmoist_ros.foundation import direction, distance_text
from soilmoist_ros.mapping.samples import (
    Samples,
    footprint_spread,
    full_spread,
    good_samples,
    path_spread,
    without_noise,
)
from soilmoist_ros.sensing import CountRecord, Kind

if TYPE_CHECKING:
    from shapely.geometry.base import BaseGeometry

UNEXPECTED: Final = Kind.UNEXPECTED_COUNT.value  # reason why a record that does not fit the map is quarantined
MAX_RATE_CPS = 1e4  # rate that no cosmic-ray neutron sensor reaches, by orders of magnitude [counts/s]
MAX_RECORD_S = 86400.0  # exposure beyond which a record counts as a mistake [s]
MAX_PLANE_M = 100_000.0  # distance beyond which the plane of a field has no true distances [m]
FACTORS = (0.01, 100.0)  # products of the correction factors beyond which a record counts as a mistake
_MIN_GAP, _MAX_GAP = 0.9, 2.5
"""Times between the ends of successive records of one sensor, in exposures; the next but one if one was lost."""


class Skip(enum.Enum):
    """Reason why a record is not in the map; the value is the name that users see."""

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
        """Remedy for the user against skipped records."""
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


@dataclass(frozen=True)
class SkippedRecords:
    """Records of one kind that were left out."""

    count: int
    example: str


def without_verdict(record: CountRecord) -> CountRecord:
    """The record without the verdict of an earlier map: the records before and after it decide anew."""
    return replace(record, quarantine="") if record.quarantine == UNEXPECTED else record


def check_record(record: CountRecord, area: BaseGeometry) -> tuple[Skip | None, str]:
    """Reason why a record is left out, as a code and in words; ``None`` if it can be used."""
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
        """Reason why a stamp is impossible, in words; empty if it is not.

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


# -- Merging -------------------------------------------------------------------------------------------------

Array = NDArray[np.float64]


class DrivenPaths:
    """Distance that the robot drove during each record, from the places of successive records.

    Records come in order of time, maybe of several robots at once: a record follows the nearest of those that
    had ended when it began. Its path is the vector from the place of that one, scaled to the exposure.
    Where the robot starts or stops this is right to half a record's path.
    """

    def __init__(self) -> None:
        self._last: list[CountRecord] = []

    def spread(self, record: CountRecord) -> Array:
        """Spread of a record's counts along its path, shape (4,) [m^2]; 0 without a predecessor."""
        exposure_s = record.exposure_s
        self._last = [one for one in self._last if record.stamp_s - one.stamp_s <= _MAX_GAP * exposure_s]
        before = [one for one in self._last if record.stamp_s - one.stamp_s >= _MIN_GAP * exposure_s]
        self._last.append(record)
        if not before:
            return np.zeros(4)
        nearest = min(before, key=lambda one: math.hypot(record.x_m - one.x_m, record.y_m - one.y_m))
        self._last.remove(nearest)
        share = min(exposure_s / (record.stamp_s - nearest.stamp_s), 1.0)
        return path_spread([share * (record.x_m - nearest.x_m), share * (record.y_m - nearest.y_m)])


def driven_spreads(records: Sequence[CountRecord]) -> Array:
    """Spread of each record along its path, shape (n, 4) [m^2]; records in order of time."""
    paths = DrivenPaths()
    return np.array([paths.spread(record) for record in records]).reshape(-1, 4)


class SampleMerger:
    """Merges records by place, in order; the total counts and the total exposure are conserved.

    A record joins the nearest sample if its mean place is within the radius, and moves it; otherwise it begins
    a new sample. So the records of a stop whose positions jitter are one sample, however long the robot stands,
    and a drive becomes a chain of samples about two radii apart (each lags behind the robot by half its path).
    What comes out depends on the order of the records.

    A sample's spread is the path of its records together (parallel-axis theorem), and the sensor's footprint.

    :param radius_m: radius of a stop [m], >= 0; keep it well below the sensor's footprint
    :param window_s: a sample takes no records from this time after its first one on [s]
    """

    def __init__(self, radius_m: float, footprint_radius_m: float = 0.0, window_s: float = math.inf) -> None:
        if not (math.isfinite(radius_m) and radius_m >= 0):
            raise ValueError(f"radius_m must be >= 0 and finite, got {radius_m}")
        self.radius_m = radius_m
        self.window_s = window_s
        self._count = 0
        self._footprint_m = float(footprint_spread(footprint_radius_m)[3])
        # x, y, counts, exposure, spread, mean time, begin; doubled when full
        self._columns = np.empty((9, 64))

    def add(
        self,
        x_m: float,
        y_m: float,
        raw_counts: int,
        exposure_s: float,
        spread: ArrayLike = (0.0, 0.0, 0.0),
        time_s: float = 0.0,
    ) -> None:
        """Add a record."""
        nearest = self._within_reach(x_m, y_m, time_s)
        if nearest is None:
            nearest = self._begin(x_m, y_m, time_s)
        sample = self._columns[:, nearest]
        sample[2] += raw_counts
        sample[3] += exposure_s
        share = exposure_s / sample[3]
        east, north = x_m - sample[0], y_m - sample[1]
        sample[0] += share * east
        sample[1] += share * north
        apart = np.array([east * east, east * north, north * north])
        sample[4:7] += share * (np.asarray(spread)[:3] + (1 - share) * apart - sample[4:7])
        sample[7] += share * (time_s - sample[7])

    def add_record(self, record: CountRecord, spread: ArrayLike) -> None:
        """Add a record, counted in the middle of its interval."""
        middle_s = record.stamp_s - record.exposure_s / 2
        self.add(record.x_m, record.y_m, record.raw_counts, record.effective_exposure_s, spread, middle_s)

    def add_records(self, records: Sequence[CountRecord], spreads: Array) -> None:
        """Add records, each with its spread, shape (n, 4) [m^2]."""
        for record, spread in zip(records, spreads, strict=True):
            self.add_record(record, spread)

    @property
    def samples(self) -> Samples:
        """The samples so far, as they began, a copy; spreads that noise may have made count as none."""
        columns = self._columns[:, : self._count].copy()
        xy = np.ascontiguousarray(columns[:2].T) + 0.0  # -0.0 and 0.0 are the same place
        spread = without_noise(full_spread(columns[4:7].T, self._footprint_m))
        return good_samples(xy, columns[2], columns[3], spread)

    @property
    def time_s(self) -> Array:
        """Mean time at which each sample was counted, shape (n,) [s]; a copy."""
        return self._columns[7, : self._count].copy()

    def __len__(self) -> int:
        return self._count

    def _within_reach(self, x_m: float, y_m: float, time_s: float) -> int | None:
        if not self._count:
            return None
        offset = self._columns[:2, : self._count] - [[x_m], [y_m]]
        distance_m = np.hypot(offset[0], offset[1])
        if self.window_s < math.inf:
            distance_m[time_s - self._columns[8, : self._count] >= self.window_s] = math.inf
        nearest = int(distance_m.argmin())
        return nearest if distance_m[nearest] <= self.radius_m else None

    def _begin(self, x_m: float, y_m: float, time_s: float) -> int:
        if self._count == self._columns.shape[1]:
            self._columns = np.concatenate([self._columns, np.empty_like(self._columns)], axis=1)
        self._columns[:, self._count] = x_m, y_m, *np.zeros(5), time_s, time_s
        self._count += 1
        return self._count - 1


def survey_samples(
    records: Sequence[CountRecord], radius_m: float, footprint_radius_m: float = 0.0, spread: Array | None = None
) -> Samples:
    """Samples of a whole survey, merged as on line.

    :param records: in order of time, each with a place and an exposure > 0
    :param spread: along the path of each, shape (n, 4) [m^2]; computed by default
    """
    merger = SampleMerger(radius_m, footprint_radius_m)
    merger.add_records(records, driven_spreads(records) if spread is None else spread)
    return merger.samples
