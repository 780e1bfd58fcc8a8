# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Tube against tube: bad tubes are found soon, good tubes keep counting (tubes.py)."""

import math

import numpy as np
import pytest
from hypothesis import example, given
from hypothesis import strategies as st
from scipy.stats import binom, chi2, poisson

from soilmoist_ros.sensing import Kind, LoggerRecord
from soilmoist_ros.sensing.checks.tails import binomial_tails, chi_square_tail, poisson_tails
from soilmoist_ros.sensing.checks.tubes import TubeChecks, combine_tubes, tube_shares

T0 = 1.7e9
RATE_CPS = 4.0


def draw(records, tubes=12, period_s=10.0, rate_cps=RATE_CPS, seed=1):
    """Counts of good tubes with unequal shares over soil that changes, shape (records, tubes)."""
    rng = np.random.default_rng(seed)
    shares = rng.dirichlet(np.full(tubes, 100.0))
    rate = rate_cps * np.exp(0.3 * np.sin(np.arange(records) / 20))
    return rng.poisson(rate[:, None] * shares * period_s).astype(float)


def check(counts, period_s=10.0, checks=None, live_s=None):
    """Bad tubes of each record, tube -> kind."""
    checks = TubeChecks(counts.shape[1]) if checks is None else checks
    live_s = np.full(counts.shape, period_s) if live_s is None else live_s
    use = np.ones(counts.shape[1], bool)
    records = [
        LoggerRecord(T0 + period_s * number, tuple(row.tolist()), tuple(live.tolist()))
        for number, (row, live) in enumerate(zip(counts, live_s, strict=True))
    ]
    return [{bad.tube: bad.kind for bad in checks.check(record, use)} for record in records]


@pytest.mark.parametrize("tubes", [1, 2, 12])
def test_good_tubes_over_changing_soil_raise_no_alarm(tubes):
    assert not any(check(draw(400, tubes)))


def test_a_burst_masks_one_tube_in_one_record():
    counts = draw(200)
    counts[150, 4] += 60
    assert [(number, bad) for number, bad in enumerate(check(counts)) if bad] == [(150, {4: Kind.NOISY_TUBE})]


@pytest.mark.parametrize(
    ("tubes", "factor", "kind", "within"),
    [(12, 0.0, Kind.DEAD_TUBE, 12), (12, 5.0, Kind.NOISY_TUBE, 5), (12, 0.3, Kind.DEAD_TUBE, 60),
     (2, 0.0, Kind.DEAD_TUBE, 3), (2, 3.0, Kind.NOISY_TUBE, 8), (3, 2.5, Kind.NOISY_TUBE, 15)],
)  # fmt: skip
def test_a_tube_that_leaves_its_share_is_masked_and_returns_when_it_is_well(tubes, factor, kind, within):
    counts = draw(700, tubes)
    rng = np.random.default_rng(3)
    counts[400:500, 1] = rng.poisson(factor * counts[400:500].mean() * np.ones(100))
    found = check(counts)
    assert not any(found[:400])
    assert [bad for bad in found[400 + within : 500] if bad != {1: kind}] == []
    assert not any(found[600:])
    assert {tube for bad in found for tube in bad} == {1}


def test_without_a_record_before_nobody_can_say_which_of_two_tubes_is_bad():
    assert check(np.array([[40.0, 40000.0]]))[0] == {0: Kind.NOISY_TUBE, 1: Kind.NOISY_TUBE}


def test_the_period_of_a_bad_tube_begins_where_it_went_wrong():
    counts = draw(500)
    counts[400:440, 3] = 0.0
    checks = TubeChecks(12)
    check(counts, checks=checks)
    [span] = checks.spans
    assert (span.tube, span.kind) == (3, Kind.DEAD_TUBE)
    assert T0 + 3990 <= span.begin_s <= T0 + 4020
    again = TubeChecks(12, spans=checks.spans)
    assert [bad for bad in check(counts, checks=again)[402:440] if bad != {3: Kind.DEAD_TUBE}] == []


