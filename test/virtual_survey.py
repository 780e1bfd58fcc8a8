# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""A simulated survey of a surrogate field for tests, with the files of a real logger and GNSS receiver."""

from __future__ import annotations

import math
from dataclasses import dataclass
from datetime import UTC, datetime
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from soilmoist_ros.sensing import LoggerRecord, Position, format_header, format_record
from soilmoist_ros.simulation.fields.catalogue import half_wet_field
from soilmoist_ros.simulation.fields.surrogate_field import SurrogateField, write_field_file, write_site_file
from soilmoist_ros.simulation.robot.scenario import SensorFaults
from soilmoist_ros.simulation.robot.virtual_devices import (
    NO_FAULTS,
    FaultySensor,
    morning_factors,
    nmea_sentences,
    warming_morning,
)

START_S = datetime(2026, 6, 1, 8, 0, tzinfo=UTC).timestamp()
RECORD_PERIOD_S = 10.0
TUBES = 12
HEADER_EVERY = 60


@dataclass(frozen=True)
class Trajectory:
    """Position of the robot over time.

    :param elapsed_s: times of the corner points [s], shape (n,), ascending from 0
    :param xy_m: positions at these times [m], shape (n, 2); linear in between
    """

    elapsed_s: NDArray[np.float64]
    xy_m: NDArray[np.float64]

    def at(self, elapsed_s: NDArray[np.float64]) -> NDArray[np.float64]:
        """Positions at given times [m], shape (k, 2)."""
        return np.column_stack([np.interp(elapsed_s, self.elapsed_s, axis) for axis in self.xy_m.T])


@dataclass(frozen=True)
class VirtualLog:
    """Output of the devices of the robot.

    :param logger_lines: lines of the neutron logger
    :param nmea_lines: sentences of the GNSS receiver
    :param records: the records in these lines
    """

    logger_lines: list[str]
    nmea_lines: list[str]
    records: list[LoggerRecord]


def stop_and_go(stops: NDArray[np.float64], dwell_s: float, speed_mps: float = 0.6) -> Trajectory:
    """Drive from stop to stop in straight lines and pause at each.

    :param stops: positions of the stops [m], shape (n, 2), n >= 1
    :param dwell_s: time at each stop [s], > 0
    :param speed_mps: speed between stops [m/s], > 0
    """
    travel_s = np.hypot(*np.diff(stops, axis=0).T) / speed_mps
    arrivals = np.concatenate([[0.0], np.cumsum(travel_s + dwell_s)])
    times = np.column_stack([arrivals, arrivals + dwell_s]).ravel()
    return Trajectory(times, np.repeat(stops, 2, axis=0))


def serpentine(polygon: NDArray[np.float64], spacing_m: float) -> NDArray[np.float64]:
    """Stops on a lattice over the bounding box of a field, in the order of back-and-forth lines, shape (n, 2)."""
    low, high = polygon.min(axis=0), polygon.max(axis=0)
    x, y = (
        low[axis] + (np.arange(max(1, round((high - low)[axis] / spacing_m))) + 0.5) * spacing_m for axis in (0, 1)
    )
    return np.array([(east, north) for row, north in enumerate(y) for east in (x if row % 2 == 0 else x[::-1])])


def simulate_log(
    field: SurrogateField,
    trajectory: Trajectory,
    rng: np.random.Generator,
    position_sd_m: float = 0.02,
    faults: SensorFaults = NO_FAULTS,
) -> VirtualLog:
    """Count along a trajectory in changing weather.

    The true rate at the robot is divided by the correction factors of the weather; the correction therefore
    restores the rate. Each tube counts its share of the rate as a Poisson variable.

    :param field: field to measure
    :param trajectory: position of the robot over time
    :param rng: source of all randomness
    :param position_sd_m: GNSS noise of each coordinate [m]
    :param faults: faults of the sensor
    """
    faulty = FaultySensor(faults, np.random.default_rng(0))
    shares = rng.dirichlet(np.full(TUBES, 400.0))
    ends = np.arange(RECORD_PERIOD_S, trajectory.elapsed_s[-1] + 1e-9, RECORD_PERIOD_S)
    records = []
    for number, end in enumerate(ends, start=1):
        inside = end - RECORD_PERIOD_S * (np.arange(10) + 0.5) / 10
        rate = float(field.rate_at(trajectory.at(inside)).mean())
        weather = warming_morning(float(end))
        factor = math.prod(morning_factors(float(end)))
        counts = rng.poisson(shares * rate / factor * RECORD_PERIOD_S)
        record = LoggerRecord(
            stamp_s=START_S + float(end), tube_counts=tuple(float(count) for count in counts),
            tube_live_s=(RECORD_PERIOD_S,) * TUBES, pressure_hpa=weather.pressure_hpa,
            temperature_degc=weather.temperature_degc, relative_humidity=weather.relative_humidity,
            record_number=number,
        )  # fmt: skip
        records.append(faulty.spoil(record, float(end)))
    lines = []
    for index, record in enumerate(records):
        if index % HEADER_EVERY == 0:
            lines.append(format_header(serial="virtual", period_s=RECORD_PERIOD_S, simulated=True))
        lines.append(format_record(record))
    return VirtualLog(lines, _nmea(field, trajectory, rng, position_sd_m), records)


def _nmea(field: SurrogateField, trajectory: Trajectory, rng: np.random.Generator, sd_m: float) -> list[str]:
    elapsed = np.arange(0.0, trajectory.elapsed_s[-1] + 1.0)
    places = trajectory.at(elapsed) + rng.normal(0.0, sd_m, (len(elapsed), 2))
    geographic = field.frame.to_geographic(places)
    lines = []
    for second, (latitude, longitude) in zip(elapsed, geographic, strict=True):
        lines += nmea_sentences(START_S + float(second), Position(latitude, longitude, 30.0, sd_m))
    return lines


def write_survey(
    folder: Path, seed: int, spacing_m: float = 10.0, dwell_s: float = 120.0, faults: SensorFaults = NO_FAULTS
) -> SurrogateField:
    """Survey the half-wet field and write the log, the NMEA and the files that ``soilmoist map`` needs.

    :param folder: folder to write to; created if missing
    :param seed: seed of all randomness
    :param spacing_m: distance between stops and between lines [m]
    :param dwell_s: time at each stop [s]
    :param faults: faults of the sensor
    """
    field = half_wet_field()
    trajectory = stop_and_go(serpentine(field.polygon, spacing_m), dwell_s)
    log = simulate_log(field, trajectory, np.random.default_rng(seed), faults=faults)
    folder.mkdir(parents=True, exist_ok=True)
    (folder / "survey.log").write_text("\n".join(log.logger_lines) + "\n", encoding="ascii")
    (folder / "survey.nmea").write_text("\r\n".join(log.nmea_lines) + "\r\n", encoding="ascii", newline="")
    write_field_file(field, folder / "field.yaml")
    write_site_file(field, folder / "site.yaml")
    return field
