# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
import math
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from soilmoist_ros.sensing.checks.tubes import RunningShares, combine_tubes, tube_shares
from soilmoist_ros.sensing.records import LoggerRecord

NAN = math.nan


def record(counts, live=10.0) -> LoggerRecord:
    live_s = (live,) * len(counts) if isinstance(live, float) else tuple(live)
    return LoggerRecord(0.0, tuple(float(count) for count in counts), live_s)


def simulate(rng, shares, rates, live_s=60.0, missing=0.0):
    records = []
    for rate in rates:
        counts = rng.poisson(shares * rate * live_s).astype(float)
        counts[rng.random(len(shares)) < missing] = NAN
        records.append(record(counts, np.where(np.isnan(counts), NAN, live_s)))
    return records


def test_all_present_gives_the_sum_and_exactly_the_live_time() -> None:
    shares = np.array([0.1, 0.2, 0.3, 0.4]) / sum([0.1, 0.2, 0.3, 0.4])
    assert combine_tubes(record([1, 2, 3, 4], 59.9), shares) == (10, 59.9)


def test_a_missing_tube_takes_its_share_of_the_exposure() -> None:
    assert combine_tubes(record([4, NAN], (10.0, NAN)), [0.25, 0.75]) == (4, 2.5)


def test_unequal_live_times() -> None:
    assert combine_tubes(record([4, 6], (10.0, 20.0)), [0.5, 0.5]) == (10, 15.0)


def test_a_tube_without_a_share_is_left_out() -> None:
    assert combine_tubes(record([4, 99, 6]), [0.5, 0.0, 0.5]) == (10, 10.0)


@pytest.mark.parametrize(
    ("counts", "live", "shares"),
    [
        ([NAN, NAN], 10.0, [0.5, 0.5]),
        ([3, 4], 0.0, [0.5, 0.5]),
        ([3, 4], NAN, [0.5, 0.5]),
        ([3, 4], 10.0, [0, 0]),
        ([3], 10.0, [0.5, 0.5]),
    ],
)
def test_nothing_usable(counts, live, shares) -> None:
    with pytest.raises(ValueError, match="tube"):
        combine_tubes(record(counts, live), shares)


def test_shares_of_complete_records_are_the_tubes_parts_of_all_counts() -> None:
    shares = tube_shares([record([10, 30]), record([20, 40])])
    np.testing.assert_allclose(shares, [0.3, 0.7], rtol=1e-12)


def test_shares_are_not_biased_by_tubes_that_fail_where_it_is_wet() -> None:
    true = np.array([0.2, 0.3, 0.5])
    wet = simulate(np.random.default_rng(1), true, np.full(2000, 2.0))
    wet = [record((NAN, *one.tube_counts[1:]), (NAN, 60.0, 60.0)) for one in wet]
    dry = simulate(np.random.default_rng(2), true, np.full(2000, 6.0))
    np.testing.assert_allclose(tube_shares(wet + dry), true, atol=0.004)


@pytest.mark.slow
def test_rate_is_unbiased_and_poisson_with_tubes_missing() -> None:
    rng = np.random.default_rng(3)
    true = np.array([0.1, 0.2, 0.3, 0.4])
    records = simulate(rng, true, np.full(20_000, 5.0), missing=0.2)
    usable = [one for one in records if np.isfinite(one.tube_counts).any()]
    raw, exposure = np.array([combine_tubes(one, true) for one in usable]).T
    assert raw.sum() / exposure.sum() == pytest.approx(5.0, rel=0.003)
    standardised = (raw - 5.0 * exposure) / np.sqrt(5.0 * exposure)
    assert standardised.var() == pytest.approx(1.0, abs=0.04)


def test_a_dead_tube_has_no_share() -> None:
    assert tube_shares([record([10, NAN, 10], (10.0, NAN, 10.0)), record([10, 0, 10])])[1] == 0


@pytest.mark.parametrize("records", [[], [record([0, 0])], [record([1]), record([1, 2])]])
def test_no_shares(records) -> None:
    with pytest.raises(ValueError, match=r"records|counted"):
        tube_shares(records)


@pytest.mark.slow
@settings(deadline=None)
@given(
    st.lists(
        st.lists(st.one_of(st.just(NAN), st.integers(0, 1000)), min_size=3, max_size=3), min_size=1, max_size=20
    )
)
def test_shares_add_up_to_one(counts) -> None:
    try:
        shares = tube_shares([record(row) for row in counts])
    except ValueError:
        return
    assert np.isfinite(shares).all()
    assert shares.sum() == pytest.approx(1)


def test_running_shares_are_those_of_the_records_so_far() -> None:
    rng = np.random.default_rng(4)
    shares = rng.dirichlet(np.full(12, 400.0))
    running = RunningShares()
    for one in simulate(rng, shares, np.full(600, 6.0), live_s=10.0):
        running.update(one)
    estimate = running.update(record([NAN, *[5.0] * 11], (NAN, *[10.0] * 11)))
    assert estimate.sum() == pytest.approx(1)
    assert estimate[0] == pytest.approx(shares[0], rel=0.15)
    assert np.corrcoef(estimate, shares)[0, 1] > 0.5


def test_a_new_number_of_tubes_starts_the_shares_again() -> None:
    running = RunningShares()
    assert running.update(record([5] * 12)).tolist() == pytest.approx([1 / 12] * 12)
    assert running.update(record([5, NAN], (10.0, NAN))).tolist() == pytest.approx([0.5, 0.5], abs=0.05)


def test_a_tube_that_is_left_out_on_purpose_has_no_share() -> None:
    assert RunningShares().update(record([5, 5, NAN], (10.0, 10.0, NAN)), {2}).tolist() == [0.5, 0.5, 0.0]


def test_what_a_bad_tube_counted_before_it_was_found_is_taken_back() -> None:
    good, poisoned = RunningShares(), RunningShares()
    for number in range(60):
        counts = [40.0, 40.0, 40.0 if number < 50 else 4000.0]
        good.update(replace(record([*counts[:2], 40.0 if number < 50 else NAN]), stamp_s=float(number)))
        poisoned.update(replace(record(counts), stamp_s=float(number)))
    poisoned.mask(2, since_s=50.0)
    last = record([40.0, 40.0, NAN])
    np.testing.assert_allclose(poisoned.update(last), good.update(last), rtol=1e-6)