def test_live_times_and_missing_tubes_count():
    counts = draw(300)
    live_s = np.full(counts.shape, 10.0)
    live_s[100:, 2] = 5.0
    counts[100:, 2] = np.random.default_rng(1).binomial(counts[100:, 2].astype(int), 0.5)
    counts[200:, 5] = math.nan
    assert not any(check(counts, live_s=live_s))


# Tubes -----------------------------------------------------------------------------------------------------------

NAN = math.nan


def record(counts, live=10.0) -> LoggerRecord:
    live_s = (live,) * len(counts) if isinstance(live, float) else tuple(live)
    return LoggerRecord(0.0, tuple(float(count) for count in counts), live_s)


def simulate(rng, shares, rate, number=2000):
    return [record(rng.poisson(shares * rate * 60.0), 60.0) for _ in range(number)]


def test_all_tubes_have_exactly_the_live_time_and_a_missing_one_takes_its_share_of_the_exposure() -> None:
    shares = np.array([0.1, 0.2, 0.3, 0.4]) / sum([0.1, 0.2, 0.3, 0.4])
    assert combine_tubes(record([1, 2, 3, 4], 59.9), shares) == (10, 59.9)
    assert combine_tubes(record([4, NAN], (10.0, NAN)), [0.25, 0.75]) == (4, 2.5)


def test_shares_are_not_biased_by_tubes_that_fail_where_it_is_wet() -> None:
    true = np.array([0.2, 0.3, 0.5])
    wet = simulate(np.random.default_rng(1), true, 2.0)
    wet = [record((NAN, *one.tube_counts[1:]), (NAN, 60.0, 60.0)) for one in wet]
    dry = simulate(np.random.default_rng(2), true, 6.0)
    np.testing.assert_allclose(tube_shares(wet + dry), true, atol=0.004)


def test_a_tube_that_is_left_out_on_purpose_has_no_share() -> None:
    checks = TubeChecks(3, unused={2})
    checks.check(record([5, 5, NAN], (10.0, 10.0, NAN)), np.array([True, True, False]))
    assert checks.shares.tolist() == [0.5, 0.5, 0.0]


def test_a_tube_alone_says_nothing_about_its_share() -> None:
    counts = np.random.default_rng(1).poisson([160.0, 240.0], (80, 2)).astype(float)
    counts[:50, 0] = NAN
    checks = TubeChecks(2)
    check(counts, checks=checks)
    assert checks.shares == pytest.approx(counts[50:].sum(axis=0) / counts[50:].sum(), abs=0.002)


# Tails of counts are those of SciPy (tails.py) -------------------------------------------------------------------


CLOSE = {"rel": 1e-9, "abs": 1e-290}
COUNTS = st.integers(0, 20_000)


@given(COUNTS, st.floats(1e-6, 5e4))
@example(0, 0.0)
@example(3, 0.0)
@example(0, 800.0)
@example(20_000, 1.0)
def test_poisson(count, mean):
    assert poisson_tails(count, mean) == (
        pytest.approx(poisson.cdf(count, mean), **CLOSE),
        pytest.approx(poisson.sf(count - 1, mean), **CLOSE),
    )


@given(COUNTS, COUNTS, st.floats(1e-6, 1 - 1e-6) | st.sampled_from([0.0, 1.0]))
def test_binomial(count, rest, share):
    total = count + rest
    assert binomial_tails(count, total, share) == (
        pytest.approx(binom.cdf(count, total, share), **CLOSE),
        pytest.approx(binom.sf(count - 1, total, share), **CLOSE),
    )


@given(st.integers(1, 5000), st.floats(0, 3))
def test_chi_square(freedom, index):
    expected = chi2.sf(freedom * index, freedom)
    assert chi_square_tail(freedom, freedom * index) == pytest.approx(expected, **CLOSE)
    assert math.isfinite(expected)
