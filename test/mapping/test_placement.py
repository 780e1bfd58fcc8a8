# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Where samples lie, and what is known before (knowledge.py)."""

from __future__ import annotations

import re

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from soilmoist_ros.foundation import InputError, LocalFrame
from soilmoist_ros.mapping import Field, PositionSource, require_near, survey_samples
from soilmoist_ros.mapping.knowledge import NOTHING, EarlierSurvey, Knowledge, samples_at_end
from soilmoist_ros.mapping.samples import NO_SAMPLES, Samples
from soilmoist_ros.sensing.records import CountRecord

RECTANGLE = np.array([[0.0, 0.0], [300.0, 0.0], [300.0, 200.0], [0.0, 200.0]])
LOG = PositionSource("survey.log")
RNG = np.random.default_rng(1)


def field_at(latitude_deg, longitude_deg):
    return Field("north", LocalFrame(latitude_deg, longitude_deg), RECTANGLE)


def records_in(field):
    return field.frame.to_geographic(RNG.uniform((5.0, 5.0), (295.0, 195.0), (50, 2)))


KANSAS, ENGLAND = field_at(38.712, -97.431), field_at(53.268, -0.5245)


def refusal(field, latlon, source=LOG):
    with pytest.raises(InputError) as caught:
        require_near(field, latlon, 300.0, source)
    (mistake,) = caught.value.mistakes
    return mistake


def test_records_inside_and_outside_are_counted():
    xy = [(10.0, 10.0), (299.0, 199.0), (350.0, 100.0), (np.nan, np.nan)]
    latlon = KANSAS.frame.to_geographic(xy)
    placement = require_near(KANSAS, latlon, 0.0, PositionSource())
    assert (placement.inside, len(placement.latlon), placement.nearest_m) == (2, 3, 0.0)


def test_records_of_another_continent_are_refused_with_distance_and_direction():
    mistake = refusal(ENGLAND, records_in(KANSAS))
    assert "all 50 records lie 7,08" in mistake.message
    assert "km north-west (bearing 300 deg) of the field 'north'" in mistake.message
    assert "survey.log has records at 38.71" in mistake.remedy
    assert "the field lies at 53.26" in mistake.remedy


def test_the_other_side_of_the_earth_is_no_exception():
    mistake = refusal(KANSAS, records_in(field_at(-38.7, 82.5)))
    assert re.search(r"records lie (19,9|20,0)\d\d km", mistake.message)  # the geodesic is exact to 1 % there


@pytest.mark.parametrize(
    ("wrong", "advice"),
    [
        (lambda lat, lon: (lat, -lon), "sign of the longitude"),
        (lambda lat, lon: (-lat, lon), "sign of the latitude"),
        (lambda lat, lon: (-lat, -lon), "signs of latitude and longitude"),
        (lambda lat, lon: (np.trunc(lat) + 0.6 * (lat % 1), np.fix(lon) - 0.6 * (-lon % 1)), "decimal degrees"),
    ],
)
def test_the_mistake_in_the_positions_is_named(wrong, advice):
    field = field_at(53.768, -1.4245)
    places = np.column_stack(wrong(*records_in(field).T))
    assert advice in refusal(field, places).remedy


def test_swapped_coordinates_are_named_whatever_their_signs():
    for latitude, longitude in ((53.268, -0.5245), (-33.5, -70.4), (-33.9, 18.4)):
        field = field_at(latitude, longitude)
        places = records_in(field)
        for sign in (1, -1):
            assert "swap latitude and longitude" in refusal(field, sign * places[:, ::-1]).remedy


@pytest.mark.parametrize(("had", "needed"), [("east", "west"), ("west", "east")])
def test_the_site_file_is_named_where_it_gives_the_sign(had, needed):
    places = records_in(KANSAS) * (1, -1)
    assert (
        f"'longitude: {needed}' in the site file" in refusal(KANSAS, places, PositionSource("a.log", had)).remedy
    )


def test_records_next_to_the_field_are_within_reach():
    beside = KANSAS.frame.to_geographic([(500.0, 100.0)])
    assert require_near(KANSAS, beside, 300.0, PositionSource()).nearest_m == pytest.approx(200.0)
    with pytest.raises(InputError, match=r"the only record lies 200 m east \(bearing 90 deg\)"):
        require_near(KANSAS, beside, 150.0, PositionSource())


def test_records_without_a_place_are_not_judged():
    assert require_near(KANSAS, [], 1.0, PositionSource()) is None
    assert require_near(KANSAS, [(np.nan, 3.0)], 1.0, PositionSource()) is None


@settings(max_examples=30)
@given(
    latitude=st.floats(-80, 80),
    longitude=st.floats(-180, 180),
    east_m=st.floats(-5e4, 5e4),
    north_m=st.floats(-5e4, 5e4),
)
def test_a_record_is_refused_if_and_only_if_it_is_beyond_reach(latitude, longitude, east_m, north_m):
    field = field_at(latitude, longitude)
    beyond_m = np.hypot(max(east_m - 300, 0, -east_m), max(north_m - 200, 0, -north_m))
    if abs(beyond_m - 1000.0) < 1.0:
        return
    latlon = field.frame.to_geographic([(east_m, north_m)])
    if beyond_m > 1000.0:
        with pytest.raises(InputError, match="the only record lies"):
            require_near(field, latlon, 1000.0, PositionSource())
    else:
        assert require_near(field, latlon, 1000.0, PositionSource()) is not None


# Knowledge -------------------------------------------------------------------------------------------------------

ONE = Samples([(5.0, 5.0)], [300], [100.0])


def test_knowledge_is_empty_unless_something_is_known():
    assert NOTHING.is_empty
    assert not Knowledge(earlier=(EarlierSurvey("may", 0.0, ONE),)).is_empty


def test_an_earlier_survey_needs_samples_and_a_time():
    with pytest.raises(ValueError, match="no samples"):
        EarlierSurvey("may", 0.0, NO_SAMPLES)
    with pytest.raises(ValueError, match="stamp_s"):
        EarlierSurvey("may", float("nan"), ONE)


def records(change):
    """Three passes over the same stops in two hours, while the rate changes by a share."""
    rng = np.random.default_rng(3)
    x, y = np.meshgrid(np.arange(5.0, 60, 10), np.arange(5.0, 50, 10))
    stops = np.tile(np.column_stack([x.ravel(), y.ravel()]), (3, 1))
    time_s = np.linspace(60, 7200, len(stops))
    rate = 4.0 + 0.5 * np.sin(stops[:, 0] / 15) + change * 4 * (time_s / 7200 - 1)
    return [
        CountRecord(time, *place, 0.0, int(counts), 60.0, 60.0)
        for time, place, counts in zip(
            time_s.tolist(), stops.tolist(), rng.poisson(60 * rate).tolist(), strict=True
        )
    ]


@pytest.mark.parametrize(("change", "near"), [(0.3, True), (0.0, False)])
def test_a_drift_is_taken_off_and_nothing_else(change, near):
    then, now = survey_samples(records(change), 2.0), samples_at_end(records(change), 2.0, 0.0, 60.0)
    np.testing.assert_array_equal(then.xy, now.xy)
    np.testing.assert_array_equal(then.counts, now.counts)
    if near:
        expected = 4.0 + 0.5 * np.sin(now.xy[:, 0] / 15)
        assert abs(np.mean(now.rate_cps - expected)) < 0.15 < np.mean(expected - then.rate_cps)
    else:
        np.testing.assert_array_equal(then.exposure_s, now.exposure_s)
