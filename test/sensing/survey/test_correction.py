# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""From a raw record to a corrected, geo-tagged one: correction.py, side_by_side.py, and a public station."""

import math
import re
from collections import Counter
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from soilmoist_ros.foundation import InputError
from soilmoist_ros.foundation.geodesy import LocalFrame
from soilmoist_ros.sensing import (
    CountRecord,
    Kind,
    LoggerFormat,
    LoggerRecord,
    Position,
    Site,
    compare_side_by_side,
    process_logs,
    read_log,
)
from soilmoist_ros.sensing.problems import LostRecordError
from soilmoist_ros.sensing.survey.correction import (
    WeatherSeries,
    correct_record,
    counting_interval_s,
    place_record,
)

NAN = math.nan
ONE = np.array([1.0])


def record(stamp_s: float, live_s: float = 10.0, pressure_hpa: float = 1000.0) -> LoggerRecord:
    return LoggerRecord(stamp_s, (50.0,), (live_s,), pressure_hpa, 20.0, 0.5)


def test_the_exposure_is_divided_by_the_product_of_the_factors() -> None:
    found = correct_record(record(0.0), Site(), None, ONE)
    assert found.f_pressure == pytest.approx(math.exp(0.0077 * (1000 - 1013.25)))
    assert found.effective_exposure_s == pytest.approx(10.0 / (found.f_pressure * found.f_humidity))
    assert (found.raw_counts, found.exposure_s) == (50, 10.0)
    assert math.isnan(found.x_m)


@pytest.mark.parametrize(
    ("raw", "kind"), [(record(0.0, NAN), Kind.NO_COUNTS), (record(0.0, pressure_hpa=NAN), Kind.NO_CORRECTION)]
)
def test_an_unusable_record_has_a_reason(raw, kind) -> None:
    with pytest.raises(LostRecordError) as caught:
        correct_record(raw, Site(), None, ONE)
    assert caught.value.finding.kind is kind


def test_a_record_is_placed_in_the_plane_or_not_at_all() -> None:
    corrected = CountRecord(0.0, NAN, NAN, NAN, 50, 10.0, 10.0)
    frame = LocalFrame(50.0, 10.0)
    latitude, longitude = frame.to_geographic((30.0, -40.0))[0].tolist()
    placed = place_record(corrected, Position(latitude, longitude, 5.0), frame)
    assert (placed.x_m, placed.y_m, placed.z_m) == (pytest.approx(30.0), pytest.approx(-40.0), 5.0)
    for position in (None, Position(-50.0, -170.0)):
        with pytest.raises(LostRecordError) as caught:
            place_record(corrected, position, frame)
        assert caught.value.finding.kind is Kind.NO_POSITION


@pytest.mark.parametrize(
    ("since_s", "interval_s"),
    [(9.9, 10.0), (10.0, 10.0), (10.5, 10.5), (15.0, 15.0), (15.01, 10.0), (600.0, 10.0)],
)
def test_the_interval_begins_at_the_record_before_up_to_one_and_a_half_live_times(since_s, interval_s) -> None:
    assert counting_interval_s(record(100.0 + since_s), record(100.0)) == pytest.approx(interval_s)


# Weather ---------------------------------------------------------------------------------------------------------


def series_of(records) -> WeatherSeries:
    series = WeatherSeries()
    for one in records:
        series.add(one)
    return series


def pressure(series: WeatherSeries, stamp_s: float) -> float:
    return series.filled(record(stamp_s, pressure_hpa=NAN)).pressure_hpa


def test_gaps_of_a_logger_that_writes_every_hour_are_some_records_long() -> None:
    def hourly(hour: float, pressure_hpa: float = NAN) -> LoggerRecord:
        return record(3600 * hour, 3600.0, pressure_hpa)

    series = series_of([hourly(0, 1000.0), hourly(4, 1004.0), hourly(9, 1010.0)])
    assert [series.filled(hourly(hour)).pressure_hpa for hour in (1, 2, 3)] == pytest.approx([1001, 1002, 1003])
    assert series.filled(hourly(6)).pressure_hpa == pytest.approx(1004 + 6 * 2 / 5)
    series = series_of([hourly(0, 1000.0), hourly(9, 1010.0)])
    assert math.isnan(series.filled(hourly(4)).pressure_hpa)


