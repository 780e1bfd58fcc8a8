# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
import numpy as np
import pytest

from soilmoist_ros.sensing.corrections.factors import Corrections, effective_exposure
from soilmoist_ros.sensing.formats.logger_reader import RecordParser
from soilmoist_ros.sensing.formats.robot_logger import FORMAT_NAME
from soilmoist_ros.simulation.fields.catalogue import surrogate_field
from soilmoist_ros.simulation.robot.virtual_devices import VirtualLogger, VirtualSensor

START_S = 1_780_000_000.0
STANDING = np.array([[50.0, 25.0]] * 10)


def sensor(weather=True, cadence_s=10.0):
    return VirtualSensor(surrogate_field("half-wet"), np.random.default_rng(4), cadence_s, weather=weather)


def read(logger, records):
    parser = RecordParser(FORMAT_NAME)
    lines = [*logger.header, *(line for record in records for line in logger.lines(record))]
    found = [parser.feed(f"{line}\r\n".encode()) for line in lines]
    assert parser.problems == []
    return parser, [record for record in found if record is not None]


def test_lines_contain_the_counts_of_the_sensor():
    logger = VirtualLogger(sensor(), START_S, np.random.default_rng(9))
    records = [logger.record(10.0 * number, STANDING) for number in range(1, 131)]
    parser, found = read(logger, records)
    alone = sensor()
    expected = [alone.record(10.0 * number, STANDING, (0.0, 0.0)).raw_counts for number in range(1, 131)]
    assert [sum(record.tube_counts) for record in found] == expected
    assert [record.stamp_s for record in found] == [START_S + 10 * number for number in range(1, 131)]
    assert [record.record_number for record in found] == list(range(1, 131))
    assert parser.metadata["simulated"] == "yes"
    assert parser.period_s == 10


@pytest.mark.parametrize("weather", [True, False])
def test_the_logged_weather_is_the_applied_weather(weather):
    logger = VirtualLogger(sensor(weather), START_S, np.random.default_rng(9))
    _, found = read(logger, [logger.record(10.0 * number, STANDING) for number in range(1, 40)])
    alone, corrections = sensor(weather), Corrections()
    for number, record in enumerate(found, start=1):
        factor = corrections.f_pressure(record.pressure_hpa) * corrections.f_humidity(
            record.temperature_degc, record.relative_humidity
        )
        expected = alone.record(10.0 * number, STANDING, (0.0, 0.0)).effective_exposure_s
        assert effective_exposure(10.0, factor) == pytest.approx(expected, rel=1e-12)
        assert (factor == 1) == (not weather)


def test_the_tubes_have_similar_counts():
    logger = VirtualLogger(sensor(cadence_s=1000.0), START_S, np.random.default_rng(9))
    counts = np.array(logger.record(1000.0, STANDING).tube_counts)
    assert len(counts) == 12
    assert counts.min() > 0.5 * counts.mean()
    assert counts.max() < 1.5 * counts.mean()


def test_the_header_is_repeated_every_sixty_records():
    logger = VirtualLogger(sensor(), START_S, np.random.default_rng(9))
    lengths = [len(logger.lines(logger.record(10.0 * number, STANDING))) for number in range(1, 125)]
    assert [number for number, length in enumerate(lengths, start=1) if length > 1] == [61, 121]
