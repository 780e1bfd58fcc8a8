# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Record against record: bursts of the whole sensor, the dispersion of a log, and the weather."""

import math
from dataclasses import replace

import numpy as np
import pytest

from soilmoist_ros.foundation.geodesy import LocalFrame
from soilmoist_ros.sensing import CountRecord, Kind, LoggerRecord, Position, Site
from soilmoist_ros.sensing.checks.record_checks import Dispersion, TotalChecks, WeatherChecks, pressure_limits_hpa
from soilmoist_ros.sensing.survey.survey import Survey


def log(counts, period_s=10.0, speed_mps=0.0):
    return [
        CountRecord(1.7e9 + period_s * n, speed_mps * period_s * n, 0.0, 0.0, int(each), period_s, period_s)
        for n, each in enumerate(counts)
    ]


def found(records, **known):
    checks = TotalChecks(**known)
    return [number for number, record in enumerate(records) if checks.check(record)]


def test_a_burst_at_a_stop_is_unexpected():
    counts = np.random.default_rng(1).poisson(40.0, 60)
    counts[[30, 31]] = 150, 4000
    assert found(log(counts)) == [30, 31]


@pytest.mark.parametrize("speed_mps", [0.0, 1.0])
def test_soil_and_rain_may_change_the_rate(speed_mps):
    rng = np.random.default_rng(2)
    rate = np.concatenate([np.full(40, 60.0), np.full(40, 38.0), np.full(40, 55.0)])
    assert found(log(rng.poisson(rate), speed_mps=speed_mps)) == []


def test_a_bad_first_record_does_not_condemn_the_good_ones_that_follow():
    counts = np.random.default_rng(4).poisson(40.0, 60)
    counts[0] = 5000
    assert found(log(counts), typical_cps=4.0) == [0]
    blind = found(log(counts))
    assert blind == list(range(1, 1 + len(blind)))
    assert len(blind) <= 10


def test_noise_of_the_whole_sensor_is_not_believed_because_it_lasts():
    counts = np.random.default_rng(7).poisson(40.0, 300)
    counts[200:260] = 480
    assert found(log(counts)) == list(range(200, 260))
    assert found(log(counts, speed_mps=1.0)) == list(range(200, 260))


def test_the_index_of_dispersion_is_1_for_counts_whose_mean_changes_slowly():
    rng = np.random.default_rng(5)
    mean = 700 * np.exp(0.3 * np.sin(np.arange(4000) / 100))
    dispersion = Dispersion()
    for record in log(rng.poisson(mean), 3600.0):
        dispersion.add(record)
    assert dispersion.pairs == 2000
    assert dispersion.index == pytest.approx(1.0, abs=4 * np.sqrt(2 / 2000))
    assert not dispersion.is_high


def scattered(counts):
    checks = TotalChecks()
    for record in log(counts, 3600.0):
        checks.check(record)
    return checks


def test_a_log_that_scatters_more_or_less_than_counting_statistics_is_reported():
    rng = np.random.default_rng(6)
    noisy = scattered(rng.negative_binomial(50, 50 / (50 + 200.0), 400))  # variance 5 times the mean
    [finding] = noisy.findings
    assert noisy.dispersion.index == pytest.approx(5.0, rel=0.3)
    assert (finding.kind, finding.bad) == (Kind.OVERDISPERSED, False)
    assert "the index of dispersion is" in finding.message
    counts = rng.poisson(400.0, 400)
    assert scattered(counts).findings == []
    smoothed, stuck = np.convolve(counts, np.full(5, 0.2), "valid"), np.full(60, 41.0)
    for numbers in (smoothed, stuck):
        [finding] = scattered(numbers).findings
        assert (finding.kind, finding.bad) == (Kind.NOT_COUNTS, False)
    hourly = rng.poisson(2000.0, 300)
    assert scattered(np.round(hourly / 100) * 100).findings == []  # rounded by the logger


# Checks ----------------------------------------------------------------------------------------------------------

GOOD = LoggerRecord(1.7e9, (40.0,), (10.0,), 1005.0, 12.0, 0.6, Position(50.0, 10.0, 100.0))


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


@pytest.mark.parametrize(
    ("method", "key"), [("cores", "n0_cps"), ("general", "sensor_sensitivity"), ("combined", "n0_cps")]
)
def test_an_impossible_count_names_the_key_that_n0_comes_from(method, key):
    problems = []
    site = Site(calibration={"n0_cps": 0.5, "method": method}, corrections={"humidity": None, "pressure": None})
    survey = Survey(site, LocalFrame(50.0, 10.0), on_problem=problems.append)
    survey.take_record(GOOD)
    list(survey.take_ready())
    assert f"'{key}' in the site file" in str(problems[0])


