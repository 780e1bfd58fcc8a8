# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Virtual sensor with faults, logger and GNSS receiver: virtual_devices.py."""

import math
from functools import cache

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from soilmoist_ros.foundation.geodesy import LocalFrame
from soilmoist_ros.mapping.field_map import FieldMap, FieldMapSettings
from soilmoist_ros.sensing import FORMAT_NAME, Corrections, FixStatus, LoggerRecord, Position, Site, parse_nmea
from soilmoist_ros.sensing.corrections.factors import effective_exposure
from soilmoist_ros.sensing.formats.logger_reader import RecordParser
from soilmoist_ros.sensing.position.nmea import NmeaParser
from soilmoist_ros.sensing.survey.survey import Survey
from soilmoist_ros.simulation.fields.catalogue import half_wet_field, surrogate_field
from soilmoist_ros.simulation.robot.scenario import SensorFaults
from soilmoist_ros.simulation.robot.virtual_devices import (
    NO_FAULTS,
    FaultySensor,
    VirtualGnss,
    VirtualLogger,
    VirtualSensor,
    nmea_sentences,
)
from virtual_survey import serpentine, simulate_log, stop_and_go

FOREVER = 1e9
GOOD = LoggerRecord(1e9, (40.0,) * 3, (10.0,) * 3, 1000.0, 20.0, 0.5, record_number=1)


def spoil(faults, record=GOOD, elapsed_s=10.0, sensor=None):
    sensor = sensor or FaultySensor(SensorFaults.model_validate(faults), np.random.default_rng(1))
    return sensor.spoil(record, elapsed_s)


def test_a_good_sensor_sends_its_records_as_they_are():
    assert spoil({}) is GOOD


def test_each_fault_changes_what_it_names():
    dead = {"tube": 2, "kind": "factor", "value": 0, "at_s": 0, "for_s": 100}
    assert spoil({"tubes": [dead]}).tube_counts == (40.0, 0.0, 40.0)
    assert spoil({"tubes": [{**dead, "kind": "stuck", "value": 7}]}).tube_counts == (40.0, 7.0, 40.0)
    assert spoil({"tubes": [{**dead, "kind": "noise", "value": 100}]}).tube_counts[1] == pytest.approx(
        1040, rel=0.2
    )
    assert spoil({"tubes": [{**dead, "kind": "factor", "value": 5}]}).tube_counts[1] == pytest.approx(200, rel=0.3)
    assert spoil({"tubes": [dead]}, elapsed_s=100.0) == GOOD
    assert spoil({"counts": [{"tube": 1, "nth": 1, "counts": 1_200_000}]}).tube_counts[0] == 1.2e6
    assert spoil({"counts": [{"tube": 1, "nth": 2, "counts": 9}]}) == GOOD
    weather = {"quantity": "pressure_hpa", "value": 300, "at_s": 0, "for_s": 100}
    assert spoil({"weather": [weather]}).pressure_hpa == 300.0


@cache
def map_error(faults=NO_FAULTS):
    """Error of the map that grows record by record [counts/s], and the records that it left out."""
    field = half_wet_field()
    trajectory = stop_and_go(serpentine(field.polygon, 12.0), 120.0)
    log = simulate_log(field, trajectory, np.random.default_rng(2), faults=faults)
    fixes, _ = parse_nmea([line.encode() for line in log.nmea_lines], None)
    survey, grid = Survey(Site(), field.frame), field.field.grid(2.0, 10.0)
    growing = FieldMap(grid, FieldMapSettings(merge_radius_m=2.5))
    for record in log.records:
        while fixes and fixes[0].stamp_s <= record.stamp_s:
            survey.take_fix(fixes.pop(0))
        survey.take_record(record, record.stamp_s)
        for ready in survey.take_ready(record.stamp_s):
            growing.add(ready)
    error = growing.update().rate[grid.mask] - field.rate_at(grid.cells)
    return float(np.sqrt(np.mean(error**2))), sum(bool(record.quarantine) for record in growing.track)


@pytest.mark.slow
@pytest.mark.parametrize(
    "faults",
    [
        {"tubes": [{"tube": 3, "kind": "factor", "value": 0, "at_s": 900, "for_s": FOREVER}]},
        {"tubes": [{"tube": 7, "kind": "noise", "value": 30, "at_s": n, "for_s": 60} for n in (600, 1200, 1800)]},
        {"tubes": [{"tube": n, "kind": "noise", "value": 4, "at_s": 1500, "for_s": 600} for n in range(1, 13)]},
    ],
    ids=["dead tube", "bursts", "all tubes noisy"],
)
def test_the_map_of_a_faulty_sensor_is_within_10_percent_of_that_of_a_good_one(faults):
    clean, left_out = map_error()
    assert math.isfinite(clean)
    assert left_out == 0
    assert map_error(SensorFaults.model_validate(faults))[0] < 1.1 * clean


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


FRAME = LocalFrame(53.2680, -0.5245)
EPOCH_S = 1_780_000_000.0


def parsed(lines):
    parser = NmeaParser()
    fixes = [parser.feed(f"{line}\r\n".encode()) for line in lines]
    fixes.append(parser.flush())
    assert parser.problems == []
    return [fix for fix in fixes if fix is not None]


@settings(deadline=None)
@given(
    st.floats(-89.99, 89.99).filter(lambda value: abs(value) > 1e-8),
    st.floats(-179.99, 179.99),
    st.integers(10**11, 3 * 10**11),
)
def test_written_positions_are_read_back(latitude, longitude, hundredths):
    fix = parsed(nmea_sentences(hundredths / 100, Position(latitude, longitude, 30.0, 0.02)))[0]
    assert fix.position.latitude_deg == pytest.approx(latitude, abs=2e-9)
    assert fix.position.longitude_deg == pytest.approx(longitude, abs=2e-9)
    assert fix.stamp_s == pytest.approx(hundredths / 100, abs=1e-6)
    assert fix.position.horizontal_sd_m == pytest.approx(0.02)
    assert fix.status is FixStatus.RTK


def test_a_lost_fix_has_time_only_and_does_not_change_later_noise():
    def sentences(lost):
        gnss = VirtualGnss(FRAME, EPOCH_S, 0.05, np.random.default_rng(1))
        return [gnss.sentences(float(second), (1.0, 2.0), second not in lost) for second in range(6)]

    whole, broken = sentences(()), sentences((2, 3))
    assert whole[4:] == broken[4:]
    # without a fix, a receiver sends no GST: only the next epoch shows that this epoch is complete
    lost = parsed([line for epoch in broken for line in epoch])[2]
    assert lost.status is FixStatus.NO_FIX
    assert lost.stamp_s == EPOCH_S + 2
