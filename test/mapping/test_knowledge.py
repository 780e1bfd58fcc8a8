# SPDX-FileCopyrightText: 2026 The soilmoist_ros developers
# SPDX-License-Identifier: Apache-2.0
"""Earlier surveys, covariates, and all that is known together."""

import numpy as np
import pytest

from soilmoist_ros.mapping.knowledge import NOTHING, EarlierSurvey, Knowledge, samples_at_end
from soilmoist_ros.mapping.records import survey_samples
from soilmoist_ros.mapping.samples import NO_SAMPLES, Samples
from soilmoist_ros.sensing.records import CountRecord

ONE = Samples([(5.0, 5.0)], [300], [100.0])


def test_knowledge_is_empty_unless_something_is_known():
    assert NOTHING.is_empty
    assert not Knowledge(earlier=(EarlierSurvey("may", 0.0, ONE),)).is_empty


def test_an_earlier_survey_needs_samples_and_a_time():
    with pytest.raises(ValueError, match="no samples"):
        EarlierSurvey("may", 0.0, NO_SAMPLES)
    with pytest.raises(ValueError, match="stamp_s"):
        EarlierSurvey("may", float("nan"), ONE)


def records(change):
    """Three passes over the same stops in two hours, while the rate changes by a share."""
    rng = np.random.default_rng(3)
    x, y = np.meshgrid(np.arange(5.0, 60, 10), np.arange(5.0, 50, 10))
    stops = np.tile(np.column_stack([x.ravel(), y.ravel()]), (3, 1))
    time_s = np.linspace(60, 7200, len(stops))
    rate = 4.0 + 0.5 * np.sin(stops[:, 0] / 15) + change * 4 * (time_s / 7200 - 1)
    return [
        CountRecord(time, *place, 0.0, int(counts), 60.0, 60.0)
        for time, place, counts in zip(
            time_s.tolist(), stops.tolist(), rng.poisson(60 * rate).tolist(), strict=True
        )
    ]


@pytest.mark.parametrize(("change", "near"), [(0.3, True), (0.0, False)])
def test_a_drift_is_taken_off_and_nothing_else(change, near):
    then, now = survey_samples(records(change), 2.0), samples_at_end(records(change), 2.0, 0.0, 60.0)
    np.testing.assert_array_equal(then.xy, now.xy)
    np.testing.assert_array_equal(then.counts, now.counts)
    if near:
        expected = 4.0 + 0.5 * np.sin(now.xy[:, 0] / 15)
        assert abs(np.mean(now.rate_cps - expected)) < 0.15 < np.mean(expected - then.rate_cps)
    else:
        np.testing.assert_array_equal(then.exposure_s, now.exposure_s)
