# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""The steps from a raw record to a corrected, geo-tagged record."""

import math

import numpy as np
import pytest

from soilmoist_ros.foundation.geodesy import LocalFrame
from soilmoist_ros.sensing.corrections.intensity import NeutronMonitor
from soilmoist_ros.sensing.moisture.site import Site
from soilmoist_ros.sensing.problems import Kind
from soilmoist_ros.sensing.records import CountRecord, LoggerRecord, Position
from soilmoist_ros.sensing.survey.correction import (
    UnusableRecordError,
    correct_record,
    counting_interval_s,
    place_record,
    position_gap_s,
)

NAN = math.nan
ONE = np.array([1.0])
INTENSITY = Site(
    corrections={"pressure": None, "humidity": None, "intensity": {"reference": 150, "constant": 100}}
)


def record(stamp_s: float, live_s: float = 10.0, pressure_hpa: float = 1000.0) -> LoggerRecord:
    return LoggerRecord(stamp_s, (50.0,), (live_s,), pressure_hpa, 20.0, 0.5)


def test_the_exposure_is_divided_by_the_product_of_the_factors() -> None:
    found = correct_record(record(0.0), Site(), None, ONE)
    assert found.f_pressure == pytest.approx(math.exp(0.0077 * (1000 - 1013.25)))
    assert found.effective_exposure_s == pytest.approx(10.0 / (found.f_pressure * found.f_humidity))
    assert (found.raw_counts, found.exposure_s) == (50, 10.0)
    assert math.isnan(found.x_m)


def test_the_intensity_is_constant_or_that_of_the_monitor_at_the_time() -> None:
    monitor = NeutronMonitor(np.array([0.0, 100.0]), np.array([100.0, 200.0]))
    assert correct_record(record(50.0), INTENSITY, 75.0, ONE).f_intensity == 2.0
    assert correct_record(record(50.0), INTENSITY, monitor, ONE).f_intensity == 1.0
    with pytest.raises(UnusableRecordError, match=r"the neutron monitor.*has no rate at this time") as caught:
        correct_record(record(101.0), INTENSITY, monitor, ONE)
    assert caught.value.kind is Kind.NO_CORRECTION


@pytest.mark.parametrize(
    ("raw", "kind"), [(record(0.0, NAN), Kind.NO_COUNTS), (record(0.0, pressure_hpa=NAN), Kind.NO_CORRECTION)]
)
def test_an_unusable_record_has_a_reason(raw, kind) -> None:
    with pytest.raises(UnusableRecordError) as caught:
        correct_record(raw, Site(), None, ONE)
    assert caught.value.kind is kind


def test_a_record_is_placed_in_the_plane_or_not_at_all() -> None:
    corrected = CountRecord(0.0, NAN, NAN, NAN, 50, 10.0, 10.0)
    frame = LocalFrame(50.0, 10.0)
    latitude, longitude = frame.to_geographic((30.0, -40.0))[0].tolist()
    placed = place_record(corrected, Position(latitude, longitude, 5.0), frame)
    assert (placed.x_m, placed.y_m, placed.z_m) == (pytest.approx(30.0), pytest.approx(-40.0), 5.0)
    for position in (None, Position(-50.0, -170.0)):
        with pytest.raises(UnusableRecordError) as caught:
            place_record(corrected, position, frame)
        assert caught.value.kind is Kind.NO_POSITION


@pytest.mark.parametrize(
    ("since_s", "interval_s"),
    [(9.9, 10.0), (10.0, 10.0), (10.5, 10.5), (15.0, 15.0), (15.01, 10.0), (600.0, 10.0)],
)
def test_the_interval_begins_at_the_record_before_up_to_one_and_a_half_live_times(since_s, interval_s) -> None:
    assert counting_interval_s(record(100.0 + since_s), record(100.0)) == pytest.approx(interval_s)


def test_the_first_record_counted_for_its_live_time() -> None:
    assert counting_interval_s(record(100.0), None) == 10.0


def test_positions_are_interpolated_over_three_intervals_and_at_least_five_seconds() -> None:
    assert (position_gap_s(10.0), position_gap_s(1.0)) == (30.0, 5.0)
