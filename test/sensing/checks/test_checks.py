"""Tests of counts, record by record: impossible counts and weather (checks.py, finding.py)."""

import math
from dataclasses import replace

import numpy as np

from soilmoist_ros.foundation.geodesy import LocalFrame
from soilmoist_ros.sensing.checks.checks import RecordChecks
from soilmoist_ros.sensing.checks.weather import WeatherChecks, pressure_limits_hpa
from soilmoist_ros.sensing.moisture.site import Site
from soilmoist_ros.sensing.problems import Kind
from soilmoist_ros.sensing.records import LoggerRecord, Position
from soilmoist_ros.sensing.survey.survey import Survey

GOOD = LoggerRecord(1.7e9, (40.0,), (10.0,), 1005.0, 12.0, 0.6, Position(50.0, 10.0, 100.0))


def test_weather_that_the_air_cannot_have_is_left_out():
    bad = replace(GOOD, pressure_hpa=300.0, temperature_degc=128.9, relative_humidity=1.19)
    record, findings = WeatherChecks().check(bad)
    assert [finding.kind for finding in findings] == [Kind.IMPOSSIBLE_WEATHER] * 3
    assert all(math.isnan(v) for v in (record.pressure_hpa, record.temperature_degc, record.relative_humidity))
    assert WeatherChecks().check(GOOD) == (GOOD, [])


def test_the_altitude_decides_which_pressure_is_possible():
    plateau = replace(GOOD, pressure_hpa=540.0, position=None)
    assert WeatherChecks(5000.0).check(plateau)[1] == WeatherChecks().check(plateau)[1] == []
    assert len(WeatherChecks(100.0).check(plateau)[1]) == 1
    low, high = pressure_limits_hpa(0.0)
    assert low < 870
    assert high > 1085


def test_a_count_that_no_tube_reaches_is_quarantined_and_listed():
    problems = []
    site = Site(corrections={"humidity": None})
    survey = Survey(site, LocalFrame(50.0, 10.0), on_problem=problems.append)
    for counts in (40.0, 1.2e6, 38.0):
        survey.take_record(replace(GOOD, tube_counts=(counts,)))
    assert [record.quarantine for record in survey.take_ready()] == ["", "impossible_count", ""]
    [problem] = problems
    assert problem.kind is Kind.IMPOSSIBLE_COUNT
    assert problem.consequence == "quarantined"
    assert "1200000 counts in 10 s" in str(problem)


def test_the_other_tubes_still_count():
    wild = replace(GOOD, tube_counts=(40.0, 9e9), tube_live_s=(10.0, 10.0), position=None)
    checked = RecordChecks().check(wild)
    assert [finding.kind for finding in checked.findings] == [Kind.IMPOSSIBLE_COUNT]
    assert not checked.quarantine
    np.testing.assert_equal(checked.record.tube_counts, (40.0, math.nan))
    assert RecordChecks().check(wild, unused_tubes=[1]).findings == ()