@given(
    st.lists(
        st.tuples(st.integers(0, 400), st.floats(900, 1100)), min_size=2, max_size=12, unique_by=lambda p: p[0]
    ),
    st.integers(0, 400),
)
def test_between_values_it_is_the_interpolation_of_numpy(points, stamp_s) -> None:
    points.sort()
    stamps, values = zip(*points, strict=True)
    series = series_of(record(float(at), pressure_hpa=value) for at, value in zip(stamps, values, strict=True))
    assert pressure(series, float(stamp_s)) == np.interp(stamp_s, stamps, values)


# Noisy station -------------------------------------------------------------------------------------------------

DATA = Path(__file__).parents[2] / "data" / "noisy_station.csv"
LOGGER = LoggerFormat.model_validate(
    {
        "title": "station",
        "source": "a test",
        "header": {
            "columns": ["time", "pressure", "humidity", "temperature", "inside", "battery", "n1", "n2", "n3"]
        },
        "time": {"columns": ["time"], "formats": ["%m/%d/%Y %H:%M"]},
        "counts": {"columns": ["n{tube}"]},
        "live_time": {"from_stamps": True},
        "record_period": {"default_s": 3600},
        "pressure": {"sensors": [{"column": "pressure", "unit": "hPa"}]},
        "temperature": {"sensors": [{"column": "temperature"}]},
        "humidity": {"sensors": [{"column": "humidity"}]},
    }
)
SITE = Site(
    location={"latitude_deg": 39.1106, "longitude_deg": -96.613},
    corrections={"pressure": {"beta_per_hpa": 1 / 130, "reference_hpa": 979.0}},
)
# crnpy was run on these records: counts outside its limits are replaced from their neighbours.
CRNPY_CPS = 0.6614040529524622


@pytest.mark.slow
def test_a_noisy_tube_does_not_change_the_rate_and_is_listed() -> None:
    log = read_log(DATA, LOGGER)
    assert log.records_lost == 0
    noisy = sum(np.nanmax(record.tube_counts) > 2000 for record in log.records)
    assert noisy > 60
    survey = process_logs([log], SITE)
    rate_cps = sum(record.raw_counts for record in survey.records) / sum(
        record.effective_exposure_s for record in survey.records
    )
    assert rate_cps == pytest.approx(CRNPY_CPS, rel=0.01)
    believed = sum(np.nansum(record.tube_counts) for record in log.records)
    exposure_s = sum(record.tube_live_s[0] for record in log.records)
    assert believed / exposure_s > 1.5 * rate_cps
    assert np.max([record.corrected_rate for record in survey.records]) < 1.4 * rate_cps
    found = Counter((problem.kind, problem.consequence) for problem in survey.problems)
    assert found[Kind.NOISY_TUBE, "kept"] > 100
    assert "the other tubes expect" in str(next(p for p in survey.problems if p.kind is Kind.NOISY_TUBE))
    assert found[Kind.OVERDISPERSED, "kept"] == 1
    index = re.search(r"dispersion is (\S+) as recorded and (\S+) without", str(survey.problems[-1]))
    assert (float(index[1]) > 200, float(index[2]) < 3) == (True, True)


# Side by side --------------------------------------------------------------------------------------------------

KANSAS = Path(__file__).parents[3] / "examples" / "station_kansas_2021-10.dat"
SITE_SIDE_BY_SIDE = Site()


@pytest.fixture(scope="module")
def station():
    return read_log(KANSAS)


def with_records(log, records):
    return [replace(log, records=tuple(records))]


def tube(log, number):
    return with_records(
        log,
        (
            replace(r, tube_counts=r.tube_counts[number::2], tube_live_s=r.tube_live_s[number::2])
            for r in log.records
        ),
    )


