# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Virtual devices of a robot: neutron sensor with its faults, logger and GNSS receiver, in a morning's weather."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from soilmoist_ros.foundation import LocalFrame
from soilmoist_ros.sensing import (
    RECORDS_PER_HEADER,
    TUBES,
    Corrections,
    CountRecord,
    Footprint,
    LoggerRecord,
    Position,
    format_header,
    format_record,
    nmea_sentences,
    sentences_without_fix,
)
from soilmoist_ros.simulation.fields.surrogate_field import SurrogateField
from soilmoist_ros.simulation.robot.scenario import STEADY, RateDrift, SensorFaults, TubeFault

Array = NDArray[np.float64]
RINGS, PLACES_PER_RING = 12, 8
NO_FAULTS = SensorFaults()
_NOWHERE = (math.nan, math.nan)
ALTITUDE_M = 30.0  # altitude of every surrogate field above mean sea level [m]


@dataclass(frozen=True, slots=True)
class Weather:
    """Weather as a logger records it."""

    pressure_hpa: float  # air pressure [hPa]
    temperature_degc: float  # air temperature [degC]
    relative_humidity: float  # relative humidity [0..1]


def warming_morning(elapsed_s: float) -> Weather:
    """Weather of a warming, drying morning with slowly varying pressure, rounded as in the log."""
    hours = elapsed_s / 3600
    return Weather(
        pressure_hpa=round(1009.0 + 2.5 * math.sin(0.8 * hours), 1),
        temperature_degc=round(14.0 + 3.0 * min(hours, 5.0), 1),
        relative_humidity=round(0.75 - 0.08 * min(hours, 5.0), 3),
    )


@lru_cache(maxsize=10_000)
def morning_factors(elapsed_s: float) -> tuple[float, float]:
    """Correction factors of :func:`warming_morning` for pressure and humidity by the default corrections [-].

    The cache is effective because the records of all missions of a campaign end at the same times.
    """
    weather, corrections = warming_morning(elapsed_s), Corrections()
    f_humidity = corrections.f_humidity(weather.temperature_degc, weather.relative_humidity)
    return corrections.f_pressure(weather.pressure_hpa), f_humidity


def neutral_weather(elapsed_s: float) -> Weather:
    """Constant weather for which the default corrections are 1: reference pressure, dry air."""
    return Weather(pressure_hpa=1013.25, temperature_degc=15.0, relative_humidity=0.0)


class VirtualSensor:
    """Counts neutrons over a surrogate field.

    The true rate is divided by the correction factors of the weather. The record contains the factors that a
    driver computes from the logged weather; the correction therefore restores the true rate.
    :param footprint_m: radius from within which 86 % of the counts come [m]; 0 for a point sensor
    """

    def __init__(
        self,
        field: SurrogateField,
        rng: np.random.Generator,
        cadence_s: float = 10.0,
        footprint_m: float = 0.0,
        weather: bool = True,
        drift: RateDrift = STEADY,
    ) -> None:
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
            stamp_s=end_s, x_m=reported_xy[0], y_m=reported_xy[1], z_m=0.0,
            raw_counts=int(self.rng.poisson(rate / factor * self.cadence_s)), exposure_s=self.cadence_s,
            effective_exposure_s=self.cadence_s / factor, f_pressure=f_pressure, f_humidity=f_humidity,
        )  # fmt: skip


