# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""A neutron sensor with bad tubes, weather sensors and clock, as a scenario defines."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from soilmoist_ros.sensing import LoggerRecord
from soilmoist_ros.simulation.robot.scenario import SensorFaults, TubeFault

NO_FAULTS = SensorFaults()


class FaultySensor:
    """Spoils the records of a good sensor.

    :param faults: what goes wrong
    :param rng: source of randomness; separate, so that the good counts stay the same
    """

    def __init__(self, faults: SensorFaults, rng: np.random.Generator) -> None:
        self._faults, self._rng = faults, rng
        self._last: LoggerRecord | None = None

    def spoil(self, record: LoggerRecord, elapsed_s: float) -> LoggerRecord:
        """The record as the faulty sensor sends it.

        :param record: record of a good sensor
        :param elapsed_s: time since the start at its end [s]
        """
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
        drift_s = self._faults.clock_drift * elapsed_s
        sent = replace(record, tube_counts=tuple(counts), stamp_s=record.stamp_s + drift_s)
        for weather in self._faults.weather:
            if weather.covers(elapsed_s):
                before = getattr(self._last or sent, weather.quantity)
                value = before if weather.value is None else weather.value
                sent = _with_weather(sent, weather.quantity, value)
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


def _with_weather(record: LoggerRecord, quantity: str, value: float) -> LoggerRecord:
    match quantity:
        case "pressure_hpa":
            return replace(record, pressure_hpa=value)
        case "temperature_degc":
            return replace(record, temperature_degc=value)
        case _:
            return replace(record, relative_humidity=value)
