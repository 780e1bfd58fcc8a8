# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""A faulty sensor, and the map that a survey makes of its records."""

import math
from functools import cache

import numpy as np
import pytest

from soilmoist_ros.mapping.field_map import FieldMap, FieldMapSettings
from soilmoist_ros.sensing.moisture.site import Site
from soilmoist_ros.sensing.position.nmea import parse_nmea
from soilmoist_ros.sensing.records import LoggerRecord
from soilmoist_ros.sensing.survey.survey import Survey
from soilmoist_ros.simulation.fields.catalogue import half_wet_field
from soilmoist_ros.simulation.robot.scenario import SensorFaults
from soilmoist_ros.simulation.robot.virtual_devices import NO_FAULTS, FaultySensor
from soilmoist_ros.simulation.robot.virtual_survey import serpentine, simulate_log, stop_and_go

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
    assert spoil({"clock_drift": 0.01}, elapsed_s=100.0).stamp_s == GOOD.stamp_s + 1.0
    weather = {"quantity": "pressure_hpa", "value": 300, "at_s": 0, "for_s": 100}
    assert spoil({"weather": [weather]}).pressure_hpa == 300.0


def test_without_a_value_a_weather_sensor_repeats_its_last_one():
    frozen = {"weather": [{"quantity": "temperature_degc", "at_s": 15, "for_s": 100}]}
    sensor = FaultySensor(SensorFaults.model_validate(frozen), np.random.default_rng(1))
    records = [LoggerRecord(0.0, (1.0,), (10.0,), 1000.0, float(degrees), 0.5) for degrees in range(4)]
    found = [sensor.spoil(record, 10.0 * n).temperature_degc for n, record in enumerate(records, 1)]
    assert found == [0.0, 0.0, 0.0, 0.0]


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
        {"tubes": [{"tube": n, "kind": "noise", "value": 4, "at_s": 1500, "for_s": 60} for n in range(1, 13)]},
        {"weather": [{"quantity": "pressure_hpa", "value": 300, "at_s": 900, "for_s": 600}]},
    ],
    ids=["dead tube", "bursts", "all tubes noisy", "300 hPa"],
)
def test_the_map_of_a_faulty_sensor_is_within_10_percent_of_that_of_a_good_one(faults):
    clean, left_out = map_error()
    assert math.isfinite(clean)
    assert left_out == 0
    assert map_error(SensorFaults.model_validate(faults))[0] < 1.1 * clean