def thinned(log, share, period_s=3600.0, seed=1, keep=lambda stamp_s: True):
    """A sensor of another sensitivity and interval beside the station: independent Poisson counts."""
    rng, parts = np.random.default_rng(seed), round(3600 / period_s)
    records = []
    for r in log.records:
        for part in range(parts):
            stamp_s = r.stamp_s - 3600 + (part + 1) * period_s
            counts = tuple(float(c) for c in rng.poisson(share * 785 / parts, 2))
            if keep(stamp_s):
                records.append(replace(r, stamp_s=stamp_s, tube_counts=counts, tube_live_s=(period_s,) * 2))
    return with_records(log, records)


@pytest.mark.slow
def test_two_tubes_of_one_station(station):
    first, second = tube(station, 0), tube(station, 1)
    found = compare_side_by_side(first, SITE_SIDE_BY_SIDE, second, SITE_SIDE_BY_SIDE)
    counts = [sum(r.tube_counts[0] for r in logs[0].records) for logs in (first, second)]
    assert found.ratio == pytest.approx(counts[0] / counts[1], rel=0.002)
    assert found.ratio_sd / found.ratio == pytest.approx(math.sqrt(1 / counts[0] + 1 / counts[1]), rel=0.01)
    back = compare_side_by_side(second, SITE_SIDE_BY_SIDE, first, SITE_SIDE_BY_SIDE)
    assert back.ratio == pytest.approx(1 / found.ratio)
    value, sd = found.sensitivity(2.0, 0.1)
    assert value == pytest.approx(2 * found.ratio)
    assert sd == pytest.approx(value * math.hypot(found.ratio_sd / found.ratio, 0.05))


@pytest.mark.slow
@pytest.mark.parametrize("period_s", [3600.0, 600.0])
def test_the_stated_error_covers_the_truth_whatever_the_intervals(station, period_s):
    errors = []
    (station,) = with_records(station, station.records[:48])
    for seed in range(12):
        one, other = thinned(station, 0.5, period_s, seed), thinned(station, 1.0, 3600.0, 1000 + seed)
        found = compare_side_by_side(one, SITE_SIDE_BY_SIDE, other, SITE_SIDE_BY_SIDE)
        errors.append((found.ratio - 0.5) / found.ratio_sd)
    assert np.std(errors) == pytest.approx(1, abs=0.5)
    assert abs(np.mean(errors)) < 0.8


@pytest.mark.slow
def test_only_time_that_both_counted_is_used(station):
    begin = station.records[0].stamp_s
    own = thinned(station, 0.5, 600.0, keep=lambda s: not 20 * 3600 < s - begin <= 50 * 3600)
    found = compare_side_by_side(own, SITE_SIDE_BY_SIDE, [station], SITE_SIDE_BY_SIDE)
    assert found.counted_s == pytest.approx(3600 * (len(station.records) - 30), abs=3600)


@pytest.mark.slow
def test_no_overlap_and_too_few_counts_are_errors(station):
    half = len(station.records) // 2
    early, late = (with_records(station, part) for part in (station.records[:half], station.records[half:]))
    with pytest.raises(InputError, match="has no time that both sensors counted"):
        compare_side_by_side(early, SITE_SIDE_BY_SIDE, late, SITE_SIDE_BY_SIDE)
    with pytest.raises(InputError, match=r"a ratio \+- \d+ %.*count for \d+ h"):
        compare_side_by_side(
            thinned(station, 0.01, keep=lambda s: s < station.records[9].stamp_s),
            SITE_SIDE_BY_SIDE,
            [station],
            SITE_SIDE_BY_SIDE,
        )
    bare = with_records(station, [LoggerRecord(1.0, (math.nan,), (math.nan,))])
    with pytest.raises(InputError):
        compare_side_by_side(bare, SITE_SIDE_BY_SIDE, [station], SITE_SIDE_BY_SIDE)
