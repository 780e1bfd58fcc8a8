"""Records become samples one by one, as they come."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from soilmoist_ros.mapping.samples import Samples

Array = NDArray[np.float64]


class SampleMerger:
    """Merges records by place, in order; the total counts and the total exposure are conserved.

    A record joins the nearest sample if its mean place is within the radius, and moves it; otherwise it begins
    a new sample. So the records of a stop whose positions jitter are one sample, however long the robot stands,
    and a drive becomes a chain of samples about two radii apart (each drags behind the robot by half the way).
    What comes out depends on the order of the records, unlike with
    :func:`~soilmoist_ros.mapping.samples.merge_records`, which needs them all.

    :param radius_m: radius of a stop [m], >= 0; keep it well below the sensor's footprint
    :raises ValueError: if the radius is negative or not finite
    """

    def __init__(self, radius_m: float) -> None:
        if not (math.isfinite(radius_m) and radius_m >= 0):
            raise ValueError(f"radius_m must be >= 0 and finite, got {radius_m}")
        self.radius_m = radius_m
        self._count = 0
        self._columns = np.empty((4, 64))  # x, y, counts, exposure; doubled when full

    def add(self, x_m: float, y_m: float, raw_counts: int, exposure_s: float) -> None:
        """Take a record.

        :param x_m: east [m], finite
        :param y_m: north [m], finite
        :param raw_counts: raw counts, >= 0
        :param exposure_s: effective exposure [s], > 0 and finite
        """
        nearest = self._within_reach(x_m, y_m)
        if nearest is None:
            nearest = self._begin(x_m, y_m)
        sample = self._columns[:, nearest]
        sample[2] += raw_counts
        sample[3] += exposure_s
        share = exposure_s / sample[3]
        sample[0] += share * (x_m - sample[0])
        sample[1] += share * (y_m - sample[1])

    @property
    def samples(self) -> Samples:
        """The samples so far, in the order in which they began; a copy."""
        columns = self._columns[:, : self._count]
        return Samples(columns[:2].T, columns[2], columns[3])

    def __len__(self) -> int:
        return self._count

    def _within_reach(self, x_m: float, y_m: float) -> int | None:
        if not self._count:
            return None
        offset = self._columns[:2, : self._count] - [[x_m], [y_m]]
        distance_m = np.hypot(offset[0], offset[1])
        nearest = int(distance_m.argmin())
        return nearest if distance_m[nearest] <= self.radius_m else None

    def _begin(self, x_m: float, y_m: float) -> int:
        if self._count == self._columns.shape[1]:
            self._columns = np.concatenate([self._columns, np.empty_like(self._columns)], axis=1)
        self._columns[:, self._count] = x_m, y_m, 0.0, 0.0
        self._count += 1
        return self._count - 1
