# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""The change of the rate from a stationary reference sensor."""

from dataclasses import replace

import numpy as np
import pytest

from soilmoist_ros.foundation.errors import InputError
from soilmoist_ros.sensing.corrections.reference import MAX_GAP_S, fit_reference
from soilmoist_ros.sensing.records import CountRecord

START_S, END_S = 1.78e9, 1.78e9 + 7200.0


def reference(seed, change=0.0, rate_cps=10.0, period_s=60.0, jump=False, before_s=3600.0):
    """Records of a reference sensor whose rate changes by a share during the survey, evenly or at its middle."""
    rng = np.random.default_rng(seed)
    ends = np.arange(START_S - before_s + period_s, END_S + before_s + 1, period_s)
    done = (ends - period_s / 2 - START_S) / 7200
    done = np.round(np.clip(done, 0, 1)) if jump else done
    counts = rng.poisson(rate_cps * (1 + change * done) * period_s)
    nan = float("nan")
    return [
        CountRecord(end_s, nan, nan, nan, int(count), period_s, period_s)
        for end_s, count in zip(ends.tolist(), counts.tolist(), strict=True)
    ]


def survey(number=80):
    stamps = np.linspace(START_S + 10, END_S, number)
    return [CountRecord(stamp_s, 1.0, 2.0, 0.0, 40, 10.0, 9.5) for stamp_s in stamps.tolist()]


@pytest.mark.slow
@pytest.mark.parametrize("change", [-0.2, 0.0, 0.1, 0.3])
def test_the_change_is_found_with_its_uncertainty(change):
    found = [fit_reference(reference(seed, change), START_S, END_S) for seed in range(12)]
    changes, sds = np.array([one.change for one in found]).T
    assert changes.mean() == pytest.approx(change, abs=0.01)
    assert (np.abs(changes - change) <= 3 * sds + 0.003).all()
    assert sds.max() < 0.04


def test_counts_are_corrected_to_the_end_of_the_survey():
    one = fit_reference(reference(1, 0.2), START_S, END_S)
    records = survey()
    corrected = one.corrected(records)
    assert corrected[-1].corrected_rate == pytest.approx(records[-1].corrected_rate, rel=0.01)
    assert corrected[0].corrected_rate == pytest.approx(1.2 * records[0].corrected_rate, rel=0.04)
    assert [record.raw_counts for record in corrected] == [40] * 80


def test_hourly_records_are_enough_and_bad_ones_are_left_out():
    hourly = reference(1, 0.2, period_s=3600.0, before_s=7200.0)
    assert fit_reference(hourly, START_S, END_S).change[0] == pytest.approx(0.2, abs=0.06)
    bad = [replace(one, raw_counts=10**6, quarantine="noisy_tube") for one in reference(1)[::7]]
    assert fit_reference([*reference(1), *bad], START_S, END_S).change[0] == pytest.approx(0.0, abs=0.03)


@pytest.mark.parametrize(
    ("kept", "message"),
    [
        (lambda stamp_s: stamp_s < START_S, "no good record during the survey"),
        (lambda stamp_s: not 0 < stamp_s - START_S - 600 < MAX_GAP_S + 120, "for 3. min of the survey, from 2026"),
        (lambda stamp_s: stamp_s < END_S - MAX_GAP_S - 120, "for 3. min of the survey"),
        (lambda stamp_s: stamp_s > START_S + MAX_GAP_S + 120, "for 3. min of the survey"),
    ],
)
def test_a_reference_must_last_for_the_survey(kept, message):
    with pytest.raises(InputError, match=message):
        fit_reference([one for one in reference(1) if kept(one.stamp_s)], START_S, END_S)


@pytest.mark.slow
def test_the_covariance_is_that_of_the_errors_at_several_times():
    times = np.linspace(START_S, END_S, 5)
    one = fit_reference(reference(1, 0.1), START_S, END_S)
    covariance = one.factor_covariance(times)
    np.testing.assert_allclose(covariance, covariance.T, atol=1e-12)
    assert np.linalg.eigvalsh(covariance).min() > -1e-10
    assert covariance[-1, -1] == pytest.approx(0, abs=1e-10)  # the end is what the others are relative to
    errors = np.array(
        [np.log(fit_reference(reference(seed, 0.1), START_S, END_S).factor(times)) for seed in range(40)]
    )
    errors -= np.log(1.1 / (1 + 0.1 * (times - START_S) / 7200))
    assert np.sqrt((errors[:, 0] ** 2).mean()) == pytest.approx(np.sqrt(covariance[0, 0]), rel=0.5)
