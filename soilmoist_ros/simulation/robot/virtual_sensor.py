# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""A simulated neutron sensor that counts at the position of the robot."""

from __future__ import annotations

import math
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from soilmoist_ros.sensing import CountRecord, Footprint
from soilmoist_ros.simulation.fields.surrogate_field import SurrogateField
from soilmoist_ros.simulation.robot.drift import STEADY, Drift
from soilmoist_ros.simulation.robot.weather import morning_factors

Array = NDArray[np.float64]

RINGS, PLACES_PER_RING = 12, 8


class VirtualSensor:
    """Counts neutrons over a surrogate field.

    The true rate is divided by the correction factors of the weather. The record contains the factors that a
    driver computes from the logged weather; the correction therefore restores the true rate.

    :param field: field to measure
    :param rng: source of all randomness
    :param cadence_s: duration of a record [s], > 0
    :param footprint_m: radius from within which 86 % of the counts come [m]; 0 for a point sensor
    :param weather: whether the weather changes
    :param drift: how the true rate changes with time
    """

    def __init__(
        self,
        field: SurrogateField,
        rng: np.random.Generator,
        cadence_s: float = 10.0,
        footprint_m: float = 0.0,
        weather: bool = True,
        drift: Drift = STEADY,
    ) -> None:
        if not (math.isfinite(cadence_s) and cadence_s > 0):
            raise ValueError(f"cadence_s must be > 0 and finite, got {cadence_s}")
        if not (math.isfinite(footprint_m) and footprint_m >= 0):
            raise ValueError(f"footprint_m must be >= 0 and finite, got {footprint_m}")
        self.field = field
        self.rng = rng
        self.cadence_s = cadence_s
        self.weather = weather
        self.drift = drift
        self._stood: tuple[list[float], float] = [], math.nan  # last position and rate at rest
        self._offsets = _footprint_points(footprint_m)

    def rate_at(self, xy: Array) -> Array:
        """True rate before any drift, averaged over the footprint, at positions of shape (n, 2) [counts/s]."""
        if len(self._offsets) == 1:
            return self.field.rate_at(xy)
        seen = (xy[:, None, :] + self._offsets).reshape(-1, 2)
        return np.asarray(self.field.rate_at(seen).reshape(len(xy), -1).mean(axis=1))

    def record(self, end_s: float, path_xy: Array, reported_xy: tuple[float, float]) -> CountRecord:
        """The record of the counting interval that ends at ``end_s``.

        :param end_s: end of the interval [s]
        :param path_xy: positions at evenly spaced times within the interval, shape (m, 2) [m]; one is enough at
            rest
        :param reported_xy: position at the middle of the interval as the GNSS reports it [m]
        """
        # At rest, all positions are equal, and often equal to the positions of the previous record.
        begin, end = path_xy[0].tolist(), path_xy[-1].tolist()
        if begin != end:
            rate = float(self.rate_at(path_xy).mean())
        elif begin == self._stood[0]:
            rate = self._stood[1]
        else:
            rate = float(self.rate_at(path_xy[:1]).mean())
            self._stood = begin, rate
        rate *= self.drift.factor(end_s - self.cadence_s / 2)
        f_pressure, f_humidity = morning_factors(end_s) if self.weather else (1.0, 1.0)
        factor = f_pressure * f_humidity
        return CountRecord(
            stamp_s=end_s,
            x_m=reported_xy[0],
            y_m=reported_xy[1],
            z_m=0.0,
            raw_counts=int(self.rng.poisson(rate / factor * self.cadence_s)),
            exposure_s=self.cadence_s,
            effective_exposure_s=self.cadence_s / factor,
            f_pressure=f_pressure,
            f_humidity=f_humidity,
        )


@lru_cache
def _footprint_points(radius_m: float) -> Array:
    """Offsets of places that send equal shares of the counts, shape (q, 2) [m].

    They lie on rings, each turned by half a step, that follow the published weights of distance.
    """
    if radius_m == 0:
        return np.zeros((1, 2))
    ring_m = np.repeat(Footprint.shielded(radius_m).rings(RINGS), PLACES_PER_RING)
    number = np.arange(len(ring_m))
    angle = 2 * np.pi / PLACES_PER_RING * (number + 0.5 * (number // PLACES_PER_RING))
    return np.asarray(ring_m[:, None] * np.column_stack([np.cos(angle), np.sin(angle)]))
