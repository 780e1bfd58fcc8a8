# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""A simulated neutron logger: its lines have the format of the real logger."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from soilmoist_ros.sensing import TUBES, LoggerRecord, format_header, format_record
from soilmoist_ros.simulation.robot.scenario import SensorFaults
from soilmoist_ros.simulation.robot.sensor_faults import NO_FAULTS, FaultySensor
from soilmoist_ros.simulation.robot.virtual_sensor import VirtualSensor
from soilmoist_ros.simulation.robot.weather import neutral_weather, warming_morning

Array = NDArray[np.float64]

_NOWHERE = (math.nan, math.nan)

RECORDS_PER_HEADER = 60
"""Number of records after which the header is repeated; it is also sent on connection."""


class VirtualLogger:
    """Writes the counts of a virtual sensor in the format of the robot's logger.

    The sensor draws the counts of all tubes together from a separate random stream. The total counts therefore
    equal the counts of a simulation without a logger. A multinomial draw divides the total among the tubes, which
    keeps the counts of each tube Poisson.

    :param sensor: the sensor
    :param start_s: time at which the simulation begins [s since 1970 UTC]
    :param rng: source of randomness for the tubes
    :param faults: faults of the sensor
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
        """Count over the interval that ends now.

        :param elapsed_s: time since the start [s]
        :param path_xy: positions at evenly spaced times within the interval, shape (m, 2) [m]
        """
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