@lru_cache
def _footprint_points(radius_m: float) -> Array:
    """Offsets of places that send equal shares of the counts, shape (q, 2) [m]."""
    if radius_m == 0:
        return np.zeros((1, 2))
    ring_m = np.repeat(Footprint.shielded(radius_m).rings(RINGS), PLACES_PER_RING)
    number = np.arange(len(ring_m))
    angle = 2 * np.pi / PLACES_PER_RING * (number + 0.5 * (number // PLACES_PER_RING))
    return np.asarray(ring_m[:, None] * np.column_stack([np.cos(angle), np.sin(angle)]))


class FaultySensor:
    """Spoils the records of a good sensor, by randomness of its own: the good counts stay the same."""

    def __init__(self, faults: SensorFaults, rng: np.random.Generator) -> None:
        self._faults, self._rng = faults, rng
        self._last: LoggerRecord | None = None

    def spoil(self, record: LoggerRecord, elapsed_s: float) -> LoggerRecord:
        """The record of a good sensor, at a time since the start, as the faulty sensor sends it."""
        if self._faults == NO_FAULTS:
            return record
        counts = list(record.tube_counts)
        for tube in self._faults.tubes:
            if tube.covers(elapsed_s) and tube.tube <= len(counts):
                index = tube.tube - 1
                counts[index] = self._counted(tube, counts[index], record.tube_live_s[index])
        for single in self._faults.counts:
            if single.hits(record.record_number) and single.tube <= len(counts):
                counts[single.tube - 1] = float(single.counts)
        sent = replace(record, tube_counts=tuple(counts))
        for weather in self._faults.weather:
            if weather.covers(elapsed_s):
                before = getattr(self._last or sent, weather.quantity)
                value = before if weather.value is None else weather.value
                sent = replace(sent, **{weather.quantity: value})  # type: ignore[arg-type]
        self._last = sent
        return sent

    def _counted(self, fault: TubeFault, counts: float, live_s: float) -> float:
        if fault.kind == "stuck":
            return float(round(fault.value))
        if fault.kind == "noise":
            return counts + float(self._rng.poisson(fault.value * live_s))
        if fault.value <= 1:
            return float(self._rng.binomial(round(counts), fault.value))
        return counts + float(self._rng.poisson((fault.value - 1) * counts))


class VirtualLogger:
    """Writes the counts of a virtual sensor in the format of the robot's logger.

    The sensor draws the counts of all tubes together from a separate random stream. The total counts therefore
    equal the counts of a simulation without a logger. A multinomial draw divides the total among the tubes, which
    keeps the counts of each tube Poisson.
    """

    def __init__(
        self, sensor: VirtualSensor, start_s: float, rng: np.random.Generator, faults: SensorFaults = NO_FAULTS
    ) -> None:
        self._sensor = sensor
        self._start_s = start_s
        self._rng = rng
        self._shares = rng.dirichlet(np.full(TUBES, 400.0))
        self._weather = warming_morning if sensor.weather else neutral_weather
        self._records = 0
        self._faulty = FaultySensor(faults, np.random.default_rng(0))

    @property
    def header(self) -> list[str]:
        """Lines that each client receives first."""
        return format_header("virtual", self._sensor.cadence_s, simulated=True).split("\n")

    def record(self, elapsed_s: float, path_xy: Array) -> LoggerRecord:
        """Count over the interval that ends now; parameters as of :meth:`VirtualSensor.record`."""
        counts = self._sensor.record(elapsed_s, path_xy, _NOWHERE).raw_counts
        weather = self._weather(elapsed_s)
        self._records += 1
        record = LoggerRecord(
            stamp_s=self._start_s + elapsed_s,
            tube_counts=tuple(float(count) for count in self._rng.multinomial(counts, self._shares)),
            tube_live_s=(self._sensor.cadence_s,) * TUBES,
            pressure_hpa=weather.pressure_hpa,
            temperature_degc=weather.temperature_degc,
            relative_humidity=weather.relative_humidity,
            record_number=self._records,
        )
        return self._faulty.spoil(record, elapsed_s)

    def lines(self, record: LoggerRecord) -> list[str]:
        """Lines of a record; the header is repeated every :data:`RECORDS_PER_HEADER` records."""
        repeated = record.record_number > 1 and record.record_number % RECORDS_PER_HEADER == 1
        return [*(self.header if repeated else []), format_record(record)]


class VirtualGnss:
    """A receiver on the robot, with the noise of each horizontal coordinate [m], >= 0."""

    def __init__(self, frame: LocalFrame, start_s: float, position_sd_m: float, rng: np.random.Generator) -> None:
        self._frame = frame
        self._start_s = start_s
        self._sd_m = position_sd_m
        self._rng = rng

    def sentences(self, elapsed_s: float, xy: tuple[float, float], has_fix: bool = True) -> list[str]:
        """Sentences of one epoch, with or without a position fix."""
        noise = self._rng.normal(0.0, self._sd_m, 2)  # always drawn: a lost fix must not change later noise
        if not has_fix:
            return sentences_without_fix(self._start_s + elapsed_s)
        latitude, longitude = self._frame.to_geographic(np.array(xy) + noise)[0].tolist()
        return nmea_sentences(self._start_s + elapsed_s, Position(latitude, longitude, ALTITUDE_M, self._sd_m))
