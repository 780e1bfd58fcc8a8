# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Lever arms: the heading from positions, and places of the sensor that are right in any heading."""

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from soilmoist_ros.foundation.geodesy import LocalFrame
from soilmoist_ros.sensing.gnss import Fix, FixStatus
from soilmoist_ros.sensing.moisture.site import Site
from soilmoist_ros.sensing.position.track import Course, LeverArms
from soilmoist_ros.sensing.problems import Kind
from soilmoist_ros.sensing.records import LoggerRecord, Position
from soilmoist_ros.sensing.survey.survey import Survey

FRAME = LocalFrame(52.0, 13.0)
SITE = Site(corrections={"pressure": None, "humidity": None})
headings = st.floats(-math.pi, math.pi)
offsets = st.tuples(st.floats(-3, 3), st.floats(-3, 3))


def position(x_m, y_m, sd_m=0.02):
    latitude, longitude = FRAME.to_geographic([(x_m, y_m)])[0].tolist()
    return Position(latitude, longitude, 30.0, sd_m)


def seen_from(base, offset, heading):
    """Place of a thing on the robot."""
    cosine, sine = math.cos(heading), math.sin(heading)
    return base[0] + cosine * offset[0] - sine * offset[1], base[1] + sine * offset[0] + cosine * offset[1]


def surveyed(arms, heading, steps=30):
    """Records of a drive of a metre a second along a heading, and the problems; and where the sensor was."""
    problems = []
    survey = Survey(SITE, FRAME, arms=arms, on_problem=problems.append)
    records, wanted = [], []
    for second in range(steps):
        base = (second * math.cos(heading), second * math.sin(heading))
        antenna = seen_from(base, arms.antenna_m, heading)
        survey.take_fix(Fix(1000.0 + second, position(*antenna), FixStatus.RTK))
        if second % 10 == 0 and second:
            survey.take_record(LoggerRecord(1000.0 + second, (5.0,), (10.0,)))
            middle = ((second - 5) * math.cos(heading), (second - 5) * math.sin(heading))
            wanted.append(seen_from(middle, arms.sensor_m, heading))
            records += survey.take_ready()
    return records, wanted, problems


@settings(max_examples=20)
@given(offsets, offsets, headings)
def test_a_record_is_where_the_sensor_is(antenna, sensor, heading):
    records, wanted, problems = surveyed(LeverArms(antenna, sensor), heading)
    assert len(records) == 2
    for record, place in zip(records, wanted, strict=True):
        assert math.dist((record.x_m, record.y_m), place) < 0.02
    assert not [problem for problem in problems if problem.kind is Kind.NO_HEADING]


def test_without_lever_arms_no_bit_changes():
    plain, _, _ = surveyed(LeverArms(), 0.7)
    middle = position(5 * math.cos(0.7), 5 * math.sin(0.7))
    assert (plain[0].x_m, plain[0].y_m) == tuple(FRAME.to_local(middle.latitude_deg, middle.longitude_deg)[0])


def test_without_a_heading_the_place_is_the_antennas_and_it_is_noted():
    problems = []
    survey = Survey(SITE, FRAME, arms=LeverArms(sensor_m=(2.0, 0.0)), on_problem=problems.append)
    for second in range(20):
        survey.take_fix(Fix(1000.0 + second, position(7.0, 8.0), FixStatus.RTK))
    survey.take_record(LoggerRecord(1010.0, (5.0,), (10.0,)))
    (record,) = survey.take_ready()
    assert (record.x_m, record.y_m) == pytest.approx((7.0, 8.0))
    assert [problem.kind for problem in problems] == [Kind.NO_HEADING]
    assert not problems[0].lost


def test_a_probe_at_a_fixed_location_is_where_the_site_file_says():
    site = Site(corrections=SITE.corrections, location={"latitude_deg": 52.0, "longitude_deg": 13.0})
    survey = Survey(site, FRAME, arms=LeverArms(sensor_m=(2.0, 0.0)))
    survey.take_record(LoggerRecord(1010.0, (5.0,), (10.0,)))
    (record,) = survey.take_ready()
    assert (record.x_m, record.y_m) == pytest.approx((0.0, 0.0))


def test_the_heading_is_kept_while_the_robot_stands_in_the_noise_of_its_fixes():
    course, rng = Course(), np.random.default_rng(3)
    assert math.isnan(course.at(0.0))
    for second in range(10):
        course.add(float(second), position(0.0, 1.1 * second))
    for second in range(10, 500):
        x, y = rng.normal(0, 0.02, 2)
        course.add(float(second), position(x, 9.9 + y))
    assert course.at(499.0) == pytest.approx(math.pi / 2, abs=0.05)
    assert course.at(1.0) == pytest.approx(math.pi / 2, abs=1e-3)
    assert math.isnan(course.at(0.5))


def test_poor_fixes_need_longer_steps():
    course = Course()
    course.add(0.0, position(0.0, 0.0, 2.0))
    course.add(1.0, position(5.0, 0.0, 2.0))
    assert math.isnan(course.at(1.0))
    course.add(2.0, position(7.0, 0.0, 2.0))
    assert course.at(2.0) == pytest.approx(0.0, abs=1e-3)


def test_a_course_across_the_date_line_and_its_limit():
    course = Course(max_headings=5)
    for number in range(40):
        course.add(float(number), Position(0.0, (179.9998 + number * 1e-5 + 180) % 360 - 180))
    assert course.at(39.0) == pytest.approx(0.0, abs=1e-6)
    assert len(course._stamps) <= 10


def test_arms_from_parameters():
    arms = LeverArms.of({"antenna_x_m": 0.5, "sensor_y_m": -1, "field": "x"})
    assert arms == LeverArms((0.5, 0.0), (0.0, -1.0))
    assert LeverArms.of({}) == LeverArms()
    assert arms.base_from_antenna(math.pi / 2) == pytest.approx((0.0, -0.5))
    assert arms.base_from_antenna(math.nan) is None
    assert LeverArms(sensor_m=(0.0, -1.0)).base_from_antenna(math.nan) == (0.0, 0.0)
