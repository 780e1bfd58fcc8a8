# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Sensitivity of a sensor from counts beside another one: two tubes of a station, and simulations."""

import math
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from soilmoist_ros.foundation import InputError
from soilmoist_ros.sensing import LoggerRecord, Site, compare_side_by_side, read_log

KANSAS = Path(__file__).parents[3] / "examples" / "station_kansas_2021-10.dat"
SITE = Site()


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


def thinned(log, share, period_s=3600.0, seed=1, keep=lambda stamp_s: True, shift_s=0.0):
    """A sensor of another sensitivity and interval beside the station: independent Poisson counts."""
    rng, parts = np.random.default_rng(seed), round(3600 / period_s)
    records = []
    for r in log.records:
        for part in range(parts):
            stamp_s = r.stamp_s - 3600 + (part + 1) * period_s
            counts = tuple(float(c) for c in rng.poisson(share * 785 / parts, 2))
            if keep(stamp_s):
                records.append(
                    replace(r, stamp_s=stamp_s + shift_s, tube_counts=counts, tube_live_s=(period_s,) * 2)
                )
    return with_records(log, records)


@pytest.mark.slow
def test_two_tubes_of_one_station(station):
    first, second = tube(station, 0), tube(station, 1)
    found = compare_side_by_side(first, SITE, second, SITE)
    counts = [sum(r.tube_counts[0] for r in logs[0].records) for logs in (first, second)]
    assert found.ratio == pytest.approx(counts[0] / counts[1], rel=0.002)
    assert found.ratio_sd / found.ratio == pytest.approx(math.sqrt(1 / counts[0] + 1 / counts[1]), rel=0.01)
    back = compare_side_by_side(second, SITE, first, SITE)
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
        found = compare_side_by_side(one, SITE, other, SITE)
        errors.append((found.ratio - 0.5) / found.ratio_sd)
    assert np.std(errors) == pytest.approx(1, abs=0.5)
    assert abs(np.mean(errors)) < 0.8


@pytest.mark.slow
def test_only_time_that_both_counted_is_used_and_gaps_are_named(station):
    begin = station.records[0].stamp_s
    own = thinned(station, 0.5, 600.0, keep=lambda s: not 20 * 3600 < s - begin <= 50 * 3600)
    found = compare_side_by_side(own, SITE, [station], SITE)
    ((first, last),) = found.gaps
    assert (first - begin, last - begin) == (20 * 3600, 50 * 3600)
    assert found.counted_s == pytest.approx(3600 * (len(station.records) - 30), abs=3600)


@pytest.mark.slow
def test_no_overlap_too_few_counts_and_clocks_are_errors(station):
    half = len(station.records) // 2
    early, late = (with_records(station, part) for part in (station.records[:half], station.records[half:]))
    with pytest.raises(InputError, match="has no time that both sensors counted"):
        compare_side_by_side(early, SITE, late, SITE)
    with pytest.raises(InputError, match=r"a ratio \+- \d+ %.*count for \d+ h"):
        compare_side_by_side(
            thinned(station, 0.01, keep=lambda s: s < station.records[9].stamp_s), SITE, [station], SITE
        )
    with pytest.raises(InputError, match="one clock is shifted by 6 h"):
        compare_side_by_side(thinned(station, 0.5, shift_s=6 * 3600), SITE, [station], SITE)
    assert compare_side_by_side(thinned(station, 0.5, shift_s=300), SITE, [station], SITE).ratio < 0.6
    bare = with_records(station, [LoggerRecord(1.0, (math.nan,), (math.nan,))])
    with pytest.raises(InputError):
        compare_side_by_side(bare, SITE, [station], SITE)
