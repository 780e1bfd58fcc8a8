# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Counts that the map does not expect: exact probabilities, faults held back, real patterns released."""

from dataclasses import replace
from functools import partial

import numpy as np
import pytest
from scipy import integrate, stats

from soilmoist_ros.mapping import FieldGrid, FieldMap, Samples, Skip, Variogram
from soilmoist_ros.mapping.expected_counts import MIN_SAMPLES, Expectation, ExpectedCounts
from soilmoist_ros.sensing.records import CountRecord

GRID = FieldGrid.from_polygon([(0, 0), (60, 0), (60, 30), (0, 30)], 5.0)
VARIOGRAM = Variogram("matern32", nugget=0.01, range_m=20.0, sill=0.3)


def record(counts, x_m=25.0, y_m=25.0, stamp_s=1e9):
    return CountRecord(stamp_s, x_m, y_m, 0.0, counts, 10.0, 10.0)


def samples(number=36, rate_cps=8.0, exposure_s=60.0):
    x, y = np.meshgrid(np.arange(0.0, 60.0, 10.0), np.arange(0.0, 60.0, 10.0))
    xy = np.column_stack([x.ravel(), y.ravel()])[:number]
    counts = np.random.default_rng(3).poisson(rate_cps * exposure_s, number).astype(float)
    return Samples(xy, counts, np.full(number, exposure_s), np.zeros((number, 3)))


def judge(records, of=None):
    checks, of, released = ExpectedCounts(3.0), of or samples(), []
    unexpected = []
    for one in records:
        verdict = checks.judge(one, one, of, lambda: VARIOGRAM)
        unexpected.append(bool(verdict.unexpected))
        released += [held.where for held in verdict.confirmed]
    return unexpected, released


def _mean(tail, rate, ends):
    return integrate.quad(lambda r: tail(10.0 * r) * rate.pdf(r), *ends, epsabs=0, epsrel=1e-9, limit=200)[0]


@pytest.mark.parametrize(("counts", "variance"), [(0, 0.5), (13, 0.2), (80, 0.5), (160, 0.0), (40, 0.0)])
def test_tails_are_those_of_poisson_counts_at_a_gamma_rate(counts, variance):
    low, high = Expectation(8.0, variance).tails(counts, 10.0)
    if variance:
        rate = stats.gamma(8.0**2 / variance, scale=variance / 8.0)
        ends = rate.ppf([1e-15, 1 - 1e-15])
        tails = (stats.poisson.cdf, lambda n, mean: stats.poisson.sf(n - 1, mean))
        wanted = [_mean(partial(tail, counts), rate, ends) for tail in tails]
    else:
        wanted = [stats.poisson.cdf(counts, 80.0), stats.poisson.sf(counts - 1, 80.0)]
    assert [low, high] == pytest.approx(wanted, rel=1e-6)


@pytest.mark.parametrize("counts", [20, 200])
def test_one_record_that_does_not_fit_is_held_back_and_the_next_is_used(counts):
    assert judge([record(82), record(counts), record(78), record(85)]) == ([False, True, False, False], [])


@pytest.mark.parametrize("counts", [25, 160])
def test_a_hollow_that_the_next_record_confirms_is_used(counts):
    held = record(counts)
    assert judge([held, record(counts + 6, x_m=31.0)]) == ([True, False], [held])


def test_a_second_fault_on_the_other_side_confirms_nothing():
    assert judge([record(200), record(20)]) == ([True, True], [])


def test_rain_is_not_a_fault():
    # Rain lowers the rate by a third wherever the robot is.
    dry = samples(rate_cps=80.0)
    places = [(0.0, 0.0), (50.0, 0.0), (0.0, 50.0), (50.0, 50.0), (0.0, 0.0), (50.0, 0.0)]
    rain = [record(540, *place) for place in places]
    verdicts, released = judge([record(800, 25.0, 25.0), *rain], dry)
    assert verdicts == [False, True, True, False, False, False, False]
    assert released == rain[:2]


@pytest.mark.parametrize("counts", [300, 1500])
def test_what_rain_cannot_do_stays_held_back(counts):
    dry = samples(rate_cps=80.0)
    verdicts, released = judge([record(counts, *place) for place in ((0.0, 0.0), (50.0, 0.0), (0.0, 50.0))], dry)
    assert (verdicts, released) == ([True] * 3, [])


def test_counts_at_an_unknown_place_or_of_a_young_map_are_not_judged():
    assert judge([record(300)], samples(MIN_SAMPLES - 1)) == ([False], [])
    assert judge([record(300, 500.0, 500.0)]) == ([False], [])


# Counts that the map does not expect ----------------------------------------------------------------------------


def survey_of(rate_cps=lambda x_m, y_m: 8.0, seed=2):
    """Records of two lines of stops, 5 m apart, three records at each."""
    rng = np.random.default_rng(seed)
    places = [(2.5 + 5.0 * column, 5.0 + 10.0 * row) for row in range(2) for column in range(10) for _ in range(3)]
    return [
        record(int(rng.poisson(10 * rate_cps(*place))), *place, 1e9 + 10 * number)
        for number, place in enumerate(places)
    ]


def grown(records, computing=False):
    field_map = FieldMap(GRID)
    for record in records:
        field_map.add(record)
        if computing and field_map.state.records % 10 == 0:
            field_map.update()
    return field_map


def test_a_record_that_the_map_does_not_expect_is_quarantined_and_the_map_is_that_of_the_others():
    good = survey_of()
    bad = replace(good[40], raw_counts=400)
    found = grown([*good[:40], bad, *good[41:]])
    assert found.skipped[Skip.UNEXPECTED].count == 1
    assert "400 counts where the map expects 7" in found.skipped[Skip.UNEXPECTED].example
    assert found.track[40] == replace(bad, quarantine="unexpected_count")
    without = grown([*good[:40], *good[41:]])
    assert np.array_equal(found.state.samples.counts, without.state.samples.counts)
    assert found.state.records == len(good) - 1
    # A table of the track, or a map of the whole survey, has the same verdict.
    again = grown(found.track)
    assert again.track == found.track
    whole = FieldMap(GRID)
    whole.set_records([*good[:40], bad, *good[41:]])
    assert whole.track == found.track
    assert whole.state.samples.counts.sum() == found.state.samples.counts.sum()


def test_a_hollow_is_used_from_its_second_record_on_and_nothing_is_lost():
    records = survey_of(lambda x_m, y_m: 2.5 if x_m == 22.5 and y_m == 15.0 else 8.0)
    found = grown(records)
    assert Skip.UNEXPECTED not in found.skipped
    assert found.track == records
    assert found.state.samples.counts.sum() == sum(record.raw_counts for record in records)
    hollow = next(one for one in records if (one.x_m, one.y_m) == (22.5, 15.0))
    first = grown(records[: records.index(hollow) + 1])
    assert first.track[-1].quarantine == "unexpected_count"


def test_verdicts_do_not_depend_on_the_maps_that_were_computed():
    records = survey_of(seed=4)
    records[50] = replace(records[50], raw_counts=2)
    quiet, busy = grown(records), grown(records, computing=True)
    assert quiet.track == busy.track
    assert quiet.track[50].quarantine
    assert np.array_equal(quiet.update().rate, busy.update().rate, equal_nan=True)
