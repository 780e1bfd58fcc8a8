# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Record against record: bursts of the whole sensor, and the dispersion of a log (totals.py)."""

import numpy as np
import pytest

from soilmoist_ros.sensing.checks.totals import Dispersion, TotalChecks
from soilmoist_ros.sensing.records import NAN, CountRecord


def log(counts, period_s=10.0, speed_mps=0.0):
    """Records at one place, or along a line."""
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


def test_on_the_way_only_what_no_soil_causes_is_unexpected():
    rng = np.random.default_rng(3)
    rate = np.where(np.arange(100) % 40 < 20, 30.0, 75.0)
    counts = rng.poisson(rate)
    counts[70] = 500
    assert found(log(counts, speed_mps=1.0)) == [70]


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


def test_no_soil_is_drier_than_dry():
    assert found(log([60, 400, 60]), n0_cps=6.0) == [1]
    assert found(log([60, 70, 80]), n0_cps=6.0) == []


def test_quarantined_records_are_no_reference():
    checks = TotalChecks()
    bad = CountRecord(1.7e9, 0.0, 0.0, 0.0, 9000, 10.0, 10.0, quarantine="stuck_tube")
    assert checks.check(bad) == []
    assert all(checks.check(record) == [] for record in log([40] * 10))
    assert checks.recorded.index > 1000 * checks.used.index + 1000


def test_the_index_of_dispersion_is_1_for_counts_whose_mean_changes_slowly():
    rng = np.random.default_rng(5)
    mean = 700 * np.exp(0.3 * np.sin(np.arange(4000) / 100))
    dispersion = Dispersion()
    for record in log(rng.poisson(mean), 3600.0):
        dispersion.add(record)
    assert dispersion.pairs == 2000
    assert dispersion.index == pytest.approx(1.0, abs=4 * np.sqrt(2 / 2000))
    assert not dispersion.is_high


def test_a_log_that_scatters_more_than_counting_statistics_is_reported():
    rng = np.random.default_rng(6)
    checks = TotalChecks()
    counts = rng.negative_binomial(50, 50 / (50 + 200.0), 400)  # variance 5 times the mean
    for record in log(counts, 3600.0):
        checks.check(record)
    [finding] = checks.findings
    assert checks.recorded.index == pytest.approx(5.0, rel=0.3)
    assert "the index of dispersion is" in finding.message
    assert not finding.bad


def test_unknown_places_and_other_places_are_no_pairs():
    dispersion = Dispersion()
    for record in [*log([40, 900, 40, 800], speed_mps=10.0), CountRecord(1.8e9, NAN, NAN, NAN, 9, 10.0, 10.0)]:
        dispersion.add(record)
    assert dispersion.pairs == 0
    assert np.isnan(dispersion.index)