def test_impossible_weather_comes_from_other_records_or_the_record_is_quarantined():
    problems = []
    survey = Survey(Site(corrections={"humidity": None}), LocalFrame(50.0, 10.0), on_problem=problems.append)
    pressures = (300.0, 1005.0, 300.0)
    for number, pressure_hpa in enumerate(pressures):
        counts = (40.0 + number,)
        record = replace(GOOD, stamp_s=GOOD.stamp_s + 10 * number, tube_counts=counts, pressure_hpa=pressure_hpa)
        survey.take_record(record)
    first, second, third = survey.take_ready()
    assert (first.quarantine, second.quarantine, third.quarantine) == ("impossible_weather", "", "")
    assert (first.effective_exposure_s, third.f_pressure) == (first.exposure_s, second.f_pressure)
    assert [(problem.kind, problem.consequence) for problem in problems] == [
        (Kind.IMPOSSIBLE_WEATHER, "quarantined"), (Kind.IMPOSSIBLE_WEATHER, "kept")
    ]  # fmt: skip


@pytest.mark.slow
def test_a_file_is_masked_from_where_a_tube_went_wrong_and_its_shares_are_those_of_good_counts():
    rng = np.random.default_rng(4)
    shares = np.array([0.2, 0.25, 0.25, 0.3])
    counts = rng.poisson(40 * shares, (600, 4)).astype(float)
    counts[300:330, 2] = 0.0
    counts[450:460, 0] = rng.poisson(200.0, 10)
    records = [
        replace(GOOD, stamp_s=GOOD.stamp_s + 10 * number, tube_counts=tuple(row.tolist()), tube_live_s=(10.0,) * 4)
        for number, row in enumerate(counts)
    ]
    site = Site(corrections={"pressure": None, "humidity": None})
    problems = []
    survey = Survey(site, LocalFrame(50.0, 10.0), records, on_problem=problems.append)
    np.testing.assert_allclose(survey.tube_share, shares, atol=0.01)
    found = []
    for record in records:
        survey.take_record(record)
        found += survey.take_ready()
    masked = [number for number, record in enumerate(found) if record.exposure_s < 9.99]
    assert set(masked) >= {*range(300, 330), *range(450, 460)}
    assert len(masked) <= 45
    assert not any(record.quarantine for record in found)
    rate = sum(record.raw_counts for record in found) / sum(record.exposure_s for record in found)
    assert abs(rate - 4.0) < 4 * np.sqrt(4.0 / 6000)
    assert {problem.kind for problem in problems} == {Kind.DEAD_TUBE, Kind.NOISY_TUBE}
    assert not survey.checks.totals.dispersion.is_high


# Weather ---------------------------------------------------------------------------------------------------------


def series(pressures, period_s):
    return [
        replace(GOOD, stamp_s=1.7e9 + period_s * n, pressure_hpa=float(p), temperature_degc=12.0, position=None)
        for n, p in enumerate(pressures)
    ]


def kinds(records, altitude_m):
    checks = WeatherChecks()
    return {n: f[0].kind for n, record in enumerate(records) if (f := checks.check(record, altitude_m)[1])}


def test_weather_that_the_air_cannot_have_is_left_out():
    bad = replace(GOOD, pressure_hpa=300.0, temperature_degc=128.9, relative_humidity=1.19)
    record, findings = WeatherChecks().check(bad)
    assert [finding.kind for finding in findings] == [Kind.IMPOSSIBLE_WEATHER] * 3
    assert all(math.isnan(v) for v in (record.pressure_hpa, record.temperature_degc, record.relative_humidity))
    assert WeatherChecks().check(GOOD) == (GOOD, [])


@pytest.mark.parametrize(
    ("altitude_m", "pressure_hpa", "possible"),
    [(5000.0, 540.0, True), (100.0, 540.0, False), (math.nan, 540.0, True), (2500.0, 750.0, True),
     (2500.0, 1013.0, False), (-400.0, 1060.0, True), (9500.0, 290.0, True)],
)  # fmt: skip
def test_the_altitude_decides_which_pressure_is_possible(altitude_m, pressure_hpa, possible):
    low, high = pressure_limits_hpa(altitude_m)
    assert (low <= pressure_hpa <= high) is possible


WRONG = np.full(400, 1005.0)
WRONG[200:290] = 965.0


@pytest.mark.parametrize(
    ("pressures", "period_s", "altitude_m", "bad"),
    [
        ([1005.0, 1004.8, 950.0, 1004.9, 1005.1], 10.0, math.nan, [2]),
        ([1005.0, *(950.0 + 0.1 * n for n in range(12))], 10.0, math.nan, [1, 2, 3, 4, 5]),  # it stays
        (WRONG, 10.0, 30.0, list(range(200, 290))),  # not believed because it lasts
        (1013 - np.cumsum(np.full(24, 6.0)), 3600.0, 100.0, []),  # 6 hPa an hour, the fastest drops of storms
        (1013 - np.cumsum(np.full(30, 12.0)), 60.0, math.nan, []),  # a mountain road: 100 m a minute
    ],
)
def test_a_jump_of_the_pressure_is_left_out(pressures, period_s, altitude_m, bad):
    assert kinds(series(pressures, period_s), altitude_m) == dict.fromkeys(bad, Kind.IMPOSSIBLE_WEATHER)
