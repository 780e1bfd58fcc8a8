"""Tests of counts, record by record: impossible counts and weather (checks.py, finding.py)."""

import math
from dataclasses import replace

import pytest

from soilmoist_ros.foundation.geodesy import LocalFrame
from soilmoist_ros.sensing.checks.checks import RecordChecks
from soilmoist_ros.sensing.checks.weather import check_weather, pressure_limits_hpa, standard_pressure_hpa
from soilmoist_ros.sensing.moisture.site import Site
from soilmoist_ros.sensing.problems import Kind
from soilmoist_ros.sensing.records import LoggerRecord, Position
from soilmoist_ros.sensing.survey.survey import Survey

GOOD = LoggerRecord(1.7e9, (40.0,), (10.0,), 1005.0, 12.0, 0.6, Position(50.0, 10.0, 100.0))


@pytest.mark.parametrize(
    ("altitude_m", "pressure_hpa"), [(0, 1013.25), (1000, 898.75), (2000, 794.95), (5000, 540.20)]
)
def test_pressure_of_the_standard_atmosphere(altitude_m, pressure_hpa):
    """Against the tables of the International Standard Atmosphere."""
    assert standard_pressure_hpa(altitude_m) == pytest.approx(pressure_hpa, abs=0.02)


def test_weather_that_the_air_cannot_have_is_left_out():
    bad = replace(GOOD, pressure_hpa=300.0, temperature_degc=128.9, relative_humidity=1.19)
    record, findings = check_weather(bad)
    assert [finding.kind for finding in findings] == [Kind.IMPOSSIBLE_WEATHER] * 3
    assert all(math.isnan(v) for v in (record.pressure_hpa, record.temperature_degc, record.relative_humidity))
    assert check_weather(GOOD) == (GOOD, [])


def test_the_altitude_decides_which_pressure_is_possible():
    plateau = replace(GOOD, pressure_hpa=540.0, position=None)
    assert check_weather(plateau, 5000.0)[1] == check_weather(plateau)[1] == []
    assert len(check_weather(plateau, 100.0)[1]) == 1
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


def test_the_checks_need_no_position_and_skip_tubes_that_are_not_used():
    wild = replace(GOOD, tube_counts=(40.0, 9e9), tube_live_s=(10.0, 10.0), position=None)
    assert RecordChecks().check(wild).quarantine == "impossible_count"
    assert RecordChecks().check(wild, unused_tubes=[1]).quarantine == ""
